"""Programs: what the scanner is asked to follow, and the setpoint of the tip."""

from typing import Any

from ..jit import kernel
from ..parts.call import call
from ..parts.header import HEADER
from ..records import Block, pointer_at, record_at
from ..registry import register
from . import periodic
from .periodic import PERIODIC, Reference

PARTS = (PERIODIC,)
register(*PARTS)


@kernel
def reference(t: float, r: Any, m: Block) -> None:
    """Write the reference at time t [s] into the record r of REFERENCE, by the program of the block m."""
    g = record_at(m, 0, HEADER)
    if g.program == 0:
        periodic.reference(t, r, record_at(m, g.program_constants, periodic.CONSTANTS))
    else:
        call(g.program_reference, (t, r, pointer_at(m, g.program_constants)))


__all__ = ["PARTS", "PERIODIC", "Reference", "reference"]
