"""Which drives are on their way: what was answered to the last measurements, slot by slot."""

from typing import Any

from ...core.jit import kernel
from ...core.records import Block, numbers_at, pointer_at
from .constants import ANSWERS


@kernel
def drives_of(kept: int, p: Any, s: Any) -> Block:
    """Drives of the answer kept at this place, x, y, z of one slot behind the other."""
    count = 3 * p.longest
    return pointer_at(numbers_at(s.sent, ANSWERS * count), kept * count)


@kernel
def newest_answered(newest: int, s: Any) -> int:
    """The newest measurement up to `newest` whose answer is kept; -1: none is."""
    if newest >= 0 and s.answered[newest % ANSWERS] == newest:
        return newest
    found = -1
    for i in range(ANSWERS):
        if s.answered[i] <= newest:
            found = max(found, s.answered[i])
    return found


@kernel
def recall(k: int, y: Any, p: Any, s: Any) -> None:
    """Write into the plan the drives that are in force until the answer to measurement k is.

    An answer is in force from the delay after its measurement on, or from its arrival if that is later; what has not
    arrived yet is taken to be there in the next period. Where none is known the drive that is in force stays.
    """
    for j in range(p.delay):
        ahead = j // p.slots
        newest = k - p.delay // p.slots + ahead
        if ahead == 0:
            newest = min(newest, y.newest_drive_sequence)
        answered = newest_answered(newest, s)
        if answered < 0:
            for axis in range(3):
                s.plan[j, axis] = y.drive[axis] / p.volts[axis]
        else:
            at = min((k - answered) * p.slots + j, s.lengths[answered % ANSWERS] - 1)
            sent = drives_of(answered % ANSWERS, p, s)
            for axis in range(3):
                s.plan[j, axis] = sent[3 * at + axis]


@kernel
def remember(k: int, planned: int, p: Any, s: Any) -> None:
    """Keep the answer to measurement k: so many slots of the plan."""
    s.answered[k % ANSWERS] = k
    s.lengths[k % ANSWERS] = planned
    sent = drives_of(k % ANSWERS, p, s)
    for i in range(planned):
        for axis in range(3):
            sent[3 * i + axis] = s.plan[i, axis]


@kernel
def answer(planned: int, u: Any, p: Any, s: Any) -> None:
    """Write so many slots of the plan into the answer: the drive that is first in force or, of more, all with their
    times.
    """
    for axis in range(3):
        u.voltage[axis] = s.plan[p.delay, axis] * p.volts[axis]
    u.horizon_count = 0
    if planned > p.delay + 1:
        u.horizon_period = p.slot / p.w0
        u.horizon_count = planned - 1
        for axis in range(3):
            u.voltage[axis] = s.plan[0, axis] * p.volts[axis]
            for i in range(u.horizon_count):
                u.horizon[i, axis] = s.plan[i + 1, axis] * p.volts[axis]
