"""From a command to the drive that is in force: line of those on their way, horizon, fault, range, slew, resolution."""

import math
from typing import Any

from ..compiled.jit import kernel
from ..compiled.records import Block, address_at, numbers_at, record_at, size
from ..core.converter import convert
from ..parts.dispatch import on_drive
from ..parts.header import BlockHeader
from ..parts.signals import LONGEST_HORIZON, Drive, PiezoDrive, copy_command
from .block import LoopState
from .score import ScoreSums, count_drive

_SIZE = size(PiezoDrive)
_ROUND_OFF = 1e-6
"""Part of a horizon's period by which a time may fall short of it."""


@kernel
def allowed(u: PiezoDrive) -> bool:
    """Whether a command can be put in force: all its numbers are finite, its horizon has a period."""
    if not (math.isfinite(u.voltage[0]) and math.isfinite(u.voltage[1]) and math.isfinite(u.voltage[2])):
        return False
    count = u.horizon_count
    if count == 0:
        return True
    if not (0 < count <= LONGEST_HORIZON and 0.0 < u.horizon_period < math.inf):
        return False
    for i in range(count):
        for axis in range(3):
            if not math.isfinite(u.horizon[i, axis]):
                return False
    return True


@kernel
def command_at(address: int) -> Any:
    """The command at an address: in the block, or in the memory of a fault."""
    return record_at(numbers_at(address, _SIZE), 0, PiezoDrive)


@kernel
def due(m: Block) -> int:
    """Address of the command that is due at this tick: the one received `delay` ticks ago."""
    g = record_at(m, 0, BlockHeader)
    c = record_at(m, g.loop, LoopState)
    if c.delay == 0:
        return int(c.received)
    slots = c.delay + 1
    copy_command(command_at(c.received), record_at(m, g.line + _SIZE * (c.k % slots), PiezoDrive))
    return address_at(m, g.line + _SIZE * ((c.k + 1) % slots))


@kernel
def put_in_force(m: Block, at: int, late: float, faults: Block) -> None:
    """Apply what the command at address `at` holds for a time `late` after the begin of this tick [s]."""
    g = record_at(m, 0, BlockHeader)
    c = record_at(m, g.loop, LoopState)
    u = command_at(at)
    a = record_at(m, g.applied, Drive)
    x, y, z = a.voltage[0], a.voltage[1], a.voltage[2]
    i = 0
    if u.horizon_count > 0:
        age = (c.k - u.sequence) * c.control_period + late
        i = math.floor(min(age / u.horizon_period + _ROUND_OFF, float(u.horizon_count)))
    for axis in range(3):
        a.voltage[axis] = u.voltage[axis] if i <= 0 else u.horizon[i - 1, axis]
    on_drive(c.k, c.k * c.control_period + late, a, faults, m)
    limit, step, before = c.drive_limit, c.slew_step, (x, y, z)
    clipped = steep = 0
    for axis in range(3):
        volts = a.voltage[axis]
        if abs(volts) > limit > 0.0:
            clipped = 1
            volts = math.copysign(limit, volts)
        change = volts - before[axis]
        if abs(change) > step > 0.0:
            steep = 1
            volts = before[axis] + math.copysign(step, change)
        a.voltage[axis] = convert(volts, c.drive_lsb, limit)
    c.clipped += clipped
    c.steep += steep
    if c.k >= c.score_tick:
        count_drive(record_at(m, g.score, ScoreSums), a.voltage[0] - x, a.voltage[1] - y, a.voltage[2] - z)
