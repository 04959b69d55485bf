"""Friction of the contact: its largest value, and the impulse that stays within its disc."""

import math

from ..compiled.jit import kernel
from ..core.elementary import cbrt, square

_AREA = square(cbrt(4.0))
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
    area = rho * (1.0 + math.sqrt(max(1.0 + load_ratio, 0.0)))
    return f_s * area * cbrt(area)


STICK = True
SLIP = False


@kernel
def project_disc(x: float, y: float, radius: float) -> tuple[float, float, bool]:
    """Nearest point to (x, y) in the disc of `radius` >= 0 about the origin.

    Returns
    -------
    (x, y, inside) : floats in the unit of the input, bool
        `inside` is True when the point was in the closed disc already (the stick branch).
    """
    # Squares are cheap and safe here; the quotient counts only outside, where size > radius >= 0.
    size2 = x * x + y * y
    if size2 <= radius * radius:
        return x, y, STICK
    inverse = 1.0 / math.sqrt(size2)
    return (x * inverse) * radius, (y * inverse) * radius, SLIP


@kernel
def friction_impulse(
    p_x: float, p_y: float, v_x: float, v_y: float, n_x: float, n_y: float, radius: float
) -> tuple[float, float, bool]:
    """Friction impulse over one step of the midpoint scheme, docs/theory.md (39), (40).

    Parameters
    ----------
    p_x, p_y : float
        Momentum at the end of the step if there were no friction.
    v_x, v_y : float
        Velocity at the start of the step.
    n_x, n_y : float
        Velocity per momentum: the velocity at the end is (p - impulse) n.
    radius : float
        h f, the largest impulse.

    Returns
    -------
    (j_x, j_y, stick) : floats, bool
        Stick: the impulse equals p, the velocity at the end is exactly zero. Well inside slip the impulse lies along
        the velocity at mid-step, which is of second order; near rest it is the projection, which is of first
        order and never reverses the motion.
    """
    j_x, j_y, stick = project_disc(p_x, p_y, radius)
    if stick:
        return j_x, j_y, stick
    w_x = v_x + (p_x - j_x) * n_x
    w_y = v_y + (p_y - j_y) * n_y
    mid2 = w_x * w_x + w_y * w_y
    along = v_x * p_x + v_y * p_y
    # Well inside slip: the velocity did not turn by more than a right angle, friction cannot stop it in the step, and
    # along the velocity at mid-step it does not push beyond rest.
    if along > 0.0 and mid2 > 16.0 * radius * radius:
        size = math.sqrt(mid2)
        if w_x * p_x + w_y * p_y >= radius * size:
            # 1 / size, without a root before the quotient.
            scale = (radius / mid2) * size
            return w_x * scale, w_y * scale, stick
    return j_x, j_y, stick
