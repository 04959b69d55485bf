"""What an operator sees while the gain of the z loop is tuned: trace, retrace, and the error of the deflection."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from afm_model.run.plotting import envelope

from . import style
from .runs import Runs, scored

SCENARIO = "tuning"
GAINS = {"too low": 1e9, "right": 5e10, "too high": 9.5e10}
"""Integral gains along z [V/(m s)]."""


def draw(runs: Runs) -> Figure:
    """A line for each gain: heights above, errors below."""
    figure, axes = plt.subplots(
        2, len(GAINS), figsize=(style.WIDTH, 3.6), layout="constrained", sharex=True, sharey="row"
    )
    for column, (name, gain) in enumerate(GAINS.items()):
        run = runs(SCENARIO, law__ki_z=gain)
        speed, x = run.measurements.reference_velocity[:, 0], 1e6 * run.reference[:, 0]
        # The sample moves away from the tip where it is high.
        height, error = -1e9 * run.position[:, 2], 1e9 * (run.deflection - run.reference[:, 2])
        height -= np.percentile(height, 20.0)
        for moving, look, label in ((speed < 0.0, style.SECOND, "retrace"), (speed > 0.0, style.MOTION, "trace")):
            shown = scored(run) & moving
            for ax, values in zip(axes[:, column], (height, error), strict=True):
                if shown.any():
                    ax.plot(*envelope(x[shown], values[shown], 600), label=label, rasterized=True, **look, alpha=0.7)
        axes[0, column].set_title(f"{name}: $k_i$ = {gain:.2g} V/(m s)", loc="left")
        axes[1, column].set_xlabel("x [µm]")
    axes[0, 0].set_ylabel("height [nm]")
    axes[1, 0].set(ylabel="deflection error [nm]", ylim=(-115, 115))
    axes[0, 0].legend(loc="upper left", ncols=2, columnspacing=1.0, handlelength=1.5)
    axes[0, 0].set_ylim(-75, 165)
    return figure
