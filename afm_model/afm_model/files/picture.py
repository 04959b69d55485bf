"""Pictures of a scan: a layer, or a sheet with all of them. matplotlib is wanted only when one is drawn."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..core.optional import needed
from ..core.prefix import prefixed, text
from ..microscope.image import Image, as_image
from . import level
from .layers import Layer, layer, layers
from .result_files import checked, replacing

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_Array = NDArray[np.float64]
Levelling = Literal["background", "plane", "lines", "none"]
COLOURS = "cividis"
"""The map of colours: even steps of brightness, the same to a colour-blind eye."""
_MISSING = "0.82"
_CLIPPED = 1.0
"""Part of the pixels at each end that a few spikes may not stretch the colours by [per cent]."""
_LEAST = {"m": 1e-12, "N": 1e-12, "V": 1e-4, "rad": 1e-3}
"""Ranges of the colours, by unit, below which no instrument measures: what differs by less is drawn in one colour."""
_SINGLE, _PANEL, _WORDS = 5.2, 3.3, 0.85
"""Width of a picture alone, of a panel of a sheet, and the height of title and scale bar, about [inch]."""
_FLATTEST = 0.2
"""Least height over width with which a frame is drawn."""
_TALLEST = 2.0
"""Largest height over width for which a picture grows."""
_DPI = 150
PNG = ".png"


def levelled(found: Layer, how: Levelling | None = None) -> tuple[_Array, str]:
    """Values of a layer as a picture shows them, and a text about the levelling.

    Parameters
    ----------
    found : Layer
    how : str, optional
        "background" (the plane that most of it lies on), "plane" (of least squares), "lines" (each by its median) or
        "none". If it is not given: that of the background of a height, nothing of the rest.

    Returns
    -------
    (ndarray (lines, pixels), str)
    """
    if how is None:
        how = "background" if found.title.startswith("Height") else "none"
    if how == "background":
        return level.background(found.values), "less its background"
    if how == "plane":
        return level.plane(found.values), "less its plane"
    if how == "lines":
        return level.lines(found.values), "less the median of each line"
    if how == "none":
        return found.values, ""
    raise ValueError(f"a picture is levelled by background, plane, lines or none, not by {how!r}")


def scale_bar(width: float) -> float:
    """Length of a scale bar: 1, 2 or 5 times a power of ten, as long as possible up to a third of the width [m]."""
    power = 10.0 ** math.floor(math.log10(width / 3.0))
    return max(each * power for each in (1.0, 2.0, 5.0) if each * power <= width / 3.0 * (1.0 + 1e-9))


def draw(axes: "Axes", image: Image, found: Layer, how: Levelling | None = None) -> None:
    """Draw a layer with scale bar, colour bar and title into axes that are empty.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
    image : Image
    found : Layer
        One of `layers(image)`.
    how : str, optional
        Levelling, see `levelled`.
    """
    from matplotlib import colormaps
    from matplotlib.lines import Line2D
    from matplotlib.ticker import MaxNLocator, ScalarFormatter
    from matplotlib.transforms import ScaledTranslation

    width, height = image.scan.size_x, image.scan.height
    stretched = max(1.0, _FLATTEST * width / height)
    values, taken_off = levelled(found, how)
    seen = values[np.isfinite(values)]
    low, high = np.percentile(seen, (_CLIPPED, 100.0 - _CLIPPED)) if len(seen) else (0.0, 1.0)
    least = _LEAST.get(found.unit, 1e-9 * max(abs(low), abs(high)))
    factor, unit = prefixed(found.unit, low, high, least)
    if high - low <= least:
        # One colour: a bar from end to end would show rounding.
        middle, half = 0.5 * (low + high), 0.5 * max(1.0 / factor, least)
        low, high = middle - half, middle + half
    colours = colormaps[COLOURS].with_extremes(bad=_MISSING)
    shown = axes.imshow(
        np.ma.masked_invalid(values) * factor,
        origin="lower",
        extent=(0.0, width, 0.0, height),
        cmap=colours,
        vmin=low * factor,
        vmax=high * factor,
        interpolation="nearest",
        aspect=stretched,
    )
    beyond = (bool(len(seen)) and seen.min() < low, bool(len(seen)) and seen.max() > high)
    extend = {(False, False): "neither", (True, False): "min", (False, True): "max", (True, True): "both"}[beyond]
    # A part of the picture's own axes, so that it is as high as the picture. As many numbers as there is place for,
    # whatever they are: the layout is made before the bar has its size. No offset: it would stand in the title.
    tall = max(1.0, height / width)
    bar = axes.figure.colorbar(
        shown,
        cax=axes.inset_axes((1.0 + 0.03 * tall, 0.0, 0.045 * tall, 1.0)),
        extend=extend,
        ticks=MaxNLocator(2 if height < 0.6 * width else 4),
        format=ScalarFormatter(useOffset=False),
    )
    bar.set_label(unit, fontsize="small")
    axes.set(xticks=[], yticks=[])
    words = [found.title, taken_off, f"y drawn {stretched:.2g} times as long" if stretched > 1.0 else ""]
    axes.set_title("\n".join(filter(None, words)), fontsize="medium")
    # Below the picture, where it hides nothing.
    length = scale_bar(width)
    below = axes.transAxes + ScaledTranslation(0.0, -8.0 / 72.0, axes.figure.dpi_scale_trans)
    place: dict[str, Any] = {"transform": below, "clip_on": False}
    axes.add_line(
        Line2D([0.0, length / width], [0.0, 0.0], color="black", linewidth=3.0, solid_capstyle="butt", **place)
    )
    axes.text(length / width + 0.02, 0.0, text(length, "m"), va="center", fontsize="small", **place)


def new_figure(size: tuple[float, float]) -> "Figure":
    """An empty figure [inch]; ImportError where matplotlib is not installed."""
    figure: Figure = needed("matplotlib.figure", "a picture").Figure(figsize=size, layout="constrained")
    return figure


def _tall(image: Image, wide: float) -> float:
    """Height of a picture with its title and scale bar, if it is so wide with its colour bar [inch]."""
    ratio = image.scan.height / image.scan.size_x
    return 0.7 * wide * min(max(ratio, _FLATTEST), _TALLEST) + _WORDS


def _caption(image: Image) -> str:
    scan = image.scan
    parts = [
        f"{text(scan.size_x, 'm')} x {text(scan.height, 'm')}",
        f"{scan.pixels} x {scan.lines} pixels",
        f"{image.line_rate or scan.line_rate:.4g} Hz",
    ]
    if scan.angle:
        parts.append(f"{math.degrees(scan.angle):.4g}°")
    if image.lines_done < scan.lines:
        parts.append(f"{image.lines_done} lines measured")
    return ", ".join(parts)


def picture(
    image: "Image | xarray.Dataset", name: str = "height_trace", how: Levelling | None = None, title: str = ""
) -> "Figure":
    """A layer of a scan with scale bar, colour bar and title; up is +y of the frame.

    Parameters
    ----------
    image : Image, or its labelled arrays
        A scan, as far as it came; what is not measured is grey.
    name : str
        Of the layer, as `height_trace` or `friction`.
    how : str, optional
        Levelling, see `levelled`.
    title : str, optional
        Above that of the layer; without, what was scanned.

    Raises
    ------
    ValueError
        If the scan has no such layer.
    ImportError
        If matplotlib is not installed.
    """
    image = as_image(image)
    found = layer(image, name)
    figure = new_figure((_SINGLE, _tall(image, _SINGLE) + 0.2))
    draw(figure.subplots(), image, found, how)
    figure.suptitle(title or _caption(image), fontsize="small")
    return figure


def sheet(image: "Image | xarray.Dataset", title: str = "") -> "Figure":
    """All layers of a scan on one sheet: traces above retraces, friction above crosstalk.

    Raises
    ------
    ImportError
        If matplotlib is not installed.
    """
    image = as_image(image)
    every = layers(image)
    columns = (len(every) + 1) // 2
    figure = new_figure((columns * _PANEL, 2.0 * _tall(image, _PANEL) + 0.6))
    for axes, found in zip(figure.subplots(2, columns, squeeze=False).T.ravel(), every, strict=False):
        draw(axes, image, found)
    figure.suptitle("\n".join(filter(None, (title, _caption(image)))))
    return figure


def write_picture(
    path: Path | str,
    image: "Image | xarray.Dataset",
    name: str = "height_trace",
    how: Levelling | None = None,
    title: str = "",
) -> Path:
    """Write `picture`, which raises what it cannot draw, into a PNG file; the same scan gives the same bytes.

    Raises
    ------
    ResultFileError
        If it cannot be written.
    """
    checked(path, PNG)
    return write_figure(path, picture(image, name, how, title))


def write_sheet(path: Path | str, image: "Image | xarray.Dataset", title: str = "") -> Path:
    """As `write_picture`, of a `sheet`."""
    checked(path, PNG)
    return write_figure(path, sheet(image, title))


def write_figure(path: Path | str, figure: "Figure") -> Path:
    """Write a figure into a PNG file, whole or not at all."""
    with replacing(path, PNG) as beside:
        # Tight: the layout leaves too little place for some numbers at a bar of colours.
        figure.savefig(beside, dpi=_DPI, bbox_inches="tight", pad_inches=0.08, metadata={"Software": None})
    return Path(path)
