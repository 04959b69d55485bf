"""Photodetectors: the truth as voltages."""

from typing import Any

from ..core.call import call
from ..core.jit import kernel
from ..core.records import Block, pointer_at, record_at
from ..core.registry import register
from ..parts.header import HEADER
from . import photodiode
from .photodiode import FILTER, PHOTODIODE, Photodiode

PARTS = (PHOTODIODE,)
register(*PARTS)


@kernel
def detect(o: Any, d: Any, r: Any, m: Block) -> None:
    """Write into d the sample that the detector of the block m takes of the truth o, with the random numbers r."""
    g = record_at(m, 0, HEADER)
    if g.detector == 0:
        p, s = record_at(m, g.detector_constants, photodiode.CONSTANTS), record_at(m, g.detector_filter, FILTER)
        photodiode.detect(o, d, p, s, r)
    else:
        call(g.detector_detect, (o, d, pointer_at(m, g.detector_constants), pointer_at(m, g.detector_state), r))


__all__ = ["FILTER", "PARTS", "PHOTODIODE", "Photodiode", "detect"]
