"""Control force along x under sgn and under tanh: the paper calls the second smoother, without a figure."""

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from afm_model.run.plotting import envelope

from . import style
from .runs import Runs, control_force, units

LAWS = (("paper_4_2_sgn", "sgn"), ("paper_4_2_tanh", "tanh"))
CLOSE_UP = (14.0, 14.005)
"""Part of the run shown step by step [ms]."""


def draw(runs: Runs) -> Figure:
    """Left the whole period, right a close-up; above sgn, below tanh."""
    figure, axes = plt.subplots(
        2, 2, figsize=(style.WIDTH, 4.6), layout="constrained", width_ratios=(3, 2), sharey=True
    )
    for row, (name, law) in zip(axes, LAWS, strict=True):
        run = runs(name)
        unit = units(run.parameters)
        t, u = 1e3 * run.time, control_force(run)[:, 0]
        row[0].plot(*envelope(t, u), rasterized=True, **(style.DENSE if law == "sgn" else style.MOTION))
        start, end = CLOSE_UP if t[-1] > CLOSE_UP[1] else (0.0, float(t[-1]))
        near = (t >= start - 1e-9) & (t <= end)
        row[1].step(1e3 * (t[near] - start), u[near], where="post", **style.MOTION)
        title = law if law == "sgn" else f"tanh, $\\alpha$ = {runs.scenario(name).controller.law.alpha:g}"
        row[0].set_title(title, loc="left")
        row[1].set_title(f"{title}, from {start:g} ms", loc="left")
        row[1].set_xlim(0.0, 1e3 * (end - start))
        row[0].set_ylabel("control force along $x$ [nN]")
        style.opposite(row[1], y=(r"$U_x$ [$\omega_0^2 x_0$]", unit.force))
    axes[1, 0].set_xlabel("time [ms]")
    axes[1, 1].set_xlabel("time [µs]")
    style.opposite(axes[0, 0], x=(r"$\tau$ [$1/\omega_0$]", unit.time))
    style.opposite(axes[0, 1], x=(r"$\tau$ [$1/\omega_0$]", 1e3 * unit.time))
    return figure
