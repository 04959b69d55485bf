"""Plan the drives on their way, slot by slot, and the reserve after those of an answer.

Each answer adds a few drives to the reserve and keeps the others. They bridge a controller, or a machine, that stands
still for longer than an answer can be planned ahead in one go. The scanner is predicted from where the last reserve
ended. No measurement corrects that prediction; it need not be corrected, since the drives are decided on it as on the
real one, and bring it to the reference.
"""

from afm_model.parts import Measurement, PiezoDrive, hypot, kernel, routine

from .asked import ask
from .constants import ANSWERS, SLOTS, Constants
from .decide import decide
from .guard import fall_back
from .nominal_plant import drive_in_force, drives_of, predict
from .state import State

_MADE_UP = 8
"""Control periods without an answer that the next one makes up for in the reserve at most: that takes time as well."""
_STRAYS, _STRAYED = 2.0, 4.0
"""How far the predicted scanner is from the reference where the reserve starts again: over the way of the reference,
and in addition [x0]."""


@kernel
def newest_answered(newest: int, s: State) -> int:
    """The newest measurement up to `newest` whose answer is kept; -1: none is."""
    if newest >= 0 and s.answered[newest % ANSWERS] == newest:
        return newest
    found = -1
    for i in range(ANSWERS):
        if s.answered[i] <= newest:
            found = max(found, s.answered[i])
    return found


@kernel
def recall(k: int, y: Measurement, p: Constants, s: State) -> None:
    """Write into the plan the drives that are in force until the answer to measurement k is.

    An answer is in force from the delay after its measurement on, or from its arrival if that is later; what has not
    arrived yet is taken to be there in the next period. Where none is known the drive that is in force stays.
    """
    s.expects = k
    for j in range(p.delay):
        ahead = j // p.slots
        newest = k - p.delay // p.slots + ahead
        if ahead == 0:
            newest = min(newest, y.newest_drive_sequence)
        answered = newest_answered(newest, s)
        if j == 0:
            s.expects = answered
        if answered < 0:
            for axis in range(3):
                s.plan[j, axis] = drive_in_force(axis, y, p, s)
        else:
            at = min((k - answered) * p.slots + j, s.lengths[answered % ANSWERS] - 1)
            sent = drives_of(answered % ANSWERS, p, s)
            for axis in range(3):
                s.plan[j, axis] = sent[3 * at + axis]


@kernel
def remember(k: int, planned: int, p: Constants, s: State) -> None:
    """Keep the answer to measurement k: so many slots of the plan."""
    s.answered[k % ANSWERS] = k
    s.lengths[k % ANSWERS] = planned
    sent = drives_of(k % ANSWERS, p, s)
    for i in range(planned):
        for axis in range(3):
            sent[3 * i + axis] = s.plan[i, axis]


@kernel
def volts(slot: int, axis: int, p: Constants, s: State) -> float:
    """Of a drive in the plan."""
    return (s.plan[slot, axis] + s.zero_of_drive[axis]) * p.volts[axis]


@kernel
def answer(planned: int, u: PiezoDrive, p: Constants, s: State) -> None:
    """Write so many slots of the plan into the answer: the drive that is first in force or, of more, all with their
    times.
    """
    for axis in range(3):
        u.voltage[axis] = volts(p.delay, axis, p, s)
    u.horizon_count = 0
    if planned > p.delay + 1:
        u.horizon_period = p.slot / p.w0
        u.horizon_count = planned - 1
        for axis in range(3):
            u.voltage[axis] = volts(0, axis, p, s)
            for i in range(u.horizon_count):
                u.horizon[i, axis] = volts(i + 1, axis, p, s)


@kernel
def first_of_reserve(k: int, p: Constants, s: State) -> int:
    """Return the number of the first slot after the drives planned for measurement k."""
    return k * p.slots + p.delay + p.count


@kernel
def take_up(s: State) -> None:
    """Put the predicted scanner where the reserve ends."""
    s.X, s.Y, s.Z = s.reserved[0], s.reserved[1], s.reserved[2]
    s.V_X, s.V_Y, s.V_Z = s.reserved[3], s.reserved[4], s.reserved[5]


@kernel
def put_down(s: State) -> None:
    """Keep where the predicted scanner is."""
    s.reserved[0], s.reserved[1], s.reserved[2] = s.X, s.Y, s.Z
    s.reserved[3], s.reserved[4], s.reserved[5] = s.V_X, s.V_Y, s.V_Z


@routine
def extend(k: int, p: Constants, s: State) -> None:
    """Plan as much of the reserve as has passed since the last answer and a slot more, until it has its length.

    To be called with the scanner predicted to the last slot of the plan.
    """
    first, last = first_of_reserve(k, p, s), p.delay + p.count - 1
    if first <= s.reserve_end <= first + p.reserve:
        take_up(s)
    else:
        predict(s.plan[last, 0], s.plan[last, 1], s.plan[last, 2], p, s)
        s.reserve_end = first
    answered = newest_answered(k - 1, s)
    passed = min(k - answered, _MADE_UP) if answered >= 0 else 1
    left = min(passed * p.slots + 1, first + p.reserve - s.reserve_end)
    while left > 0:
        more = min(left, p.slots + 1)
        ask((s.reserve_end - k * p.slots) * p.slot, p.horizon + (more - 1) * p.fine, p, s)
        for i in range(more):
            decide(i * p.fine, last + 1, p, s)
            fall_back(i * p.fine, last + 1, p, s)
            for axis in range(3):
                s.kept[s.reserve_end % SLOTS, axis] = s.plan[last + 1, axis]
            predict(s.plan[last + 1, 0], s.plan[last + 1, 1], s.plan[last + 1, 2], p, s)
            s.reserve_end += 1
        left -= more
        off = hypot(s.X - s.path[more * p.fine, 0, 0], s.Y - s.path[more * p.fine, 1, 0])
        if not off < _STRAYS * (s.reach + p.hold * s.fastest) + _STRAYED:
            # No measurement corrects it: it would go on growing.
            s.reserve_end, left = first, 0
    put_down(s)
    for i in range(s.reserve_end - first):
        for axis in range(3):
            s.plan[last + 1 + i, axis] = s.kept[(first + i) % SLOTS, axis]
