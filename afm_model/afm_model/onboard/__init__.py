"""Loops inside the instrument, at the rate of the virtual ADC."""

from ..core.registry import register
from ..parts.groups import OnboardParameters
from .dynamic import DYNAMIC, DynamicParameters
from .none import NONE
from .pi import PI, PiParameters

register(NONE, PI, DYNAMIC)

__all__ = ["DYNAMIC", "NONE", "PI", "DynamicParameters", "OnboardParameters", "PiParameters"]
