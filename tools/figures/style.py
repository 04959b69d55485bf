"""How every figure looks: sizes, lines that differ in grey too, axes in SI with nondimensional ones opposite."""

from io import BytesIO
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

WIDTH = 6.9
"""Width of a figure [inch], that of a printed page."""
DPI = 240
REFERENCE = {"color": "0.45", "linestyle": (0, (4, 2)), "linewidth": 1.3}
MOTION = {"color": "black", "linestyle": "-", "linewidth": 1.0}
SECOND = {"color": "#0072b2", "linestyle": "-", "linewidth": 0.9}
THIRD = {"color": "#d55e00", "linestyle": (0, (1.5, 1)), "linewidth": 1.2}
OVERLAY = {"color": "#56b4e9", "linestyle": (0, (5, 2)), "linewidth": 1.0}
DENSE = {"color": "#8fc1e3", "linestyle": "-", "linewidth": 0.8}
"""A band of chatter, light enough for a line on top of it."""

_SETTINGS = {
    "font.size": 8,
    "axes.titlesize": 8.5,
    "axes.labelsize": 8,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "legend.fontsize": 8,
    "axes.grid": True,
    "axes.xmargin": 0.02,
    "grid.color": "0.9",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "legend.frameon": True,
    "legend.framealpha": 0.9,
    "legend.edgecolor": "none",
    "path.simplify_threshold": 0.3,
    "svg.fonttype": "path",
    # The same figure gives the same bytes.
    "svg.hashsalt": "afm",
}


def use(dpi: float = DPI) -> None:
    """Apply the style to all figures of this process, PNG with `dpi`; no display is needed."""
    matplotlib.use("Agg")
    matplotlib.rcParams.update(_SETTINGS | {"savefig.dpi": dpi})


def opposite(ax: Axes, *, x: tuple[str, float] | None = None, y: tuple[str, float] | None = None) -> None:
    """Nondimensional axes at the top and on the right: label, and its unit in the unit of the axis opposite."""
    for place, choice in (("top", x), ("right", y)):
        if choice is None:
            continue
        label, unit = choice
        functions = (lambda v, unit=unit: np.asarray(v) / unit, lambda v, unit=unit: np.asarray(v) * unit)
        if place == "top":
            ax.secondary_xaxis("top", functions=functions).set_xlabel(label)
        else:
            ax.secondary_yaxis("right", functions=functions).set_ylabel(label)


def box(ax: Axes, place: tuple[float, float, float, float], x: tuple[float, float], y: tuple[float, float]) -> Axes:
    """Magnified part of a panel inside of it, at `place` in its own width and height, with a frame around the part."""
    inset = ax.inset_axes(place, xlim=x, ylim=y)
    inset.tick_params(labelsize=6.5, pad=1.5, length=2.0)
    _, lines = ax.indicate_inset_zoom(inset, edgecolor="0.35", alpha=1.0, linewidth=0.8)
    for line in lines or ():
        line.set_visible(False)
    return inset


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write PNG and SVG; dense traces are pictures in the SVG too."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}.png", folder / f"{name}.svg"]
    drawn = BytesIO()
    figure.savefig(drawn, metadata={"Software": None})
    # A drawing has few colours: a palette keeps the file small at a resolution fit for print.
    Image.open(drawn).convert("RGB").quantize(128, dither=Image.Dither.NONE).save(paths[0], optimize=True)
    # Laid out once: that takes half of the time.
    figure.set_layout_engine("none")
    figure.savefig(paths[1], dpi=min(110, matplotlib.rcParams["savefig.dpi"]), metadata={"Date": None, "Creator": None})
    return paths
