"""Scans as files of Gwyddion: .gwy, every layer with units, size, place and notes; .gsf, one layer as Simple Field."""

import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.optional import needed
from ..core.prefix import text
from ..microscope.image import Image, as_image
from .layers import Layer, description, layer, layers
from .result_files import replacing

if TYPE_CHECKING:
    import xarray

    from ..microscope.raster import Raster


class FrameWarning(UserWarning):
    """The frame of a scan is one that some readers of .gwy files take for another."""


def write_gwy(path: Path | str, image: "Image | xarray.Dataset") -> Path:
    """Write all layers of a scan into a .gwy file.

    Row 0 of the file is the top of the picture, that is the largest y of the frame. Values are double precision in SI
    units. What is not measured is the layer's mean and masked, as Gwyddion itself does it with files that hold NaN.
    The angle has no separate place in the format; it is among the notes. There is no boolean component: a reader in
    use, AFMReader up to 0.0.7, never ends at one.

    Parameters
    ----------
    path : Path or str
        Ends with .gwy. A file of this name is replaced once the new one is whole.
    image : Image, or its labelled arrays
        A scan, as far as it came.

    Raises
    ------
    ResultFileError
        If it cannot be written.
    ImportError
        If gwyfile is not installed.

    Warns
    -----
    FrameWarning
        If AFMReader up to 0.0.7, and TopoStats by it, would show the frame as another one without an error: they take
        the number of pixels for that of lines, and one size of a pixel for both directions.
    """
    GwyContainer = needed("gwyfile.objects", "a .gwy file").GwyContainer
    image = as_image(image)
    notes = description(image)
    content: Any = GwyContainer()
    for number, each in enumerate(layers(image)):
        place = f"/{number}"
        measured = each.measured
        filled = np.where(measured, each.values, each.values[measured].mean() if measured.any() else 0.0)
        content[f"{place}/data"] = _field(image, filled, each.unit)
        content[f"{place}/data/title"] = each.title
        if not measured.all():
            content[f"{place}/mask"] = _field(image, np.where(measured, 0.0, 1.0), "")
        content[f"{place}/meta"] = GwyContainer(_notes(each, notes), dict.fromkeys(_notes(each, notes), "s"))
        # A text of one character would be taken for a number.
        content.typecodes[f"{place}/data/title"] = "s"
    with replacing(path, ".gwy") as beside:
        content.tofile(str(beside))
    if problem := _misread(image.scan):
        warnings.warn(
            f"{path}: AFMReader (up to 0.0.7) and TopoStats {problem}, without an error; Gwyddion and gwyfile read the "
            "file as it is. For those programs scan as many lines as pixels, in a square frame",
            FrameWarning,
            stacklevel=2,
        )
    return Path(path)


def _misread(scan: "Raster") -> str:
    """What some readers make of a frame that is not square; empty if they read it as it is."""
    if scan.lines != scan.pixels:
        return f"scramble an image of {scan.pixels} pixels in {scan.lines} lines"
    if not math.isclose(scan.height, scan.size_x):
        return f"take a frame of {text(scan.size_x, 'm')} x {text(scan.height, 'm')} for a square one"
    return ""


def _notes(layer: Layer, notes: dict[str, str]) -> dict[str, str]:
    # A NUL ends a text in the file.
    return {"Channel": layer.name} | {name: value.replace("\0", "") for name, value in notes.items()}


def _top(scan: "Raster") -> float:
    """Place of the frame's top [m]: less its largest y, since Gwyddion's y grows downwards.

    Two frames of one sample then lie next to each other as they are scanned, for its tools that stitch and crop.
    """
    return -float(scan.centre_y + 0.5 * scan.height)


def _field(image: Image, values: Any, unit: str) -> Any:
    from gwyfile.objects import GwyDataField

    scan = image.scan
    return GwyDataField(
        np.ascontiguousarray(values[::-1]),
        xreal=float(scan.size_x),
        yreal=float(scan.height),
        xoff=float(scan.centre_x - 0.5 * scan.size_x),
        yoff=_top(scan),
        si_unit_xy="m",
        si_unit_z="" if unit == "1" else unit,
    )


_MAGIC = "Gwyddion Simple Field 1.0\n"


def write_gsf(path: Path | str, image: "Image | xarray.Dataset", name: str = "height_trace") -> Path:
    """Write one layer of a scan into a .gsf file.

    Row 0 of the file is the top of the picture, that is the largest y of the frame. Values are single precision in SI
    units; what is not measured is NaN, which Gwyddion masks.

    Parameters
    ----------
    path : Path or str
        Ends with .gsf. A file of this name is replaced once the new one is whole.
    image : Image, or its labelled arrays
        A scan, as far as it came.
    name : str
        Of the layer, as `height_trace` or `friction`.

    Raises
    ------
    ResultFileError
        If it cannot be written.
    ValueError
        If the scan has no such layer.

    Source: the format's description in Gwyddion's user guide.
    """
    image = as_image(image)
    found, scan = layer(image, name), image.scan
    lines = {
        "XRes": str(scan.pixels),
        "YRes": str(scan.lines),
        "XReal": repr(float(scan.size_x)),
        "YReal": repr(float(scan.height)),
        "XOffset": repr(float(scan.centre_x - 0.5 * scan.size_x)),
        "YOffset": repr(_top(scan)),
        "Title": found.title,
        "XYUnits": "m",
        "ZUnits": "" if found.unit == "1" else found.unit,
    }
    # Readers cut a line at its '='.
    notes = {_plain(title): _plain(value) for title, value in description(image).items()}
    header = _MAGIC + "".join(f"{key} = {value}\n" for key, value in (lines | notes).items())
    encoded = header.encode()
    with replacing(path, ".gsf") as beside:
        padding = b"\0" * (4 - len(encoded) % 4)
        beside.write_bytes(encoded + padding + found.values[::-1].astype("<f4").tobytes())
    return Path(path)


def _plain(words: str) -> str:
    return words.replace(" = ", " ").replace("=", " ").replace("\0", "")
