"""Running sums behind the scorecard, kept by the tick kernel."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import signals
from ..jit import kernel
from ..parameters import InstrumentParameters
from ..plant import state

TICKS, STEPS, STUCK_STEPS, PHASES, WAS_STUCK, LOST_STEPS = range(6)
SQUARE, LARGEST, VARIATION, EXTENT = 6, 9, 12, 15
"""First of three (x, y, z): sum of squared errors, largest error, total variation of the drive, largest position."""
F_LOW, F_HIGH, N_LOW, N_HIGH = 18, 19, 20, 21
SIZE = 22


@kernel
def tally_tick(
    t: NDArray[np.float64],
    s: NDArray[np.float64],
    y: NDArray[np.float64],
    q: Any,
    du_x: float,
    du_y: float,
    du_z: float,
) -> None:
    """Count control tick k: true tracking errors [m] at its measurement, change of the drive [V]."""
    for axis in range(3):
        if axis == 0:
            position, du = s[state.X] * q.x0, du_x
        elif axis == 1:
            position, du = s[state.Y] * q.x0, du_y
        else:
            position, du = s[state.Q] * q.z0, du_z
        e = position - y[signals.REFERENCE_POSITION + axis]
        t[SQUARE + axis] += e * e
        t[LARGEST + axis] = max(t[LARGEST + axis], abs(e))
        t[EXTENT + axis] = max(t[EXTENT + axis], abs(position))
        # The first scored drive starts the variation.
        if t[TICKS] > 0.0:
            t[VARIATION + axis] += abs(du)
    t[TICKS] += 1.0


@kernel
def tally_step(t: NDArray[np.float64], s: NDArray[np.float64]) -> None:
    """Count one integration step: stick, contact, ranges of friction and of the normal force."""
    stuck = s[state.V_X] == 0.0 and s[state.V_Y] == 0.0 and s[state.CONTACT] != 0.0
    if stuck:
        t[STUCK_STEPS] += 1.0
        if t[WAS_STUCK] == 0.0:
            t[PHASES] += 1.0
    t[WAS_STUCK] = 1.0 if stuck else 0.0
    if s[state.CONTACT] == 0.0:
        t[LOST_STEPS] += 1.0
    if t[STEPS] == 0.0:
        t[F_LOW] = t[F_HIGH] = s[state.F_MAX]
        t[N_LOW] = t[N_HIGH] = s[state.N]
    t[F_LOW] = min(t[F_LOW], s[state.F_MAX])
    t[F_HIGH] = max(t[F_HIGH], s[state.F_MAX])
    t[N_LOW] = min(t[N_LOW], s[state.N])
    t[N_HIGH] = max(t[N_HIGH], s[state.N])
    t[STEPS] += 1.0


@dataclass(frozen=True)
class ScoreSummary:
    """The scored part of a run, SI units. Arrays of three are x, y, z."""

    ticks: int
    rms: NDArray[np.float64]  # [m]
    largest: NDArray[np.float64]  # [m]
    percent: NDArray[np.float64]  # largest as a percentage of the reference's amplitude, z: of the sample's
    variation: NDArray[np.float64]  # [V/s]
    extent: NDArray[np.float64]  # largest |position| of x, y and of the tip height [m]
    stick_phases: int
    stick_fraction: float
    contact_fraction: float
    friction: tuple[float, float]  # range of the friction bound [N]
    normal_force: tuple[float, float]  # [N]


def summarize(t: NDArray[np.float64], parameters: InstrumentParameters) -> ScoreSummary:
    """Score of a run from its running sums; NaN where nothing was scored or there is nothing to compare with."""
    scales, reference = parameters.scales, parameters.reference
    normal = parameters.cantilever.m_c * scales.w0**2 * scales.z0
    lateral = parameters.scanner.mu * parameters.cantilever.m_c * scales.w0**2 * scales.x0
    amplitude = np.abs([reference.amplitude_x, reference.amplitude_y, parameters.sample.beta])
    ticks, steps = t[TICKS], t[STEPS]
    with np.errstate(divide="ignore", invalid="ignore"):
        # What nothing was counted for is not zero but not known.
        if not ticks:
            t = np.full(SIZE, np.nan)
            t[PHASES] = 0.0
        largest = t[LARGEST : LARGEST + 3]
        return ScoreSummary(
            ticks=int(ticks),
            rms=np.sqrt(t[SQUARE : SQUARE + 3] / ticks),
            largest=largest.copy(),
            percent=np.where(amplitude > 0.0, 100.0 * largest / amplitude, np.nan),
            variation=t[VARIATION : VARIATION + 3] / (ticks * parameters.plant.control_period),
            extent=t[EXTENT : EXTENT + 3].copy(),
            stick_phases=int(t[PHASES]),
            stick_fraction=float(t[STUCK_STEPS] / steps),
            contact_fraction=float(1.0 - t[LOST_STEPS] / steps),
            friction=(float(t[F_LOW] * lateral), float(t[F_HIGH] * lateral)),
            normal_force=(float(t[N_LOW] * normal), float(t[N_HIGH] * normal)),
        )
