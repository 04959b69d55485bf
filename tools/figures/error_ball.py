"""The error ball of the tanh law (section 3 of the paper): norm of the error and Lyapunov function against time."""

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.linalg import block_diag

from afm_model import ControllerParameters
from afm_model.law import TANH_GAP, lyapunov_matrix, ultimate_bound
from afm_model.run.plotting import envelope

from . import style
from .runs import Runs, errors, units

SCENARIO = "error_ball"
STEEPNESSES = ((10.0, style.SECOND | {"color": "#d55e00"}), (100.0, style.MOTION))


@dataclass(frozen=True)
class Ball:
    """What section 3 guarantees, corrected, nondimensional."""

    P: NDArray[np.float64]  # (6, 6)
    decrease: float  # outside this radius V decreases
    ultimate: float  # ||e|| ends within this
    level: float  # V ends below this
    printed: float  # the radius as the paper prints it


def ball(controller: ControllerParameters, alpha: float) -> Ball:
    """The bounds for Q = I; one steepness for all axes."""
    law = controller.law
    P = [lyapunov_matrix(getattr(law, f"c_{axis}"), getattr(law, f"cdot_{axis}")) for axis in "xyz"]
    M = [law.M_x, law.M_y, law.M_z]
    # P is block diagonal and each axis has its own V: their ultimate bounds add up in squares.
    bounds = [ultimate_bound(p, alpha, m) for p, m in zip(P, M, strict=True)]
    levels = [2.0 * TANH_GAP * m / alpha * np.linalg.eigvalsh(p)[-1] for p, m in zip(P, M, strict=True)]
    return Ball(
        P=block_diag(*P),
        decrease=float(np.sqrt(2.0 * TANH_GAP * sum(M) / alpha)),
        ultimate=float(np.linalg.norm(bounds)),
        level=float(sum(levels)),
        printed=2.0 * max(M),
    )


def lyapunov(e: NDArray[np.float64], P: NDArray[np.float64]) -> NDArray[np.float64]:
    """V = e'Pe, (n,)."""
    return np.asarray(np.einsum("ni,ij,nj->n", e, P, e))


def draw(runs: Runs) -> Figure:
    """Both against time, for a flat and for a steep tanh, with the corrected bounds."""
    figure, (top, bottom) = plt.subplots(2, 1, figsize=(style.WIDTH, 5.6), layout="constrained", sharex=True)
    controller = runs.scenario(SCENARIO).controller
    for alpha, line in STEEPNESSES:
        run = runs(SCENARIO, law__alpha=alpha, law__alpha_z=alpha)
        bound = ball(controller, alpha)
        e = errors(run)
        t = 1e3 * run.time
        norm, V = np.linalg.norm(e, axis=1), lyapunov(e, bound.P)
        top.plot(*envelope(t, norm), label=rf"$\|e\|$, $\alpha$ = {alpha:g}", **line)
        bottom.plot(*envelope(t, V), label=rf"$V$, $\alpha$ = {alpha:g}", **line)
        color = line["color"]
        top.axhline(bound.ultimate, color=color, lw=1.0, ls="--", label=f"ultimate bound {bound.ultimate:.2f}")
        top.axhline(bound.decrease, color=color, lw=1.0, ls=":", label=rf"$\dot V < 0$ outside {bound.decrease:.2f}")
        bottom.axhline(bound.level, color=color, lw=1.0, ls="--", label=f"its bound {bound.level:.2f}")
    top.axhline(bound.printed, label=rf"as printed, any $\alpha$: {bound.printed:g}", color="0.5", lw=1.2, ls="-.")
    for ax, label in ((top, r"$\|e\|$ [1]"), (bottom, "$V = e^T P e$ [1]")):
        ax.set_yscale("log")
        ax.set_ylabel(label)
        ax.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    bottom.set_xlabel("time [ms]")
    style.opposite(top, x=(r"$\tau$ [$1/\omega_0$]", units(run.parameters).time))
    return figure
