"""Samples: height, slopes, curvatures and friction strength at a place."""

from typing import Any

from ..jit import kernel
from ..parts.call import call
from ..parts.header import HEADER
from ..records import Block, pointer_at, record_at
from ..registry import register
from ..signals import SURFACE
from . import paper
from .flat import FLAT
from .grating import GRATING
from .height_map import MAP
from .lattice import LATTICE
from .paper import PAPER, PaperSample
from .patches import PATCHES
from .plane import PLANE
from .rough import ROUGH

PARTS = (PAPER,)
register(*PARTS)
# The others are called by address, like those of somebody else's.
register(FLAT, PLANE, GRATING, PATCHES, ROUGH, MAP, LATTICE)


@kernel
def surface(x: float, y: float, m: Block) -> Any:
    """The sample of the block m at (x, y) [x0], as a record of SURFACE that the next call writes over."""
    g = record_at(m, 0, HEADER)
    h = record_at(m, g.surface, SURFACE)
    h.adhesion = 1.0
    if g.sample == 0:
        paper.surface(x, y, h, record_at(m, g.sample_constants, paper.CONSTANTS), 0)
    else:
        call(g.sample_surface, (x, y, h, pointer_at(m, g.sample_constants), pointer_at(m, g.sample_map)))
    return h


__all__ = ["FLAT", "GRATING", "LATTICE", "MAP", "PAPER", "PARTS", "PATCHES", "PLANE", "ROUGH", "PaperSample", "surface"]
