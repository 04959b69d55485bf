"""The first picture of the README: the closed loop, and below it the open loop, whose input is a force."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from afm_model.run.plotting import envelope

from . import style
from .runs import Runs, control_force, friction, scored

ROWS = (("closed_loop_tanh", "closed loop"), ("open_loop", "open loop"))
_X = {"label": "$x$", "color": "#7db4e6", "linewidth": 3.0}
_Y = {"label": "$y$", "color": "#b3400e", "linewidth": 1.0}


def draw(runs: Runs) -> Figure:
    """One period of each: what is put in, how the scanner moves, lateral force against position."""
    figure, axes = plt.subplots(2, 3, figsize=(style.WIDTH * 1.3, 4.7), layout="constrained")
    for (scenario, loop), (left, middle, right) in zip(ROWS, axes, strict=True):
        run = runs(scenario)
        closed = loop == "closed loop"
        shown = np.ones_like(run.time, bool) if closed else scored(run)
        t = 1e3 * (run.time - run.time[shown][0])[shown]
        position, force = 1e9 * run.position[shown], friction(run)[shown]
        if closed:
            left.plot(t, 1e9 * run.reference[shown, 0], **style.MOTION)
            error = 1e9 * np.abs(run.error[shown, :2]).max()
            middle.text(0.97, 0.95, f"largest error {error:.2g} nm", transform=middle.transAxes, ha="right", va="top")
        else:
            left.plot(t, control_force(run)[shown, 0], **style.MOTION)
        for i, line in enumerate((_X, _Y)):
            middle.plot(*envelope(t, position[:, i]), **line)
        right.plot(*np.column_stack([position[:, 0], force[:, 0]])[:: max(1, len(t) // 20_000)].T, **style.MOTION)
        _name(left, "input: the position wanted [nm]" if closed else "input: a force on the scanner [nN]", loop)
        _name(middle, "position of the scanner [nm]", loop)
        _name(right, "lateral force [nN]", loop)
        for ax in (left, middle):
            ax.set_xlabel("time [ms]")
        right.set_xlabel("position $x$ [nm]")
    axes[0, 1].legend(loc="lower left")
    return figure


def _name(ax: Axes, what: str, loop: str) -> None:
    ax.set_title(f"{loop}\n{what}", loc="left")
