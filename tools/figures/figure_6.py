"""Figure 6 of the paper: reference and x, open loop against closed loop, and both errors."""

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from afm_model.run.plotting import envelope

from . import style
from .runs import Runs, units


def draw(runs: Runs) -> Figure:
    """(a), (c) open loop; (b), (d) closed loop."""
    figure, axes = plt.subplots(2, 2, figsize=(style.WIDTH, 4.8), layout="constrained")
    soft = runs("open_loop")
    # The error of the closed loop is a thousand times smaller: picometres.
    for column, name in enumerate(("paper_4_1", "paper_4_2_sgn")):
        run = runs(name)
        unit = units(run.parameters)
        t = 1e3 * run.time
        x, reference = 1e9 * run.position[:, 0], 1e9 * run.reference[:, 0]
        top, bottom = axes[:, column]
        top.plot(*envelope(t, x), label="$x$", **style.MOTION)
        top.plot(*envelope(t, reference), label="$x_r$", **style.THIRD)
        scale, length = ((1.0, "nm"), (1e3, "pm"))[column]
        bottom.plot(*envelope(t, scale * (x - reference)), rasterized=column == 1, **style.MOTION)
        top.set(ylabel="$x$ [nm]")
        bottom.set(ylabel=f"$x - x_r$ [{length}]", xlabel="time [ms]")
        style.opposite(top, x=(r"$\tau$ [$1/\omega_0$]", unit.time), y=("$X$ [$x_0$]", unit.length))
        style.opposite(bottom, y=("$e_x$ [$x_0$]", scale * unit.length))
    for ax, title in zip(axes.flat, ("(a) open loop", "(b) closed loop", "(c) error", "(d) error"), strict=True):
        ax.set_title(title, loc="left")
    axes[0, 0].plot(
        *envelope(1e3 * soft.time, 1e9 * soft.position[:, 0]), label="$x$, compliant plant", **style.OVERLAY
    )
    for ax in axes[0]:
        ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=3, columnspacing=1.2)
    return figure
