"""The picture of a run. matplotlib is wanted only when one is drawn."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..core.optional import needed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Figure

_Array = NDArray[np.float64]

SIZE = (12.0, 9.5)
"""Width and height of the picture [inch]."""
_NANO = 1e9
_LOOP_POINTS = 40_000
"""Points of a friction loop; more are no use to the eye and more than matplotlib fills in one piece."""
# The reference is drawn widest, x narrower on top of it, y narrowest: where they coincide, all are seen.
_REFERENCES = ({"color": "0.8", "linewidth": 7.0}, {"color": "0.65", "linewidth": 5.0})
_X: dict[str, Any] = {"label": "x", "color": "#7db4e6", "linewidth": 3.0}
_Y: dict[str, Any] = {"label": "y", "color": "#b3400e", "linewidth": 1.0}
_Z: dict[str, Any] = {"label": "z", "color": "#2a7f3f", "linewidth": 0.8}
_FORCE: dict[str, Any] = {"color": "#5a3d8a", "linewidth": 0.8}
_ABOVE: dict[str, Any] = {
    "loc": "lower right",
    "bbox_to_anchor": (1.0, 1.0),
    "ncols": 4,
    "fontsize": "small",
    "frameon": False,
}
"""A legend next to the title, where it hides nothing."""


@dataclass(frozen=True)
class Curves:
    """What a picture shows: n control ticks, SI units."""

    time: _Array  # (n,) [s]
    position: _Array  # (n, 3) scanner [m]
    reference: _Array  # (n, 3) x, y of the scanner, z of the tip [m]
    error: _Array  # (n, 3) x, y of the scanner, z of the tip [m]
    drive: _Array  # (n, 3) [V]
    lateral_force: _Array  # (n,) along x [N]


def envelope(t: _Array, y: _Array, columns: int = 1200) -> tuple[_Array, ...]:
    """Least and largest value in each of `columns` stretches of a dense curve: drawn, they look the same.

    Parameters
    ----------
    t, y : ndarray (n,)
    columns : int

    Returns
    -------
    (ndarray, ndarray)
        Points of the curve, in order, the first and the last one among them.
    """
    width = len(t) // columns
    if width < 4:
        return t, y
    n = len(t) // width * width
    parts = y[:n].reshape(-1, width)
    first = np.arange(0, n, width)
    both = np.sort(np.column_stack([first + parts.argmin(axis=1), first + parts.argmax(axis=1)]), axis=1).ravel()
    kept = np.unique(np.concatenate([[0], both, [len(t) - 1]]))
    return t[kept], y[kept]


def plot(curves: Curves, title: str = "") -> "Figure":
    """Draw a run into a new figure of pyplot, which a notebook shows by itself.

    Parameters
    ----------
    curves : Curves
    title : str

    Raises
    ------
    ImportError
        If matplotlib is not installed.
    """
    figure: Figure = needed("matplotlib.pyplot", "a plot").figure(figsize=SIZE, layout="constrained")
    draw(figure, curves, title)
    return figure


def draw(figure: "Figure", curves: Curves, title: str = "") -> None:
    """Draw position and reference, errors with z on its own axis, drive, lateral force and friction loop.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty one.
    curves : Curves
    title : str
    """
    figure.suptitle(title)
    ((position, loop), (error, force), (tip, drive)) = figure.subplots(3, 2)
    for axes in (position, error, tip, force, drive):
        axes.set_xlabel("simulated time [ms]")
    t = curves.time * 1e3

    def line(axes: "Axes", y: _Array, **style: Any) -> None:
        axes.plot(*envelope(t, y, 4000), **style)

    names: tuple[str, ...] = ("reference",)
    if not np.array_equal(curves.reference[:, 0], curves.reference[:, 1]):
        names = ("reference x", "reference y")
    for i, name in enumerate(names):
        line(position, curves.reference[:, i] * _NANO, label=name, **_REFERENCES[i])
    for i, style in enumerate((_X, _Y)):
        line(position, curves.position[:, i] * _NANO, **style)
        line(error, curves.error[:, i] * _NANO, **style)
    line(tip, curves.error[:, 2] * _NANO, **_Z)
    # A drive may chatter, and is a band then: the narrowest is drawn last.
    swing = np.ptp(np.nan_to_num(curves.drive), axis=0)
    for i, style in enumerate((_X, _Y, _Z)):
        line(drive, curves.drive[:, i], **style | {"linewidth": 0.9, "zorder": 2.0 + np.sum(swing > swing[i])})
    line(force, curves.lateral_force * _NANO, **_FORCE)
    thinned = slice(None, None, max(1, len(t) // _LOOP_POINTS))
    loop.plot(curves.position[thinned, 0] * _NANO, curves.lateral_force[thinned] * _NANO, **_FORCE)
    loop.set_xlabel("scanner position x [nm]")
    for axes, name, label in (
        (position, "scanner position", "x, y [nm]"),
        (loop, "friction loop along x", "lateral force [nN]"),
        (error, "tracking error of the scanner", "x, y [nm]"),
        (force, "lateral force along x", "lateral force [nN]"),
        (tip, "tracking error of the tip", "z [nm]"),
        (drive, "drive", "x, y, z [V]"),
    ):
        axes.set_title(name, loc="left")
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        if len(axes.lines) > 1:
            axes.legend(**_ABOVE)
