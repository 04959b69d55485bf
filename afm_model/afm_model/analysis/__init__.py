"""Calibration from records, as on a real microscope: knows nothing of the simulator."""

from .estimate import Estimate
from .thermal import ThermalTune, spring_constant

__all__ = ["Estimate", "ThermalTune", "spring_constant"]
