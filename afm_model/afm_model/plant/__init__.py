"""Plants: the equations of motion of scanner, cantilever and contact, and their one time-stepping scheme."""

from ..core.registry import register
from .averaged import AVERAGED
from .compliant import COMPLIANT
from .constants import Constants, plant_constants
from .lever import LEVER
from .paper import PAPER, Z_COMPUTED, Z_HELD, Z_UNIFORM
from .parameters import PlantGroup
from .state import State
from .steps import stable_step

register(COMPLIANT, PAPER, LEVER, AVERAGED)

__all__ = [
    "AVERAGED",
    "COMPLIANT",
    "LEVER",
    "PAPER",
    "Z_COMPUTED",
    "Z_HELD",
    "Z_UNIFORM",
    "Constants",
    "PlantGroup",
    "State",
    "plant_constants",
    "stable_step",
]
