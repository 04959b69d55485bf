"""Positions alone: how much larger the gain of friction is along y than along x, docs/predictive.md (8.9).

A scanner whose gain along y is wrong slides in another direction than the copy, by the same angle all the time. So what
positions are off tells that gain. It is the one constant bias of the Kalman filter of observer.py, and is estimated
beside it: B. Friedland, *Treatment of bias in recursive filtering*, IEEE Trans. Autom. Control 14 (1969) 359,
doi:10.1109/TAC.1969.1099223. The filter itself stays as it is.
"""

import math

from afm_model.parts import kernel, square

from .constants import AT_X, AT_Y, LEARNED, RATIO, SLOPE, SPEED, Constants
from .map import raise_map
from .state import State

_FIRST = 0.05
"""Its standard deviation at the start, and never more."""
_WALK = 2e-5
"""Its random walk in one time unit."""
_CERTAIN = 5.0
"""Standard deviations from which on it is believed."""
_SURE = 3.0
"""Standard deviations of a position beyond which it is another disturbance."""


@kernel
def forget_gain_of_y(s: State) -> None:
    """Nothing is known of it but that it is near that of x."""
    s.more_gain = s.more_found = 0.0
    s.variance_of_more = square(_FIRST)
    s.moved_by_more[:] = 0.0


@kernel
def learn_gain_of_y(innovation: float, variance: float, told: float, learns: bool, s: State) -> None:
    """Learn from the innovation of a measurement of the filter, which has the row `s.weights` and `s.gains`.

    Parameters
    ----------
    innovation, variance : float
    told : float
        What the measurement tells of the gain besides the states.
    learns : bool
        Otherwise only what the correction of the states does to them counts.
    """
    row = told
    for i in range(5):
        row += s.weights[i] * s.moved_by_more[i]
    if learns:
        total = variance + row * row * s.variance_of_more
        most = _SURE * math.sqrt(total)
        off = min(max(innovation - row * s.more_found, -most), most)
        s.more_found += s.variance_of_more * row / total * off
        s.variance_of_more -= square(s.variance_of_more * row) / total
    for i in range(5):
        s.moved_by_more[i] -= s.gains[i] / variance * row


@kernel
def carry_gain_of_y(way: float, t_x: float, t_y: float, bound: float, p: Constants, s: State) -> None:
    """Carry what the gain does to the states through a period, in which the tip goes so far along t.

    Friction on the way has this bound; the transition of the states is in `s.carried`. More gain along y is a force
    against the motion, the part t_y^2 of friction along it and t_x t_y across; across, friction turns the motion until
    nothing is left.
    """
    F, moved = s.carried, s.moved_by_more
    for i in range(5):
        s.gains[i] = 0.0
        for k in range(5):
            s.gains[i] += F[i, k] * moved[k]
    along, across = -bound * t_y * t_y, -way * t_x * t_y
    moved[AT_X] = s.gains[AT_X] + p.of_drive[0] * along * t_x - across * t_y
    moved[AT_Y] = s.gains[AT_Y] + p.of_drive[0] * along * t_y + across * t_x
    moved[SPEED] = s.gains[SPEED] + p.of_drive[1] * along
    moved[RATIO], moved[SLOPE] = s.gains[RATIO], s.gains[SLOPE]


@kernel
def believe_gain_of_y(p: Constants, s: State) -> None:
    """Believe in what was found once it is certain; the corrections of the states follow."""
    s.variance_of_more = min(s.variance_of_more + square(_WALK) * p.hold, square(_FIRST))
    if s.more_gain == 0.0 and square(s.more_found) < square(_CERTAIN) * s.variance_of_more:
        return
    s.more_gain += s.more_found
    for i in range(5):
        s.change[i] += s.moved_by_more[i] * s.more_found
    if p.surface == LEARNED:
        # The ratios of the map were seen with the gain that was believed before.
        raise_map(s.moved_by_more[RATIO] * s.more_found, s)
    s.more_found = 0.0
