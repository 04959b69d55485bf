"""Loops inside the instrument, at the rate of the virtual ADC."""

from ..core.registry import register
from ..parts.groups import OnboardParameters
from .none import NONE
from .pi import PI, PiParameters

register(NONE, PI)

__all__ = ["NONE", "PI", "OnboardParameters", "PiParameters"]
