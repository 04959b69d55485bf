"""Converters between numbers and voltages: the photodetector's ADC, the piezo's DAC."""

import math

from ..compiled.jit import kernel


@kernel
def convert(volts: float, lsb: float, limit: float) -> float:
    """A converter of resolution `lsb` and range +-`limit` [V]; 0 switches either off."""
    # Range first: what is far beyond it has no whole number of steps.
    if limit > 0.0:
        volts = min(max(volts, -limit), limit - lsb)
    if lsb > 0.0:
        volts = lsb * math.floor(volts / lsb + 0.5)
    return volts
