"""Largest friction of an adhesive contact: shear strength times contact area, docs/theory.md (13), (14).

The same law twice, by what a plant knows of its contact: the area from the indentation, or the load.
"""

import math

from ..core.jit import kernel

_AREA = 4.0 ** (2.0 / 3.0)
"""Contact area at zero load over that at pull-off."""


@kernel
def bound_of_area(f_s: float, rho: float, rho_third: float, u: float) -> float:
    """F_max at u = (a / a_0)^(1/2), docs/theory.md (14).

    f_s is that at pull-off on a flat sample, rho the effective radius ratio.
    """
    u2 = u * u
    return f_s * _AREA * rho * rho_third * u2 * u2


@kernel
def bound_of_load(f_s: float, rho: float, load_ratio: float) -> float:
    """F_max = f_s (rho (1 + sqrt(1 + N/|L_s|)))^(4/3), docs/theory.md (13).

    load_ratio is that of the load N to the pull-off load |L_s| at this radius.
    """
    root = math.sqrt(max(1.0 + load_ratio, 0.0))
    return f_s * (rho * (1.0 + root)) ** (4.0 / 3.0)
