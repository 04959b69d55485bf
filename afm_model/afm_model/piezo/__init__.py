"""Piezo ceramics: what a drive comes to."""

from typing import Any

from ..core.call import call
from ..core.jit import kernel
from ..core.records import Block, pointer_at, record_at
from ..core.registry import register
from ..parts.groups import PiezoParameters
from ..parts.header import HEADER
from . import linear
from .ceramic import CERAMIC
from .linear import LINEAR

PARTS = (LINEAR,)
register(*PARTS)
# Called by address, like one of somebody else's.
register(CERAMIC)


@kernel
def actuate(t: float, u: Any, v: Any, m: Block) -> None:
    """Write into v what the piezo of the block m makes of drive u, both records of DRIVE [V]."""
    g = record_at(m, 0, HEADER)
    if g.piezo == 0:
        linear.actuate(t, u, v, 0, 0)
    else:
        call(g.piezo_actuate, (t, u, v, pointer_at(m, g.piezo_constants), pointer_at(m, g.piezo_state)))


__all__ = ["CERAMIC", "LINEAR", "PARTS", "PiezoParameters", "actuate"]
