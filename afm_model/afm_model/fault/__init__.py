"""Faults: what goes wrong between instrument and controller."""

from typing import Any

from ..jit import kernel
from ..parts.call import call
from ..parts.groups import FaultParameters
from ..parts.header import HEADER
from ..records import Block, pointer_at, record_at
from ..registry import register
from .none import NONE

PARTS = (NONE,)
register(*PARTS)


@kernel
def on_measurement(t: float, y: Any, r: Any, m: Block) -> None:
    """Let the fault of the block m change measurement y, with the random numbers r."""
    g = record_at(m, 0, HEADER)
    if g.fault != 0:
        call(g.fault_on_measurement, (t, y, pointer_at(m, g.fault_constants), pointer_at(m, g.fault_state), r))


@kernel
def on_drive(t: float, u: Any, r: Any, m: Block) -> None:
    """Let the fault of the block m change drive u, with the random numbers r."""
    g = record_at(m, 0, HEADER)
    if g.fault != 0:
        call(g.fault_on_drive, (t, u, pointer_at(m, g.fault_constants), pointer_at(m, g.fault_state), r))


__all__ = ["NONE", "PARTS", "FaultParameters", "on_drive", "on_measurement"]
