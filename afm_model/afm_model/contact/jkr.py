"""Johnson-Kendall-Roberts contact of a sphere of radius R_e, on its stable branch.

Everything is written in u = (a / a_0)^(1/2), where a is the contact radius and a_0 its value at zero load. Then

    delta R_e / a_0^2 = u^4 - (2/3) u                 (indentation)
    L / |L_s|         = 4 (u^6 - u^3)                 (load)
    A_c / A_c0        = u^4                           (contact area)

with |L_s| = 3 pi R_e gamma (pull-off at a fixed load, u^3 = 1/2) and a_0 = (12 pi R_e^2 gamma / K)^(1/3). With fixed
grips the branch ends where d(delta)/du = 0, at u^3 = 1/6 and delta R_e / a_0^2 = -0.2752. Equations and derivation:
docs/theory.md (1) to (12).

References
----------
K. L. Johnson, K. Kendall, A. D. Roberts, Proc. R. Soc. Lond. A 324 (1971) 301, doi:10.1098/rspa.1971.0141.
"""

import math
from typing import Any

from ..compiled.jit import kernel
from ..core.elementary import cbrt, inverse_cbrt, square

U_FIXED_GRIPS = cbrt(1.0 / 6.0)
"""u at which the contact breaks when the displacement is held (fixed grips), docs/theory.md (9)."""

INDENTATION_FIXED_GRIPS = -0.5 * U_FIXED_GRIPS
"""delta R_e / a_0^2 at which the contact breaks when the displacement is held: -0.2752."""
_SCALE = 6.0 * cbrt(6.0)
"""1 / U_FIXED_GRIPS^4."""
# Interpolates in Chebyshev points.
_FIT = (0.9999994440079478, -0.4999525946326546, 0.29983788007852324, -0.1578578490315034, -0.07757420208181724)


@kernel
def u_of_indentation(d: float) -> float:
    """Root u >= (1/6)^(1/3) of u^4 - (2/3) u = d, docs/theory.md (11).

    Written for y = u / (1/6)^(1/3) - 1, nothing cancels near the limit of fixed grips or far in contact.

    Parameters
    ----------
    d : float [1]
        delta R_e / a_0^2; values below the fixed-grips limit -0.2752 are treated as that limit.

    Returns
    -------
    float [1]
        (a / a_0)^(1/2).
    """
    if d <= INDENTATION_FIXED_GRIPS:
        return U_FIXED_GRIPS
    t = math.sqrt((d - INDENTATION_FIXED_GRIPS) * _SCALE)
    # z = y / t to 2e-6 for any t.
    r = 1.0 / (0.5 + math.sqrt(2.1 + t))
    r2 = r * r
    z = r * ((_FIT[0] + _FIT[1] * r) + ((_FIT[2] + _FIT[3] * r) + _FIT[4] * r2) * r2)
    # One step of third order for z^2 (y^2 + 4 y + 6) = 1 gives all digits.
    y = t * z
    z2 = z * z
    slope = 1.0 / (z2 * (12.0 + y * (12.0 + 4.0 * y)))
    e = (z2 * (6.0 + y * (4.0 + y)) - 1.0) * slope
    y -= y * (e * (1.0 + 6.0 * z2 * slope * ((1.0 + y) * (1.0 + y)) * e))
    return U_FIXED_GRIPS + U_FIXED_GRIPS * y


@kernel
def u_of_load(load_ratio: float) -> float:
    """u at a load L / |L_s| >= -1, branch stable under a fixed load, docs/theory.md (7); below -1 that at pull-off.

    Parameters
    ----------
    load_ratio : float [1]
        L / |L_s|.

    Returns
    -------
    float [1]
        (a / a_0)^(1/2) = ((1 + sqrt(1 + L/|L_s|)) / 2)^(1/3).
    """
    return cbrt(0.5 * (1.0 + math.sqrt(max(1.0 + load_ratio, 0.0))))


@kernel
def load_of_u(u: float) -> float:
    """Load L / |L_s| at u = (a / a_0)^(1/2), docs/theory.md (5)."""
    u3 = u * u * u
    return 4.0 * (u3 * u3 - u3)


@kernel
def indentation_of_u(u: float) -> float:
    """Indentation delta R_e / a_0^2 at u = (a / a_0)^(1/2), docs/theory.md (6)."""
    return u * (u * u * u - 2.0 / 3.0)


@kernel
def stiffness_of_u(u: float) -> float:
    """Normal stiffness d(L/|L_s|) / d(delta R_e/a_0^2) at u, docs/theory.md (8).

    Negative between pull-off and the fixed-grips limit.
    """
    u3 = u * u * u
    return 18.0 * u * u * (2.0 * u3 - 1.0) / (6.0 * u3 - 1.0)


def contact_radius(load: float, R_e: float, K: float, gamma: float) -> float:
    """JKR contact radius, docs/theory.md (1).

    Parameters
    ----------
    load : float [N]
        Normal load, at least -3 pi R_e gamma.
    R_e, K, gamma : float [m], [Pa], [J/m^2]
        Effective radius, reduced modulus, surface energy (work of adhesion = 2 gamma).

    Returns
    -------
    float [m]

    Raises
    ------
    ValueError
        If the load is below the pull-off load, where no equilibrium exists.
    """
    pull_off = 3.0 * math.pi * R_e * gamma
    if load < -pull_off:
        raise ValueError(f"load = {load:g} N is below the pull-off load {-pull_off:g} N: there is no contact")
    return radius_at_zero_load(R_e, K, gamma) * square(u_of_load(load / pull_off))


def radius_at_zero_load(R_e: float, K: float, gamma: float) -> float:
    """a_0 = (12 pi R_e^2 gamma / K)^(1/3) [m], docs/theory.md (3); the paper prints R_e without the square."""
    return cbrt(12.0 * math.pi * R_e * R_e * gamma / K)


def hertz_radius(load: float, R_e: float, K: float) -> float:
    """Hertz contact radius (R_e L / K)^(1/3) [m] of a load [N] >= 0, docs/theory.md (12): no adhesion.

    Raises
    ------
    ValueError
        If the load is negative.
    """
    if load < 0.0:
        raise ValueError(f"load = {load:g} N pulls: without adhesion there is no contact")
    return cbrt(R_e * load / K)


@kernel
def effective_radius_ratio(h: Any, r: float) -> float:
    """R_e / R = 1 / (1 + kappa r), with kappa the signed mean curvature of the sample, docs/theory.md (17).

    The curvature is taken in coordinates scaled by x_0 and z_0: positive on a hill (the contact is smaller), negative
    in a valley (larger). Valid while 1 + kappa r > 0, checked when parameters are read.

    Parameters
    ----------
    h : record of Surface
    r : float [z0]
        Radius of the tip.
    """
    return 1.0 / (1.0 + h.curvature * r)


@kernel
def radius_ratios(h: Any, r: float) -> tuple[float, float, float, float]:
    """rho = R_e / R as `effective_radius_ratio` gives it, its cube root, and the inverses of both."""
    inverse = 1.0 + h.curvature * r
    third = inverse_cbrt(inverse)
    return 1.0 / inverse, third, inverse, inverse * (third * third)
