"""The instrument's own limits, in compiled code: where one is passed it takes the drive itself, and gives it back.

It looks at what the plant really does, not at what sensors with noise and faults show. One look in a control
tick: a force that comes and goes between two ticks is not seen.
"""

from typing import Annotated

from ..compiled.jit import kernel
from ..compiled.records import Block, Record, Vector, record_at
from ..parts.header import BlockHeader
from ..parts.signals import Drive, PiezoDrive, Truth

RUNNING, RETRACTED, WITHDRAWN, APPROACHING = 1, 4, 8, 9
"""Who has the drive, by the numbers of `run.State`: the controller; the instrument, because the controller is silent,
because a limit was passed, on the way back to the tip.
"""
NONE, TRAVEL, FORCE, INVALID, CONTACT_LOST, TOO_HARD, NO_CONTACT, RESUMED, APPROACHED, SILENT, ANSWERED = range(11)
"""Why the phase has changed. The first four after NONE are limits; the next two are of an approach that failed."""


class LimitConstants(Record):
    """What the limits go by. Those that are off are infinite."""

    on: float  # whether there is any limit to look at
    z_inside: float  # whether a loop inside the instrument moves z
    ordered: float  # whether verbs are ordered: an approach is one of them then
    travel: Annotated[float, "m"]
    force: Annotated[float, "N"]
    low: Annotated[float, "N"]  # normal forces between which the plant holds
    high: Annotated[float, "N"]
    approach_force: Annotated[float, "N"]
    contact_ticks: int  # 0: any time out of contact is allowed
    resume_ticks: int  # 0: not by itself
    settle_ticks: int
    approach_ticks: int
    ramp_ticks: float
    rise: Annotated[float, "V"]  # of z in a tick of an approach
    distance: Annotated[float, "V"]
    sign: float  # of the sensitivity of z
    retracted: Annotated[float, "V"]  # z of a retracted sample
    retract_time: Annotated[float, "s"]
    control_period: Annotated[float, "s"]
    rest: Annotated[Vector, "V"]  # drive of the start


class GuardCounts(Record):
    withdrawals: int
    ticks_withdrawn: int
    scored_ticks_withdrawn: int
    ticks_retracted: int
    scored_ticks_retracted: int


class GuardState(GuardCounts):
    """Where the limits stand. It is no state of a part, and not in the hash."""

    phase: int
    event: int  # why it is what it is
    limit: int  # the limit passed last, as long as the instrument has the drive
    since: int  # tick at which this phase began
    lost: int  # ticks out of contact in a row
    touching: int  # ticks in contact in a row, of an approach
    x: float  # what passed a limit: where the scanner was [m], and the force [N]
    y: float
    normal_force: float
    drive: Annotated[Vector, "V"]  # the instrument's own
    target: Annotated[Vector, "V"]
    moves: Vector  # [V] in a tick


@kernel
def has_z(s: GuardState) -> bool:
    """Whether the instrument itself says where z is; a loop inside has it from the first touch of an approach on."""
    return bool(s.phase != RUNNING and (s.phase != APPROACHING or s.touching == 0))


@kernel
def take_drive(m: Block, scored: bool) -> None:
    """Write the instrument's own drive for the next tick, scored or not, into the command."""
    g = record_at(m, 0, BlockHeader)
    p, s = record_at(m, g.limits, LimitConstants), record_at(m, g.guard, GuardState)
    u = record_at(m, g.commanded, PiezoDrive)
    if s.phase == RETRACTED:
        s.ticks_retracted += 1
        s.scored_ticks_retracted += scored
        moved = s.drive[2] + s.moves[2]
        s.drive[2] = max(moved, s.target[2]) if s.moves[2] < 0.0 else min(moved, s.target[2])
    else:
        s.ticks_withdrawn += 1
        s.scored_ticks_withdrawn += scored
        if s.phase == WITHDRAWN:
            for axis in range(3):
                s.drive[axis] += min(max(s.target[axis] - s.drive[axis], -s.moves[axis]), s.moves[axis])
        elif s.touching == 0:
            s.drive[2] += p.rise
    for axis in range(3):
        u.voltage[axis] = s.drive[axis]
    u.horizon_count = 0


@kernel
def _enter(phase: int, event: int, k: int, s: GuardState) -> None:
    s.phase, s.event, s.since = phase, event, k


@kernel
def _hold(m: Block, s: GuardState) -> None:
    """Begin with the drive that is applied; along z with what a loop inside has made of it."""
    g = record_at(m, 0, BlockHeader)
    a, w = record_at(m, g.applied, Drive), record_at(m, g.regulated, Drive)
    s.drive[0], s.drive[1], s.drive[2] = a.voltage[0], a.voltage[1], w.voltage[2]
    for axis in range(3):
        s.target[axis] = s.drive[axis]


@kernel
def _withdraw(m: Block, event: int, k: int, p: LimitConstants, s: GuardState) -> None:
    """Take the drive: away from the tip, and after too long a way back to the middle."""
    if event <= CONTACT_LOST:
        s.limit = event
    s.withdrawals += 1
    s.lost = s.touching = 0
    _hold(m, s)
    if event == TRAVEL:
        s.target[0], s.target[1] = p.rest[0], p.rest[1]
    s.target[2] = p.sign * (min(p.sign * s.drive[2], 0.0) - p.distance)
    for axis in range(3):
        s.moves[axis] = abs(s.target[axis] - s.drive[axis]) / p.ramp_ticks
    _enter(WITHDRAWN, event, k, s)


@kernel
def _passed(p: LimitConstants, s: GuardState, o: Truth) -> int:
    """The limit that is passed, or NONE; what passed it is kept."""
    s.x, s.y, s.normal_force = o.position[0], o.position[1], o.normal_force
    if not (abs(s.x) <= p.travel and abs(s.y) <= p.travel):
        return TRAVEL
    # An approach has a limit of its own: a tip that snaps in, or still rings, touches with more than it scans with.
    if s.phase != APPROACHING and not s.normal_force <= p.force:
        return FORCE
    if not p.low <= s.normal_force <= p.high:
        return INVALID
    # A sample that comes or was taken away is out of contact on purpose.
    if p.contact_ticks > 0 and s.phase == RUNNING:
        s.lost = 0 if o.contact != 0.0 else s.lost + 1
        if s.lost >= p.contact_ticks:
            return CONTACT_LOST
    return NONE


@kernel
def _give_back(event: int, k: int, s: GuardState) -> None:
    s.limit = NONE
    s.lost = 0
    _enter(RUNNING, event, k, s)


@kernel
def bring_back(m: Block, k: int) -> int:
    """Bring a withdrawn sample back to the tip from tick k on, or return the limit that is still passed.

    An approach is a verb where verbs are ordered: the tip stays withdrawn then, z is the loop's again.
    """
    g = record_at(m, 0, BlockHeader)
    p, s = record_at(m, g.limits, LimitConstants), record_at(m, g.guard, GuardState)
    passed = _passed(p, s, record_at(m, g.truth, Truth))
    if passed == NONE:
        if p.ordered != 0.0:
            _give_back(RESUMED, k, s)
        else:
            s.touching = 0
            _enter(APPROACHING, RESUMED, k, s)
    return int(passed)


@kernel
def retract(m: Block, k: int) -> None:
    """Take the drive from a controller that is silent: z goes below its rest, by the same step in each tick."""
    g = record_at(m, 0, BlockHeader)
    p, s = record_at(m, g.limits, LimitConstants), record_at(m, g.guard, GuardState)
    _hold(m, s)
    s.target[2] = p.retracted
    s.moves[2] = (p.retracted - s.drive[2]) / p.retract_time * p.control_period
    _enter(RETRACTED, SILENT, k, s)


@kernel
def watch_limits(m: Block, k: int) -> None:
    """Check the limits after the last tick, before tick k."""
    g = record_at(m, 0, BlockHeader)
    p, s = record_at(m, g.limits, LimitConstants), record_at(m, g.guard, GuardState)
    if s.phase == WITHDRAWN:
        if 0 < p.resume_ticks <= k - s.since:
            bring_back(m, k)
        return
    o = record_at(m, g.truth, Truth)
    passed = _passed(p, s, o)
    if passed == NONE and s.phase == APPROACHING:
        if not s.normal_force <= p.approach_force:
            passed = TOO_HARD
        else:
            s.touching = s.touching + 1 if o.contact != 0.0 else 0
            if s.touching >= p.settle_ticks:
                _give_back(APPROACHED, k, s)
            elif k - s.since >= p.approach_ticks:
                passed = NO_CONTACT
    if passed != NONE:
        _withdraw(m, passed, k, p, s)
