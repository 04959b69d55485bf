"""A scanner so stiff that friction does not move it: position, rate and load along x and y from positions alone.

A Kalman filter an axis, docs/predictive.md (8.13): the scanner under the drives that were in force, and a load b,

    q'' = U - eta^2 q - 2 xi eta q' - b + white noise,    b'' = white noise.

Hysteresis, creep and a sensitivity that is told wrong are such a load.
"""

import math

from afm_model.parts import Measurement, kernel, routine, square

from .constants import ANSWERS, Constants
from .kalman import carry_covariance
from .piezo_memory import pass_drives
from .state import State

_CHANGES = 0.1
"""Change of the load over that of the drive for the travel: by hysteresis."""
_WHILE = 100.0
"""Time in which the rate of the load may become another one by so much [1/w0]."""
_ACCELERATES = 0.5
"""Acceleration by a resonance that is told wrong, over the change of the drive for the travel."""
_FASTEST = 1.3
"""Largest bandwidth for the load: over the resonance, and times the time until a drive takes effect. Faster, the loop
does not bear a sensitivity or a resonance that is some ten percent wrong."""


@kernel
def load_rate(axis: int, p: Constants, s: State) -> float:
    """Rate of the load that is likely."""
    return _CHANGES * p.stiffness[axis] * max(s.fastest, p.position_noise / _WHILE)


@kernel
def begin_load(axis: int, p: Constants, s: State) -> None:
    """At the first measurement, and as long as the model is not trusted: the load is not known."""
    rate = load_rate(axis, p, s)
    P = s.of_held[axis]
    P[:] = 0.0
    P[0, 0], P[1, 1] = square(p.position_noise), square(s.fastest)
    P[2, 2], P[3, 3] = square(_WHILE * rate), square(rate)
    s.slow[axis] = s.held[axis] = s.held_rate[axis] = 0.0


@kernel
def carry_load(axis: int, periods: int, p: Constants, s: State) -> None:
    """Carry load and covariance through so many control periods."""
    F, P = s.carried, s.of_held[axis]
    F[:] = 0.0
    for i in range(2):
        F[i, 0], F[i, 1] = p.Phi_hold[axis, i, 0], p.Phi_hold[axis, i, 1]
        F[i, 2], F[i, 3] = -p.Gamma_hold[axis, i], -0.5 * p.hold * p.Gamma_hold[axis, i]
    F[2, 2], F[2, 3], F[3, 3] = 1.0, p.hold, 1.0
    for _ in range(periods):
        carry_covariance(P, F, s.half)
        P[1, 1] += square(_ACCELERATES * p.stiffness[axis] * s.fastest) * p.hold
        P[3, 3] += square(load_rate(axis, p, s)) * p.hold / _WHILE
    s.held[axis] += periods * p.hold * s.held_rate[axis]


@kernel
def correct_axis(axis: int, off: float, p: Constants, s: State) -> tuple[float, float]:
    """Correct the load of an axis by its measured position, off by so much from the copy.

    What has to be added to position and rate of the copy is returned.
    """
    P = s.of_held[axis]
    bandwidth = _FASTEST * min(math.sqrt(p.stiffness[axis]), 1.0 / (s.delay * p.slot + 0.5 * p.hold))
    # With this noise a filter of the load alone has that bandwidth.
    least = load_rate(axis, p, s) / (math.sqrt(_WHILE * p.hold) * square(square(bandwidth)))
    variance = P[0, 0] + square(p.measured * p.position_noise) + square(least)
    for i in range(4):
        s.gains[i] = P[i, 0] / variance
    for i in range(4):
        for j in range(4):
            P[i, j] -= s.gains[i] * s.gains[j] * variance
    s.held[axis] += s.gains[2] * off
    s.held_rate[axis] += s.gains[3] * off
    return s.gains[0] * off, s.gains[1] * off


@routine
def observe_stiff(k: int, x: float, y_: float, y: Measurement, p: Constants, s: State) -> None:
    """Run the copy up to measurement k, and correct it and the load by the positions x, y_."""
    periods = min(max(k - s.last, 1), ANSWERS)
    for axis in range(2):
        # The mean until the measurement; below, until the drive that is answered now is in force.
        s.slow[axis] = s.held[axis] + 0.5 * periods * p.hold * s.held_rate[axis]
    pass_drives(k, y, True, p, s)
    for axis in range(2):
        carry_load(axis, periods, p, s)
    moved, faster = correct_axis(0, x - s.X, p, s)
    s.X, s.V_X = s.X + moved, s.V_X + faster
    moved, faster = correct_axis(1, y_ - s.Y, p, s)
    s.Y, s.V_Y = s.Y + moved, s.V_Y + faster
    for axis in range(2):
        s.slow[axis] = s.held[axis] + 0.5 * s.delay * p.slot * s.held_rate[axis]
