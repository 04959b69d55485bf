"""The guard: while the model does not explain what is measured, the drive is that of the free scanner.

That drive needs no model of friction and feeds nothing back: friction only brakes what it moves, at any delay. It is
docs/predictive.md, (8.7), (8.8).
"""

import math

from afm_model.parts import Measurement, exp, hypot, kernel, square

from .constants import FOLLOWED, KNOWN, MEAN, NODES, UNEXPLAINED, VALUE, Constants
from .map import begin_map
from .nominal_plant import steps
from .sample_estimate import REST
from .state import State
from .unexplained import GAIN_LIMITS, NOTHING, SEEMS, believe

_FAR = 0.5
"""Innovation, or error that grows while the tip slips, over what standing still would cost."""
_FAR_IN_PACKETS = 0.25
"""The same where what follows is a step a control period: that costs little."""
_TIMES = 2.0
"""Fallbacks after which no map is read any more."""
_RETURN = 15.0
"""Time constant with which trust returns [1/w0]."""
_LATER = 3.0
"""After each further fallback trust returns so many times later, with positions alone."""
_FORGIVES = 1e5
"""Time constant with which that is forgotten [1/w0]."""
_BELOW = 0.75
"""Ratio of friction after a fallback over that before, of positions alone: it is sought from below again."""
_RATIO_LIMITS = (0.1, 3.0)
"""Of it then."""
_SLOWER = 3.0
"""Largest speed of the reference so far, over that of its last two stretches, from which on it is another one."""
_WHOLE = 2e-2
"""Distrust that counts as none."""


@kernel
def forget(p: Constants, s: State) -> None:
    """What was learned with a model that is wrong is of no use: map, slopes, what was unexplained."""
    if s.fallbacks > _TIMES:
        # A line longer than the ring tells nothing any more.
        s.least, s.most = -float(NODES), float(NODES)
    begin_map(p, s)
    s.knows_y = s.contradicted = s.counts = 0.0
    for axis in range(3):
        for i in range(UNEXPLAINED):
            s.learned[axis, i] = NOTHING[i]
            for j in range(UNEXPLAINED):
                s.unsure[axis, i, j] = square(p.first[axis, i]) if i == j else 0.0
        believe(axis, NOTHING, s)


@kernel
def see_turn(p: Constants, s: State) -> None:
    """Take the reference for a new one if it runs between two turns far slower than it ever did: a scan after a move.

    What counts as rest or as far off is measured by it, and what was learned of a fast motion does not hold for a slow
    one.
    """
    v_x, v_y = s.v[0], s.v[1]
    s.fastest_since = max(s.fastest_since, hypot(v_x, v_y))
    begins = s.turned[1, 0] == 0.0 and s.turned[1, 1] == 0.0
    if not begins and v_x * s.turned[1, 0] + v_y * s.turned[1, 1] >= 0.0:
        return
    fastest = max(s.fastest_since, s.fastest_before)
    if s.fastest_before > 0.0 and s.fastest > _SLOWER * fastest:
        x, y = s.turned[0, 0], s.turned[0, 1]
        s.fastest, s.reach = fastest, 0.5 * hypot(s.p[0] - x, s.p[1] - y)
        s.from_x, s.from_y = 0.5 * (s.p[0] + x), 0.5 * (s.p[1] + y)
        forget(p, s)
        s.least = s.most = s.pitch = s.way = 0.0
    s.turned[0, 0], s.turned[0, 1], s.turned[1, 0], s.turned[1, 1] = s.p[0], s.p[1], v_x, v_y
    s.fastest_before, s.fastest_since = s.fastest_since, 0.0


@kernel
def watch(k: int, y: Measurement, p: Constants, s: State) -> None:
    """Distrust the model if measurement k contradicts it, and trust it again by and by once it does not."""
    if s.started == 0.0:
        s.from_x, s.from_y = s.X, s.Y
    see_turn(p, s)
    s.reach = max(s.reach, hypot(s.p[0] - s.from_x, s.p[1] - s.from_y))
    way = s.fastest * p.hold
    missed = 0.0
    if s.started != 0.0 and k - s.last == 1:
        missed = hypot(y.position[0] / p.x0 - s.expected[0, 0], y.position[1] / p.x0 - s.expected[1, 0])
    e_x, e_y = s.X - s.p[0], s.Y - s.p[1]
    speed = hypot(s.V_X, s.V_Y)
    slips = speed > REST * s.fastest
    leaves = e_x * s.V_X + e_y * s.V_Y > 0.0
    noise = SEEMS * p.position_noise if p.measured != 0 else 0.0
    far = (_FAR_IN_PACKETS if p.in_steps != 0 else _FAR) * s.reach + 3.0 * way + noise
    if min(s.gain_of[0], s.gain_of[1]) <= GAIN_LIMITS[0] or max(s.gain_of[0], s.gain_of[1]) >= GAIN_LIMITS[1]:
        # An estimate at its limit is not believed as much.
        far *= 0.5
    off = hypot(e_x, e_y)
    # Positions alone do not tell how fast a tip is that runs far from the reference: it is not handed over.
    moved = p.measured == 0 or hypot(s.X - s.at_x, s.Y - s.at_y) > REST * way + noise
    runs = p.measured != 0 and s.distrust == 1.0 and off > far and moved
    s.patience *= exp(-p.hold / _FORGIVES)
    if runs or (slips and ((missed > far and moved) or (leaves and off > far))):
        if s.distrust < 0.5:
            s.fallbacks += 1.0
            s.patience = max(1.0, _LATER * s.patience) if p.measured != 0 or p.in_steps != 0 else 1.0
            forget(p, s)
            s.ratio[VALUE] = s.ratio[MEAN] = min(s.ratio[VALUE], s.ratio[MEAN])
            if p.measured != 0:
                s.ratio[VALUE] = s.ratio[MEAN] = min(max(_BELOW * s.ratio[VALUE], _RATIO_LIMITS[0]), _RATIO_LIMITS[1])
            s.reserve_end = -1
        s.distrust, s.calm_ticks = 1.0, 0.0
    elif s.distrust > 0.0:
        s.calm_ticks += 1.0
        # What was sent before has to have come into force.
        if s.calm_ticks > (2.0 + p.delay / p.slots) * max(1.0, s.patience):
            s.distrust *= exp(-p.hold / _RETURN)
            s.distrust = s.distrust if s.distrust > _WHOLE else 0.0


@kernel
def fall_back(at: int, slot: int, p: Constants, s: State) -> None:
    """Mix into the drive of x and y in the plan, as far as the model is not trusted, that of the free scanner."""
    if s.distrust == 0.0 or steps(p, s):
        return
    end, middle = at + p.fine, at + p.fine // 2
    for axis in range(2):
        rise = (s.path[end, axis, 1] - s.path[at, axis, 1]) / (p.fine * p.tau)
        free = rise + p.damping[axis] * s.path[middle, axis, 1] + p.stiffness[axis] * s.path[middle, axis, 0]
        s.plan[slot, axis] += s.distrust * (free - s.plan[slot, axis])


@kernel
def finite(count: int, s: State) -> bool:
    """Whether the first drives of the plan, so many slots of them, are numbers."""
    total = 0.0
    for i in range(count):
        for axis in range(3):
            total += abs(s.plan[i, axis])
    return math.isfinite(total)


@kernel
def begin_anew(p: Constants, s: State) -> None:
    """At the first measurement, and at the next one after an answer that was no number: nothing is known.

    A bound of friction that is to be found is approached from below.
    """
    forget(p, s)
    s.unknown, s.contradicts = int(p.surface != KNOWN), 0.0
    s.calm_ticks, s.slips, s.patience, s.reserve_end = 0.0, 0.0, 0.0, -1
    for i in range(FOLLOWED):
        s.ratio[i] = p.least_bound if i == VALUE or i == MEAN else 0.0
    for i in range(NODES):
        s.map_H[i] = s.map_ratio[i] = 0.0
    s.signal = s.way = s.pitch = 0.0
    for axis in range(2):
        s.sum_pa[axis] = s.sum_pp[axis] = 0.0
