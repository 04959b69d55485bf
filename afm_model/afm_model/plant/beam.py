"""Bending of a uniform cantilever in its modes, and what the modes beyond leave as static compliance.

A mode is counted by the deflection of its end. Frequencies and slopes: roots of cos x cosh x = -1; docs/lever.md (1)
to (4).
"""

import math
from dataclasses import dataclass

WAVE_NUMBERS = (1.8751040687119611, 4.694091132974174, 7.854757438237613)
"""Roots of cos x cosh x = -1: wave number of a mode times the length."""
MODES = len(WAVE_NUMBERS)


def end_slope(x: float) -> float:
    """Slope of a mode at the end times the length, over its deflection there."""
    ratio = (math.sinh(x) - math.sin(x)) / (math.cosh(x) + math.cos(x))
    deflection = math.cosh(x) - math.cos(x) - ratio * (math.sinh(x) - math.sin(x))
    return x * (math.sinh(x) + math.sin(x) - ratio * (math.cosh(x) - math.cos(x))) / deflection


@dataclass(frozen=True)
class Mode:
    """One mode of a cantilever of spring constant 1 and length 1."""

    frequency: float  # over that of the first
    compliance: float  # static deflection of the end in this mode under a unit force there
    slope: float  # of the end over its deflection


MODE = tuple(Mode((x / WAVE_NUMBERS[0]) ** 2, 12.0 / x**4, end_slope(x)) for x in WAVE_NUMBERS)


@dataclass(frozen=True)
class Rest:
    """Static compliance of a cantilever of spring constant 1 and length 1 besides that of its first modes.

    A load is a force at the end and a couple there (force times arm); it moves the end and turns it.
    """

    end_by_force: float
    turn_by_force: float  # and the end by a couple
    turn_by_couple: float


def rest(modes: int) -> Rest:
    """What is left of the static compliance 1, 3/2, 3 by the first `modes` modes."""
    taken = MODE[:modes]
    return Rest(
        1.0 - sum(mode.compliance for mode in taken),
        1.5 - sum(mode.compliance * mode.slope for mode in taken),
        3.0 - sum(mode.compliance * mode.slope**2 for mode in taken),
    )
