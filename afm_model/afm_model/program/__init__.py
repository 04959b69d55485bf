"""Programs: what the scanner is asked to follow, and the setpoint of the tip."""

from typing import Any

from ..core.call import call
from ..core.jit import kernel
from ..core.records import Block, pointer_at, record_at
from ..core.registry import register
from ..parts.header import HEADER
from . import periodic
from .force_curve import FORCE_CURVE, ForceCurve
from .ordered import VERBS, VerbsParameters
from .periodic import PERIODIC, Reference

PARTS = (PERIODIC,)
register(*PARTS)
# Called by address, like those of somebody else.
register(FORCE_CURVE, VERBS)


@kernel
def reference(t: float, r: Any, m: Block) -> None:
    """Write the reference at time t [s] into the record r of REFERENCE, by the program of the block m."""
    g = record_at(m, 0, HEADER)
    if g.program == 0:
        periodic.reference(t, r, record_at(m, g.program_constants, periodic.CONSTANTS))
    else:
        call(g.program_reference, (t, r, pointer_at(m, g.program_constants)))


@kernel
def watch(t: float, d: Any, r: Any, m: Block) -> None:
    """Let the program of the block m look at the photodetector's sample d; see `afm_model.parts.Program`."""
    g = record_at(m, 0, HEADER)
    if g.program_watch != 0:
        call(g.program_watch, (t, d, r, pointer_at(m, g.program_constants), pointer_at(m, g.program_state)))


__all__ = [
    "FORCE_CURVE",
    "PARTS",
    "PERIODIC",
    "VERBS",
    "ForceCurve",
    "Reference",
    "VerbsParameters",
    "reference",
    "watch",
]
