"""The two plants and their one time-stepping scheme."""

from .compliant import step_compliant
from .constants import RECORD as PLANT_RECORD
from .constants import plant_constants
from .initial import rest
from .paper import Z_COMPUTED, Z_HELD, Z_UNIFORM, step_paper

__all__ = [
    "PLANT_RECORD",
    "Z_COMPUTED",
    "Z_HELD",
    "Z_UNIFORM",
    "plant_constants",
    "rest",
    "step_compliant",
    "step_paper",
]
