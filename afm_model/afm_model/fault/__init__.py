"""Faults: what goes wrong between instrument and controller, and with the sample."""

from typing import Any

from ..core.call import call
from ..core.jit import kernel
from ..core.records import Block, address_at, numbers_at, pointer_at, record_at
from ..core.registry import register
from ..parts.groups import FaultParameters
from ..parts.header import HEADER
from ..parts.signals import COMMAND, DISPLACEMENT, MEASUREMENT
from .entry import KINDS, LATENCY_TICKS, NEVER, TARGETS, Entry
from .events import acted, active, events
from .memory import CONSTANTS, MEMORY, MEMORY_SIZE, SENSED
from .message import delay_command, delay_measurement
from .none import NONE
from .schedule import SCHEDULED, Schedule, faults_of, table
from .signal import spoil_drive, spoil_measurement
from .surface import disturb_sample

PARTS = (NONE, SCHEDULED)
register(*PARTS)
_SCHEDULED = PARTS.index(SCHEDULED)


@kernel
def _memory(m: Block) -> Any:
    """What the schedule remembers, which is there as soon as there is a fault."""
    return record_at(numbers_at(record_at(m, 0, HEADER).fault_memory, MEMORY_SIZE), 0, MEMORY)


@kernel
def on_command(k: int, m: Block) -> int:
    """Address of the command that has arrived by tick k. Called once, at its begin."""
    g = record_at(m, 0, HEADER)
    if g.fault == _SCHEDULED:
        p = record_at(m, g.fault_constants, CONSTANTS)
        if p.on_sample > 0:
            disturb_sample(k, record_at(m, g.displacement, DISPLACEMENT), p)
        if p.on_commands > 0:
            memory = numbers_at(g.fault_memory, MEMORY_SIZE)
            return delay_command(k, record_at(m, g.commanded, COMMAND), p, record_at(memory, 0, MEMORY), memory)
    return address_at(m, g.commanded)


@kernel
def on_measurement(k: int, t: float, r: Any, m: Block) -> None:
    """Let the fault change the measurement of the block m, of tick k at time t, with the random numbers r."""
    g = record_at(m, 0, HEADER)
    if g.fault == _SCHEDULED:
        p = record_at(m, g.fault_constants, CONSTANTS)
        if p.on_sensors > 0:
            spoil_measurement(k, record_at(m, g.measurement, MEASUREMENT), p, _memory(m))
        if p.on_measurements > 0:
            delay_measurement(k, m, g.measurement, p, _memory(m))
    elif g.fault != 0:
        y = record_at(m, g.measurement, MEASUREMENT)
        call(g.fault_on_measurement, (t, y, pointer_at(m, g.fault_constants), pointer_at(m, g.fault_state), r))


@kernel
def on_drive(k: int, t: float, u: Any, r: Any, m: Block) -> None:
    """Let the fault of the block m change drive u, put in force at time t in tick k, with the random numbers r."""
    g = record_at(m, 0, HEADER)
    if g.fault == _SCHEDULED:
        p = record_at(m, g.fault_constants, CONSTANTS)
        if p.on_drives > 0:
            spoil_drive(k, t, u, p, _memory(m))
    elif g.fault != 0:
        call(g.fault_on_drive, (t, u, pointer_at(m, g.fault_constants), pointer_at(m, g.fault_state), r))


@kernel
def unasked(m: Block) -> bool:
    """Whether the measurement of this tick gets lost, so that nobody answers it."""
    g = record_at(m, 0, HEADER)
    if g.fault == _SCHEDULED and record_at(m, g.fault_constants, CONSTANTS).on_measurements > 0:
        return bool(_memory(m).lost != 0)
    return False


__all__ = [
    "CONSTANTS",
    "KINDS",
    "LATENCY_TICKS",
    "MEMORY",
    "NEVER",
    "NONE",
    "PARTS",
    "SCHEDULED",
    "SENSED",
    "TARGETS",
    "Entry",
    "FaultParameters",
    "Schedule",
    "acted",
    "active",
    "events",
    "faults_of",
    "on_command",
    "on_drive",
    "on_measurement",
    "table",
    "unasked",
]
