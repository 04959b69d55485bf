"""Figure 5 of the paper: closed loop; (I) positions and velocities, (II) friction and control forces."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from afm_model.run.plotting import envelope

from . import style
from .runs import Runs, control_force, friction, units

SCENARIO = "paper_4_2_sgn"
CLOSE_UP, TURN, WIDTH = 14.0, 31.4, 0.004
"""Parts shown tick by tick [ms]: on the way, at the turning point of the reference, and for how long."""
_BLACK = style.REFERENCE | {"color": "black"}


def draw_motion(runs: Runs) -> Figure:
    """(I): x, y with their references, their velocities, z_c with its setpoint and its rate; both close up."""
    run = runs(SCENARIO)
    unit = units(run.parameters)
    t = 1e3 * run.time
    figure, axes = plt.subplots(4, 2, figsize=(style.WIDTH, 8.2), layout="constrained")
    for i, axis in enumerate("xy"):
        left, right = axes[i]
        left.plot(*envelope(t, 1e9 * run.position[:, i], 300), label=f"${axis}$", **style.MOTION)
        left.plot(*envelope(t, 1e9 * run.reference[:, i], 300), label=f"${axis}_r$", **style.THIRD)
        left.set_ylabel(f"${axis}$ [nm]")
        style.opposite(left, y=(f"${'XY'[i]}$ [$x_0$]", unit.length))
        rate = 1e6 * run.measurements.reference_velocity[:, i]
        speed = 1e6 * run.velocity[:, i]
        right.plot(*envelope(t, speed), label=f"$\\dot {axis}$", rasterized=True, **style.DENSE)
        right.plot(*envelope(t, rate, 300), label=f"$\\dot {axis}_r$", **_BLACK)
        right.set_ylabel(f"$\\dot {axis}$ [µm/s]")
        style.opposite(right, y=(f"$\\dot {'XY'[i]}$ [$x_0\\omega_0$]", unit.speed))
    height = 1e12 * (run.deflection + run.parameters.cantilever.a)
    rise = 1e9 * run.measurements.deflection_rate
    setpoint = 1e12 * run.reference[:, 2]
    left, right = axes[2]
    left.plot(*envelope(t, height), label="$z_c$", rasterized=True, **style.DENSE)
    left.plot(*envelope(t, setpoint, 300), label="$z_r$", **_BLACK)
    right.plot(*envelope(t, rise), label=r"$\dot z_c$", rasterized=True, **style.DENSE)
    left, right = axes[3]
    near = _close_up(left, t, height, CLOSE_UP, label="$z_c$")
    left.plot(1e3 * (t[near] - CLOSE_UP), setpoint[near], label="$z_r$", **_BLACK)
    _close_up(right, t, rise, CLOSE_UP, label=r"$\dot z_c$")
    for left, right in axes[2:]:
        left.set_ylabel("$z_c$ [pm]")
        style.opposite(left, y=("$Q$ [$10^{-6} z_0$]", 1e-3 * unit.height))
        right.set_ylabel(r"$\dot z_c$ [nm/s]")
        style.opposite(right, y=(r"$\dot Q$ [$10^{-6} z_0\omega_0$]", 1e-3 * unit.rise))
    names = "$x$", "velocity along $x$", "$y$", "velocity along $y$", "tip height", "its rate"
    for ax, letter, name in zip(axes.flat, "abcdef", names, strict=False):
        ax.set_title(f"({letter}) {name}", loc="left")
    for ax, letter in zip(axes[3], "ef", strict=True):
        ax.set_title(f"({letter}) from {CLOSE_UP:g} ms", loc="left")
        ax.margins(y=0.3)
    for ax in axes.flat:
        ax.legend(loc="upper center" if ax in axes[:2, 1] else "upper right", ncols=2)
    axes[2, 0].margins(y=0.2)
    axes[2, 1].margins(y=0.35)
    _time(axes[:3], unit.time)
    return figure


def draw_forces(runs: Runs) -> Figure:
    """(II): friction and control force along x and along y; both close up."""
    run = runs(SCENARIO)
    unit = units(run.parameters)
    t, f, u = 1e3 * run.time, friction(run), control_force(run)
    figure, axes = plt.subplots(3, 2, figsize=(style.WIDTH, 6.6), layout="constrained", sharey="row")
    for i, axis in enumerate("xy"):
        axes[0, i].plot(*envelope(t, f[:, i], 800), rasterized=True, **style.DENSE | {"color": style.SECOND["color"]})
        axes[1, i].plot(*envelope(t, u[:, i]), rasterized=True, **style.DENSE)
        axes[0, i].set_title(f"({'ab'[i]}) friction along ${axis}$", loc="left")
        axes[1, i].set_title(f"({'cd'[i]}) control force along ${axis}$", loc="left")
    # The mean of the drive over 0.1 ms shows what the switching balances.
    n = max(1, round(0.1e-3 / run.parameters.plant.control_period))
    for i in range(2):
        mean = np.convolve(u[:, i], np.ones(n) / n, "valid")
        middle = t[: len(mean)] + 0.5 * (t[n - 1] - t[0])
        axes[1, i].plot(*envelope(middle, mean, 600), label="mean over 0.1 ms", **style.MOTION)
        axes[1, i].set_ylim(-330.0, 430.0)
        axes[1, i].legend(loc="upper right")
    _close_up(axes[2, 0], t, f[:, 0], TURN)
    axes[2, 0].set_title(f"(a) from {TURN:g} ms, while $x_r$ turns", loc="left")
    _close_up(axes[2, 1], t, u[:, 0], CLOSE_UP)
    axes[2, 1].set_title(f"(c) from {CLOSE_UP:g} ms", loc="left")
    for left, right in axes:
        left.set_ylabel("force [nN]")
        style.opposite(right, y=(r"force [$m_p\omega_0^2 x_0$]", unit.force))
    _time(axes[:2], unit.time)
    return figure


def _close_up(ax: Axes, t: NDArray[np.float64], y: NDArray[np.float64], start: float, **line: str) -> NDArray[np.bool_]:
    """Draw the ticks of a short part [ms] and tell which they are; the first ticks of a run that is shorter."""
    start = start if t[-1] > start + WIDTH else 0.0
    near = (t >= start - 1e-9) & (t <= start + WIDTH)
    ax.step(1e3 * (t[near] - start), y[near], where="post", **line, **style.MOTION | {"color": style.SECOND["color"]})
    ax.set(xlabel="time [µs]", xlim=(0.0, 1e3 * WIDTH))
    return near


def _time(axes: NDArray[np.object_], unit: float) -> None:
    """Time axes of rows that show the whole run."""
    for ax in axes[:-1].flat:
        ax.tick_params(labelbottom=False)
    for ax in axes[-1]:
        ax.set_xlabel("time [ms]")
    for ax in axes[0]:
        style.opposite(ax, x=(r"$\tau$ [$1/\omega_0$]", unit))
