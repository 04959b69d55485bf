r"""Adhesive contact of a sphere from DMT to JKR by one parameter: Maugis-Dugdale, exact equations.

Units of this module (K = 4 E*/3, w work of adhesion, R_e effective radius):

    contact radius a   (pi w R_e^2 / K)^(1/3)
    force F            pi w R_e              (positive presses)
    indentation d      (pi^2 w^2 R_e / K^2)^(1/3)

With m = c/a, the outer radius of the adhesive zone over that of the contact, and mu = sqrt(m^2 - 1),

    A = mu + (m^2 - 2) atan mu,  B = mu atan mu - m + 1
    (lambda a^2 / 2) A + (4 lambda^2 a / 3) B = 1
    F = a^3 - lambda a^2 (mu + m^2 atan mu),  d = a^2 - (4/3) lambda a mu

where lambda = 2 sigma_0 (R_e / (pi w K^2))^(1/3) and sigma_0 = w / z_0 is the adhesive stress of range z_0. The first
line is a quadratic equation in a, so that the whole branch is explicit in m. docs/lever.md (8) to (13).

References
----------
D. Maugis, J. Colloid Interface Sci. 150 (1992) 243, doi:10.1016/0021-9797(92)90285-T.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.elementary import cbrt, sincos_each, square

_Array = NDArray[np.float64]
MODELS = ("maugis", "jkr", "dmt")


@dataclass(frozen=True)
class Branch:
    """The branch that is stable when the displacement is held, ordered by a parameter from its end on.

    Parameters
    ----------
    end : float
        Value of the parameter where the contact breaks at fixed grips.
    far : float
        Value towards which force and indentation grow without limit.
    at : callable
        Parameter (n,) -> (a, F, d), each (n,).
    """

    end: float
    far: float
    at: Callable[[_Array], tuple[_Array, _Array, _Array]]

    @property
    def least_indentation(self) -> float:
        """Indentation at which the contact breaks when the displacement is held."""
        return float(self.at(np.array([self.end]))[2][0])

    def solve(self, indentation: _Array) -> tuple[_Array, _Array]:
        """Contact radius and force at indentations (n,), none below `least_indentation`: bisection to round-off."""
        low, high = np.full(indentation.shape, self.end), np.full(indentation.shape, self.far)
        for _ in range(70):
            middle = 0.5 * (low + high)
            short = self.at(middle)[2] < indentation
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        a, force, _ = self.at(0.5 * (low + high))
        return a, force


def branch(model: str, transition: float = 0.0) -> Branch:
    """The contact model `model`, one of MODELS; `transition` is lambda of maugis, > 0."""
    if model == "jkr":
        # F = a^3 - a sqrt(6 a), d = a^2 - (2/3) sqrt(6 a); d is least at a^3 = 1/6.
        def jkr(a: _Array) -> tuple[_Array, _Array, _Array]:
            root = np.sqrt(6.0 * a)
            return a, a * a * a - a * root, a * a - 2.0 / 3.0 * root

        return Branch(cbrt(1.0 / 6.0), 1e3, jkr)
    if model == "dmt":
        return Branch(0.0, 1e3, lambda a: (a, a * a * a - 2.0, a * a))
    return _maugis(transition)


def along(lam: float) -> Callable[[_Array], tuple[_Array, _Array, _Array]]:
    """Contact radius, force and indentation over the angle t = atan mu: 0 is a contact without end, pi/2 one without
    area; `lam` is the transition parameter."""

    def at(t: _Array) -> tuple[_Array, _Array, _Array]:
        sine, cosine = sincos_each(t)
        mu, m = sine / cosine, 1.0 / cosine
        # 1 - m and mu - t cancel where the zone is narrow: half angles and a series.
        m_less_1 = 2.0 * square(sincos_each(0.5 * t)[0]) * m
        narrow, t2 = t < 0.02, t * t
        A = np.where(narrow, t * t2 * (4.0 / 3.0 + t2 * (0.8 + 136.0 / 315.0 * t2)), mu + (m * m - 2.0) * t)
        B = np.where(narrow, t2 * (0.5 + t2 * (0.125 + 7.0 / 144.0 * t2)), mu * t - m_less_1)
        b = 4.0 / 3.0 * lam * lam * B
        a = 2.0 / (b + np.sqrt(b * b + 2.0 * lam * A))
        return a, a * a * a - lam * a * a * (mu + m * m * t), a * a - 4.0 / 3.0 * lam * a * mu

    return at


def _maugis(lam: float) -> Branch:
    at = along(lam)
    # The end: least indentation, by a grid refined about its least place; without a fold it is that of no area.
    low, high = 1e-6, 0.5 * math.pi - 1e-7
    for _ in range(12):
        grid = np.linspace(low, high, 401)
        place = int(np.argmin(at(grid)[2]))
        low, high = grid[max(place - 1, 0)], grid[min(place + 1, 400)]
    return Branch(float(grid[place]), 1e-9, at)


def pull_off(model: str, transition: float = 0.0) -> float:
    """Largest pull at a fixed load, in pi w R_e: 2 for DMT, 1.5 for JKR."""
    found = branch(model, transition)
    low, high = found.end, found.far if model == "maugis" else 10.0
    for _ in range(12):
        grid = np.linspace(low, high, 401)
        force = found.at(grid)[1]
        place = int(np.argmin(force))
        low, high = grid[max(place - 1, 0)], grid[min(place + 1, 400)]
    return -float(force[place])
