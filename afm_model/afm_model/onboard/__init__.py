"""Loops inside the instrument, at the rate of the virtual ADC."""

from ..core.registry import register
from ..parts.groups import OnboardParameters
from .bimodal import BIMODAL, BimodalParameters
from .dynamic import DYNAMIC, DynamicParameters
from .frequency_modulation import FREQUENCY_MODULATION, FrequencyModulationParameters
from .none import NONE
from .pi import PI, PiParameters

register(NONE, PI, DYNAMIC, FREQUENCY_MODULATION, BIMODAL)

__all__ = [
    "BIMODAL",
    "DYNAMIC",
    "FREQUENCY_MODULATION",
    "NONE",
    "PI",
    "BimodalParameters",
    "DynamicParameters",
    "FrequencyModulationParameters",
    "OnboardParameters",
    "PiParameters",
]
