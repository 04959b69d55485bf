"""Plants: the equations of motion of scanner, cantilever and contact, and their one time-stepping scheme."""

from ..core.registry import register
from .compliant import COMPLIANT
from .constants import CONSTANTS, plant_constants
from .groups import PlantGroup
from .lever import LEVER
from .paper import PAPER, Z_COMPUTED, Z_HELD, Z_UNIFORM
from .state import STATE
from .steps import stable_step

register(COMPLIANT, PAPER, LEVER)

__all__ = [
    "COMPLIANT",
    "CONSTANTS",
    "LEVER",
    "PAPER",
    "STATE",
    "Z_COMPUTED",
    "Z_HELD",
    "Z_UNIFORM",
    "PlantGroup",
    "plant_constants",
    "stable_step",
]
