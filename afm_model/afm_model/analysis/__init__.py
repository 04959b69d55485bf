"""Calibration from records, as on a real microscope: knows nothing of the simulator."""

from .thermal import ThermalTune, spring_constant

__all__ = ["ThermalTune", "spring_constant"]
