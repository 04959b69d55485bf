"""Loops inside the instrument, at the rate of the virtual ADC."""

from ..core.registry import register
from ..parts.groups import OnboardParameters
from .dynamic import DYNAMIC, DynamicParameters
from .frequency_modulation import FREQUENCY_MODULATION, FrequencyModulationParameters
from .none import NONE
from .pi import PI, PiParameters

register(NONE, PI, DYNAMIC, FREQUENCY_MODULATION)

__all__ = [
    "DYNAMIC",
    "FREQUENCY_MODULATION",
    "NONE",
    "PI",
    "DynamicParameters",
    "FrequencyModulationParameters",
    "OnboardParameters",
    "PiParameters",
]
