"""Loops inside the instrument, at the rate of the virtual ADC."""

from typing import Any

from ..core.call import call
from ..core.jit import kernel
from ..core.records import Block, pointer_at, record_at
from ..core.registry import register
from ..parts.groups import OnboardParameters
from ..parts.header import HEADER
from .none import NONE
from .pi import PI, PiParameters

PARTS = (NONE,)
register(*PARTS)
# Called by address, like one of somebody else's.
register(PI)


@kernel
def regulate(t: float, d: Any, r: Any, u: Any, m: Block) -> None:
    """Let the onboard part of the block m change drive u; see `afm_model.parts.Onboard`."""
    g = record_at(m, 0, HEADER)
    if g.onboard != 0:
        call(g.onboard_regulate, (t, d, r, u, pointer_at(m, g.onboard_constants), pointer_at(m, g.onboard_state)))


__all__ = ["NONE", "PARTS", "PI", "OnboardParameters", "PiParameters", "regulate"]
