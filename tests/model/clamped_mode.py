"""Modes of a beam that is clamped at one end and free at the other, in closed form: nothing of our own code."""

import math
from functools import cache
from typing import NamedTuple

from scipy.integrate import quad
from scipy.optimize import brentq


class ClampedMode(NamedTuple):
    """One mode of bending, of a beam of length 1."""

    wave_number: float
    over_first: float  # its frequency over that of the first mode
    mean: float  # of its shape along the beam
    mean_square: float
    end: float  # its shape at the free end
    slope: float  # of the shape there, times the length

    @property
    def stiffness(self) -> float:
        """Over the spring constant of the beam."""
        return self.wave_number**4 * self.mean_square / (3.0 * self.end**2)


@cache
def clamped_mode(number: int) -> ClampedMode:
    """The mode with this number, 0 to 2."""
    roots = [brentq(lambda x: math.cos(x) + 1.0 / math.cosh(x), *ends, xtol=1e-14) for ends in ((1, 3), (4, 6), (7, 9))]
    x = roots[number]
    ratio = (math.cosh(x) + math.cos(x)) / (math.sinh(x) + math.sin(x))

    def shape(s: float) -> float:
        return math.cosh(x * s) - math.cos(x * s) - ratio * (math.sinh(x * s) - math.sin(x * s))

    return ClampedMode(
        x,
        (x / roots[0]) ** 2,
        quad(shape, 0.0, 1.0)[0],
        quad(lambda s: shape(s) ** 2, 0.0, 1.0)[0],
        shape(1.0),
        x * (math.sinh(x) + math.sin(x) - ratio * (math.cosh(x) - math.cos(x))),
    )
