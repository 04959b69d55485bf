"""How far the sample has moved along the line of the reference since its map was begun, docs/predictive.md (8.15).

The sensors of the scanner do not see it. On a slope the height that is measured differs from that of the map by the
slope times this way. A Kalman filter of way and rate finds both.
"""

import math
from typing import TYPE_CHECKING

from afm_model.parts import kernel, square

from .constants import Constants

if TYPE_CHECKING:
    from .state import State

_CHANGES = 3e-6
"""Random walk of the rate in one time unit [x0 w0]."""
_CERTAIN = 5.0
"""Deviations of the way from which on it is believed."""
_LATER = 4e-4
"""Deviation of the rate then, 1 nm/s."""
_SURE = 3.0
"""Deviations of a height beyond which it is another surface."""


@kernel
def forget_drift(p: Constants, s: "State") -> None:
    """Where a map is begun the sample has not moved."""
    s.shift = s.shift_found = s.drift = s.of_drift[0, 0] = s.of_drift[0, 1] = 0.0
    s.of_drift[1, 1] = square(p.first_drift)


@kernel
def carry_drift(p: Constants, s: "State") -> None:
    """Go on by a control period; believe in the way once it is certain."""
    P = s.of_drift
    s.shift_found += p.hold * s.drift
    P[0, 0] += p.hold * (2.0 * P[0, 1] + p.hold * P[1, 1])
    P[0, 1] += p.hold * P[1, 1]
    P[1, 1] = min(P[1, 1] + square(_CHANGES) * p.hold, square(p.first_drift))
    if s.shift != 0.0:
        s.shift = s.shift_found
    elif square(s.shift_found) > square(_CERTAIN) * P[0, 0]:
        # Until now the map has followed the sample: how fast that moves was hardly seen.
        s.shift, P[0, 1], P[1, 1] = s.shift_found, 0.0, square(_LATER)


@kernel
def find_drift(off: float, slope: float, variance: float, s: "State") -> float:
    """Learn from a height that is so far off the map, where that has this slope; by how much the way in use changes."""
    P = s.of_drift
    off -= slope * (s.shift_found - s.shift)
    total = square(slope) * P[0, 0] + variance
    most = _SURE * math.sqrt(total)
    change = slope * min(max(off, -most), most) / total
    way, rate, part = P[0, 0], P[0, 1], square(slope) / total
    s.shift_found += way * change
    s.drift += rate * change
    P[0, 0] -= part * way * way
    P[0, 1] -= part * way * rate
    P[1, 1] -= part * rate * rate
    if s.shift == 0.0:
        return 0.0
    s.shift = s.shift_found
    return way * change
