"""Samples: height, slopes, curvatures and friction strength at a place."""

from typing import Any

from ..core.call import call
from ..core.jit import kernel
from ..core.records import Block, pointer_at, record_at
from ..core.registry import register
from ..parts.header import HEADER
from ..parts.signals import DISPLACEMENT, SURFACE
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
    d = record_at(m, g.displacement, DISPLACEMENT)
    if d.there != 0:
        x -= d.x
        y -= d.y
    if g.sample == 0:
        paper.surface(x, y, h, record_at(m, g.sample_constants, paper.CONSTANTS), 0)
    else:
        call(g.sample_surface, (x, y, h, pointer_at(m, g.sample_constants), pointer_at(m, g.sample_map)))
    if d.there != 0:
        h.strength *= d.friction
        h.height += d.z
    return h


__all__ = ["FLAT", "GRATING", "LATTICE", "MAP", "PAPER", "PARTS", "PATCHES", "PLANE", "ROUGH", "PaperSample", "surface"]
