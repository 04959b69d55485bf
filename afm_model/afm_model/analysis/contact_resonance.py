"""Stiffness of a contact from a resonance of a cantilever pressed on the sample; docs/dynamic.md (56)."""

import math

import numpy as np

from ..cantilever.beam import WAVE_NUMBERS
from .estimate import Estimate, positive

_STEP = 1e-6
"""Part of the frequency by which it is changed for the slope."""


def contact_stiffness(
    resonance: float | Estimate,
    *,
    f0: float,
    k: float,
    mode: int = 1,
    lateral: float = 0.0,
    tilt: float = 0.0,
    tip_height: float = 0.0,
    length: float = math.inf,
) -> Estimate:
    """Normal stiffness of a contact [N/m] from a resonance of the pressed cantilever, docs/dynamic.md (56).

    Uniform beam, clamped at one end, springs of the contact at the other. Upright and without a lateral spring it is
    that of Rabe, Janser and Arnold (1996), doi:10.1063/1.1147409:

        k_n / k = x^3 (1 + cos x cosh x) / 3 (sinh x cos x - cosh x sin x),    x = x_1 sqrt(f / f0)

    A lateral spring of a tip that sticks acts through the height of the tip. Damping is left out: it changes the
    resonance by some 1 / 8 Q^2 of it. The mass of the tip and the compliance of its shank are left out too.

    Parameters
    ----------
    resonance : float or Estimate [Hz]
        Of the mode without damping, as `resonance_fit` finds it.
    f0 : float [Hz]
        First resonance of the free cantilever.
    k : float [N/m]
        Spring constant.
    mode : int
        Whose resonance it is, 1 for the lowest one.
    lateral : float
        Lateral over normal stiffness of the contact; 0 for a tip that slides freely.
    tilt : float [rad]
        Angle by which the cantilever points down to the sample.
    tip_height, length : float [m]
        Of the tip below the neutral axis; of the cantilever.

    Returns
    -------
    Estimate [N/m]
        Its uncertainty is that of the given resonance.

    Raises
    ------
    ValueError
        If a number is not allowed, or no stiffness makes this the resonance of the mode.
    """
    f, error = (resonance.value, resonance.uncertainty) if isinstance(resonance, Estimate) else (resonance, 0.0)
    positive(resonance=f, f0=f0, k=k, length=min(length, 1.0))
    for name, value in (("lateral", lateral), ("tip_height", tip_height)):
        if not value >= 0.0:
            raise ValueError(f"{name} = {value:g} is not allowed: it must be >= 0")
    if mode < 1:
        raise ValueError(f"mode = {mode} is not allowed: it must be >= 1")
    springs = lateral, tilt, tip_height / length
    value = _stiffness(f / f0, mode, springs)
    if math.isnan(value):
        raise ValueError(
            f"a resonance at {f:.6g} Hz = {f / f0:.4g} f0 is not allowed: no stiffness of a contact makes it that of "
            f"mode {mode}"
        )
    near = [_stiffness(f * (1.0 + side) / f0, mode, springs) for side in (-_STEP, _STEP)]
    slope = float(np.nanmax(np.abs(np.array(near) - value))) / (_STEP * f)
    return Estimate(k * value, k * slope * error)


def _stiffness(ratio: float, mode: int, springs: tuple[float, float, float]) -> float:
    """Return the stiffness over that of the cantilever, for a resonance at `ratio` times f0; NaN if none fits."""
    x = WAVE_NUMBERS[0] * math.sqrt(ratio)
    lateral, tilt, arm = springs
    lacks, linear, square = _determinant(x, lateral, tilt, arm)
    # One mode after the other passes this frequency as the contact becomes stiffer, the highest first.
    roots = np.roots([square, linear, lacks]) if square != 0.0 else np.array([-lacks / linear])
    rising = sorted(root.real for root in roots if abs(root.imag) < 1e-12 * abs(root) and root.real >= 0.0)
    passed = _free_below(x) - mode
    return float(rising[passed]) if 0 <= passed < len(rising) else math.nan


def _free_below(x: float) -> int:
    """How many resonances of the free cantilever are below the wave number x times the length."""
    from scipy.optimize import brentq  # here: a recorder needs none

    def clamped(y: float) -> float:
        return math.cos(y) + 1.0 / math.cosh(y)

    return sum(brentq(clamped, n * math.pi, (n + 1) * math.pi) <= x for n in range(int(x / math.pi) + 1))


def _determinant(x: float, lateral: float, tilt: float, arm: float) -> tuple[float, float, float]:
    """Of cantilever and springs, over cosh x: its powers 0, 1, 2 of k_n / k.

    With C the compliances of the end at this frequency (Bishop and Johnson, The Mechanics of Vibration, 1960), times
    1 + cos x cosh x, and S the springs, det (1 + C S) = 1 + tr C S + det C det S.
    """
    cos, sin, tanh, one = math.cos(x), math.sin(x), math.tanh(x), 1.0 / math.cosh(x)
    D = one + cos
    by_force = 3.0 * (sin - tanh * cos) / x**3
    by_both = 3.0 * sin * tanh / x**2
    by_couple = 3.0 * (sin + tanh * cos) / x
    normal, along = (math.cos(tilt), -arm * math.sin(tilt)), (math.sin(tilt), arm * math.cos(tilt))

    def gives(u: tuple[float, float]) -> float:
        return by_force * u[0] ** 2 + 2.0 * by_both * u[0] * u[1] + by_couple * u[1] ** 2

    return D, gives(normal) + lateral * gives(along), lateral * arm**2 * 9.0 * (one - cos) / x**4
