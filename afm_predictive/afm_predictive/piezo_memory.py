"""Hysteresis and creep of the piezo, as the law learns them from its own drives, docs/predictive.md (8.6).

What a drive u does depends on the drives before it: w = u - sum_i o_i D_i - k C. The stops D_i follow u as far as their
thresholds r_i let them, and C is what creep has still to bring, the sum of lags of its time constants t_j,

    D_i = max(-r_i, min(r_i, D_i + change of u)),    C = sum_j C_j,    C_j' = u' - C_j / t_j.

The openings o_i and the creep k are estimated in unexplained.py. The stops are the operator of Prandtl and Ishlinskii;
M. Brokate, J. Sprekels, *Hysteresis and Phase Transitions*, Springer (1996), chapter 2. The lags are creep by the
logarithm of time, from the shortest time constant to the longest. The law plans the effective drive w; what it sends is
u.
"""

from afm_model.parts import Measurement, kernel, routine

from .constants import LAGS, MEMORY, SLOTS, STOPS, Constants
from .nominal_plant import drive_in_force, drive_of_period, move
from .state import State

_TRIALS = 30
_ENOUGH = 1e-12


@kernel
def stop(axis: int, i: int, u: float, p: Constants, s: State) -> float:
    """Stop i under a drive u that follows the last one of the plan."""
    return max(-p.threshold[i], min(p.threshold[i], s.memory_ahead[axis, i] + u - s.drive_ahead[axis]))


@kernel
def to_creep(axis: int, u: float, p: Constants, s: State) -> float:
    """Mean over the slot of what creep has still to bring, under such a drive."""
    left = 0.0
    for j in range(LAGS):
        left += p.lag_mean[j] * (s.lag_ahead[axis, j] + u - s.drive_ahead[axis])
    return left


@kernel
def advance(axis: int, u: float, p: Constants, s: State) -> float:
    """Let stops and lags follow the drive u for a slot; the effective drive."""
    s.memory_ahead[axis, STOPS] = to_creep(axis, u, p, s)
    w = u - s.takes[axis, STOPS] * s.memory_ahead[axis, STOPS]
    for i in range(STOPS):
        s.memory_ahead[axis, i] = stop(axis, i, u, p, s)
        w -= s.takes[axis, i] * s.memory_ahead[axis, i]
    for j in range(LAGS):
        s.lag_ahead[axis, j] = p.lag_left[j] * (s.lag_ahead[axis, j] + u - s.drive_ahead[axis])
    s.drive_ahead[axis] = u
    return w


@kernel
def drive_for(axis: int, w: float, p: Constants, s: State) -> float:
    """The drive with this effect, by Newton's method: the effect has few straight pieces."""
    before = s.drive_ahead[axis]
    at_rest = to_creep(axis, before, p, s)
    crept = s.takes[axis, STOPS] * at_rest
    creep = s.takes[axis, STOPS] * (to_creep(axis, before + 1.0, p, s) - at_rest)
    u = before
    for _ in range(_TRIALS):
        left, slope = w - u + crept + creep * (u - before), 1.0 - creep
        for i in range(STOPS):
            D = stop(axis, i, u, p, s)
            left += s.takes[axis, i] * D
            if abs(D) < p.threshold[i]:
                slope -= s.takes[axis, i]
        u += left / slope
        if abs(left) < _ENOUGH * (1.0 + abs(w)):
            break
    return u


@routine
def pass_drives(k: int, y: Measurement, moves: bool, p: Constants, s: State) -> None:
    """Let stops and lags follow the drives in force until measurement k, and the copy of the plant if it moves.

    What they are there goes to `s.memory_now`, their means to `s.memory_mean`.
    """
    periods = min(max(k - s.last, 1), SLOTS) if s.started != 0.0 else 0
    for axis in range(2):
        if s.started == 0.0:
            s.drive_now[axis] = drive_in_force(axis, y, p, s)
            for i in range(MEMORY):
                s.memory_now[axis, i] = 0.0
            for j in range(LAGS):
                s.lag_now[axis, j] = 0.0
        s.drive_ahead[axis] = s.drive_now[axis]
        for i in range(MEMORY):
            s.memory_ahead[axis, i], s.memory_mean[axis, i] = s.memory_now[axis, i], 0.0
        for j in range(LAGS):
            s.lag_ahead[axis, j] = s.lag_now[axis, j]
    for ahead in range(periods):
        for j in range(p.slots):
            for axis in range(3):
                s.drive_passed[axis] = drive_of_period(s.last + ahead, j, axis, y, p, s)
                if p.slots == 1 and ahead == periods - 1:
                    # Whatever the delay is: the drive that was in force.
                    s.drive_passed[axis] = drive_in_force(axis, y, p, s)
            w_x, w_y = advance(0, s.drive_passed[0], p, s), advance(1, s.drive_passed[1], p, s)
            if moves:
                move(w_x, w_y, s.drive_passed[2], p.dt_copy, p.steps_copy, p, s)
            for axis in range(2):
                for i in range(MEMORY):
                    s.memory_mean[axis, i] += s.memory_ahead[axis, i] / (p.slots * periods)
    for axis in range(2):
        s.drive_now[axis] = s.drive_ahead[axis]
        for i in range(STOPS):
            s.memory_now[axis, i] = s.memory_ahead[axis, i]
        s.memory_now[axis, STOPS] = 0.0
        for j in range(LAGS):
            s.lag_now[axis, j] = s.lag_ahead[axis, j]
            s.memory_now[axis, STOPS] += s.lag_now[axis, j]


@kernel
def effective(axis: int, y: Measurement, p: Constants, s: State) -> float:
    """What the drive in force at a measurement does."""
    u = drive_in_force(axis, y, p, s)
    for i in range(MEMORY):
        u -= s.takes[axis, i] * s.memory_now[axis, i]
    return u


@kernel
def remembers(axis: int, s: State) -> bool:
    """Whether there is any hysteresis or creep to reckon with."""
    total = 0.0
    for i in range(MEMORY):
        total += s.takes[axis, i]
    return total > 0.0


@kernel
def plan_effective(p: Constants, s: State) -> None:
    """Replace the drives on their way in the plan by what they do; they are kept in `s.sent_ahead`."""
    for axis in range(2):
        if not remembers(axis, s):
            continue
        for j in range(p.delay):
            s.sent_ahead[j, axis] = s.plan[j, axis]
            s.plan[j, axis] = advance(axis, s.sent_ahead[j, axis], p, s)


@kernel
def plan_drives(planned: int, p: Constants, s: State) -> None:
    """Replace what the drives of the plan are to do by the drives."""
    for axis in range(2):
        if not remembers(axis, s):
            continue
        for j in range(p.delay):
            s.plan[j, axis] = s.sent_ahead[j, axis]
        for j in range(p.delay, planned):
            s.plan[j, axis] = drive_for(axis, s.plan[j, axis], p, s)
            advance(axis, s.plan[j, axis], p, s)
