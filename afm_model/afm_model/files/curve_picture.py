"""A picture of force curves: the vertical force over z, approach and retract."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..core.prefix import prefixed
from ..microscope.verbs.force_curve import Curve, as_curves
from ..program.force_curve import APPROACH, RETRACT
from .picture import PNG, new_figure, write_figure
from .result_files import checked

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

_SIZE = (5.6, 4.2)
_PARTS = ((APPROACH, "approach", "tab:blue"), (RETRACT, "retract", "tab:orange"))


def curve_picture(curves: "Curve | Sequence[Curve] | xarray.Dataset", title: str = "") -> "Figure":
    """Force curves in one diagram: z from the turn [nm or so], force positive away from the sample.

    Parameters
    ----------
    curves : Curve or sequence of Curve, or their labelled arrays
    title : str, optional

    Raises
    ------
    ValueError
        If there is no curve, or it is something else.
    ImportError
        If matplotlib is not installed.
    """
    every = as_curves(curves)
    if not every:
        raise ValueError("there is no force curve to draw")
    figure = new_figure(_SIZE)
    axes = figure.subplots()
    lines = []
    for curve in every:
        found = curve.arrays().variables
        z, force, phase = (np.asarray(found[name].values, np.float64) for name in ("z", "force", "phase"))
        turn = float(z.max()) if len(z) else 0.0
        lines += [(phase == part, z - turn, force, name, colour) for part, name, colour in _PARTS]
    largest = [max(float(np.abs(line[i]).max(initial=0.0)) for line in lines) for i in (1, 2)]
    (z_factor, z_unit), (factor, unit) = prefixed("m", largest[0]), prefixed("N", largest[1])
    for number, (part, z, force, name, colour) in enumerate(lines):
        label = name if number < len(_PARTS) else None
        axes.plot(z_factor * z[part], factor * force[part], color=colour, linewidth=0.9, label=label)
    axes.axhline(0.0, color="0.6", linewidth=0.6)
    axes.set(xlabel=f"z from the turn, towards the sample [{z_unit}]", ylabel=f"force [{unit}]")
    axes.legend(frameon=False)
    axes.set_title(title or f"{len(every)} force curve{'s' if len(every) > 1 else ''}", fontsize="medium")
    return figure


def write_curve_picture(path: Path | str, curves: "Curve | Sequence[Curve] | xarray.Dataset", title: str = "") -> Path:
    """As `write_picture`, of a `curve_picture`."""
    checked(path, PNG)
    return write_figure(path, curve_picture(curves, title))
