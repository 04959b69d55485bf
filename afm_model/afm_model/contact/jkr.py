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

from ..core.elementary import cbrt, square
from ..core.jit import kernel

U_FIXED_GRIPS = cbrt(1.0 / 6.0)
"""u at which the contact breaks when the displacement is held (fixed grips), docs/theory.md (9)."""

INDENTATION_FIXED_GRIPS = -0.5 * U_FIXED_GRIPS
"""delta R_e / a_0^2 at which the contact breaks when the displacement is held: -0.2752."""


@kernel
def u_of_indentation(d: float) -> float:
    """Root u >= (1/6)^(1/3) of u^4 - (2/3) u = d, in closed form (Ferrari, docs/theory.md (11)) with one Newton step
    for round-off.

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
    # Resolvent cubic m^3 + d m - 1/18 = 0, one positive real root on this branch.
    discriminant = max(1.0 / 1296.0 + d * d * d / 27.0, 0.0)
    c = cbrt(1.0 / 36.0 + math.sqrt(discriminant))
    m = c - d / (3.0 * c)
    root = math.sqrt(2.0 * m)
    u = 0.5 * (root + math.sqrt(max(4.0 / (3.0 * root) - 2.0 * m, 0.0)))
    if d > 1e4:
        # Far beyond any real contact the closed form cancels; there this is within 1e-7.
        u = math.sqrt(math.sqrt(d)) + 1.0 / (6.0 * math.sqrt(d))
    slope = 4.0 * u * u * u - 2.0 / 3.0
    # At the fold the slope vanishes and the closed form is already exact.
    if slope > 1e-6:
        u -= (u * (u * u * u - 2.0 / 3.0) - d) / slope
    return u


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
