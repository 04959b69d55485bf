"""Samples: height, slopes, curvatures and friction strength at a place."""

from ..core.registry import register
from .flat import FLAT
from .grating import GRATING
from .height_map import MAP
from .lattice import LATTICE
from .paper import PAPER, PaperSample
from .paper import surface as paper_surface
from .patches import PATCHES
from .plane import PLANE
from .rough import ROUGH

register(PAPER, FLAT, PLANE, GRATING, PATCHES, ROUGH, MAP, LATTICE)

__all__ = ["FLAT", "GRATING", "LATTICE", "MAP", "PAPER", "PATCHES", "PLANE", "ROUGH", "PaperSample", "paper_surface"]
