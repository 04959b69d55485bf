"""Bending and torsion of a uniform cantilever in modes, and what the modes beyond leave as static compliance.

A bending mode is counted by the deflection of its end, one of torsion by the twist there. Frequencies and slopes: roots
of cos x cosh x = -1; docs/lever.md (1) to (5).
"""

import math
from dataclasses import dataclass

from ..core.elementary import cos, cosh, sin, sinh, square

WAVE_NUMBERS = (1.8751040687119611, 4.694091132974174, 7.854757438237613)
"""Roots of cos x cosh x = -1: wave number of a mode times the length."""
MODES = len(WAVE_NUMBERS)


def _end(x: float) -> tuple[float, float]:
    """Deflection of a mode of mean square 1 at the end, and what clamps it: sinh and sin over cosh and cos."""
    ratio = (sinh(x) - sin(x)) / (cosh(x) + cos(x))
    return cosh(x) - cos(x) - ratio * (sinh(x) - sin(x)), ratio


def end_slope(x: float) -> float:
    """Slope of a mode at the end times the length, over its deflection there."""
    deflection, ratio = _end(x)
    return x * (sinh(x) + sin(x) - ratio * (cosh(x) - cos(x))) / deflection


def end_by_base(x: float) -> float:
    """Mean of a mode over its mean square, with the deflection 1 at the end; docs/lever.md (38)."""
    deflection, ratio = _end(x)
    return 2.0 * deflection * ratio / x


@dataclass(frozen=True)
class Mode:
    """One mode of a cantilever of spring constant 1 and length 1."""

    frequency: float  # over that of the first
    compliance: float  # static deflection of the end in this mode under a unit force there
    slope: float  # of the end over its deflection
    base: float  # force of inertia on it over that on its mass at the end, as the base moves across


MODE = tuple(
    Mode(square(x / WAVE_NUMBERS[0]), 12.0 / square(x * x), end_slope(x), end_by_base(x)) for x in WAVE_NUMBERS
)


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
        1.0 - math.fsum(mode.compliance for mode in taken),
        1.5 - math.fsum(mode.compliance * mode.slope for mode in taken),
        3.0 - math.fsum(mode.compliance * square(mode.slope) for mode in taken),
    )


TWIST_COMPLIANCE = 8.0 / square(math.pi)
"""Static twist of the end in the first mode of torsion, over that of the cantilever."""

TWIST_BASE = 4.0 / math.pi
"""Mean of that mode over its mean square, with the twist 1 at the end: how it feels a base that rocks."""


def mass(k: float, f0: float) -> float:
    """Of a cantilever of spring constant k [N/m] whose first resonance is f0 [Hz], in kg: x_1^4 k / 3 (2 pi f0)^2."""
    return square(square(WAVE_NUMBERS[0])) * k / (3.0 * square(2.0 * math.pi * f0))


def torsional_resonance(k_torsion: float, mass: float, width: float, thickness: float) -> float:
    """First torsional resonance [Hz] of a rectangular cantilever, docs/lever.md (25).

    Parameters
    ----------
    k_torsion : float [N m/rad]
        Torque at the end per angle there.
    mass : float [kg]
        Of the whole cantilever; its tip is left out.
    width, thickness : float [m]
    """
    return 0.25 * math.sqrt(12.0 * k_torsion / (mass * (square(width) + square(thickness))))
