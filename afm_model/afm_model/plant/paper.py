"""The paper's six-state plant, its (5): the tip never leaves the sample, the indentation follows the static load.

    (1 + 1/mu) Q'' = U_z + H'' - 2 xi_z eta_z (Q' - H') - (eta_z^2 + eta_c^2/mu) Q
                     + eta_z^2 (H - delta) + (eta_c^2 a - w)/mu
    N = Q'' + eta_c^2 (Q - a) + w

Q is z_c of the paper, measured from the tip apex. delta = delta_JKR(N_static) with N_static = eta_c^2 (Q - a) + w,
its rates dropped. Three treatments of z: computed (above), held at the setpoint (section 4.1 of the paper), or with
the unknown f_z of the error dynamics drawn at random (section 4.2): Q'' is then the control's part plus f_z.
Equations: docs/theory.md (25) to (27), (43).
"""

import math
from typing import Any

from ..contact.jkr import indentation_of_u, u_of_load
from ..contact.surface import effective_radius_ratio, surface
from ..jit import kernel
from .lateral import State, kick_lateral, store_friction
from .state import CONTACT, V_Q, V_X, V_Y, V_Z, N, Q, X, Y, Z

Z_COMPUTED, Z_HELD, Z_UNIFORM = range(3)


@kernel
def friction_of_load(p: Any, rho: float, load: float) -> float:
    """F = F_fs (1 + sqrt(1 + N/|L_s|))^(4/3) [m_p w0^2 x0] at effective radius ratio rho, docs/theory.md (13)."""
    root = math.sqrt(max(1.0 + load / (p.L_s * rho), 0.0))
    return p.f_s * (rho * (1.0 + root)) ** (4.0 / 3.0)


@kernel
def static_load(p: Any, q: float) -> float:
    """Load of a resting cantilever at tip height q [m_c w0^2 z0], docs/theory.md (27)."""
    return p.eta_c * p.eta_c * (q - p.a) + p.w


@kernel
def static_indentation(p: Any, rho: float, load: float) -> float:
    """JKR indentation [z0] under `load` at effective radius ratio rho, docs/theory.md (6), (7)."""
    return p.delta_0 * rho ** (1.0 / 3.0) * indentation_of_u(u_of_load(load / (p.L_s * rho)))


@kernel
def step_paper(s: State, p: Any, u_x: float, u_y: float, u_z: float, treatment: int, f_z: float) -> None:
    """Advance the state by one step h in place, with the scheme of `step_compliant`.

    Parameters
    ----------
    s : ndarray (SIZE,)
    p : record of plant constants
    u_x, u_y, u_z : float
        Drive, held over the step.
    treatment : Z_COMPUTED, Z_HELD or Z_UNIFORM
    f_z : float [w0^2 z0]
        The drawn f_z, used by Z_UNIFORM alone.
    """
    h = p.h
    half = 0.5 * h
    s[X] += half * s[V_X]
    s[Y] += half * s[V_Y]
    s[Q] += half * s[V_Q]
    H, H_X, H_Y = surface(s[X], s[Y], p.beta, p.k_x, p.k_y)
    rho = effective_radius_ratio(H, p.k_x, p.k_y, p.r)
    load = static_load(p, s[Q])
    delta = static_indentation(p, rho, load)

    if treatment == Z_HELD:
        f = friction_of_load(p, rho, load)
        v_x, v_y, f_x, f_y = kick_lateral(s, p, u_x, u_y, f)
        v_q = s[V_Q]
    else:
        # N needs X'' through H'', X'' needs N through friction: friction by the last load first, then once more (43).
        f = friction_of_load(p, rho, s[N])
        v_x, v_y, f_x, f_y = kick_lateral(s, p, u_x, u_y, f)
        v_q = _kick_tip(s, p, H, H_X, H_Y, delta, v_x, v_y, u_z, treatment, f_z)
        load = (v_q - s[V_Q]) / h + static_load(p, s[Q])
        f = friction_of_load(p, rho, load)
        v_x, v_y, f_x, f_y = kick_lateral(s, p, u_x, u_y, f)
        v_q = _kick_tip(s, p, H, H_X, H_Y, delta, v_x, v_y, u_z, treatment, f_z)
        load = (v_q - s[V_Q]) / h + static_load(p, s[Q])

    store_friction(s, f_x, f_y, f)
    s[V_X] = v_x
    s[V_Y] = v_y
    s[V_Q] = v_q
    s[N] = load
    s[CONTACT] = 1.0
    s[X] += half * v_x
    s[Y] += half * v_y
    s[Q] += half * v_q
    place_sample(s, p)


@kernel
def place_sample(s: State, p: Any) -> None:
    """Sample height from docs/theory.md (21), Z = Q - H + delta, and its rate without that of delta."""
    H, H_X, H_Y = surface(s[X], s[Y], p.beta, p.k_x, p.k_y)
    rho = effective_radius_ratio(H, p.k_x, p.k_y, p.r)
    s[Z] = s[Q] - H + static_indentation(p, rho, static_load(p, s[Q]))
    s[V_Z] = s[V_Q] - H_X * s[V_X] - H_Y * s[V_Y]


@kernel
def _kick_tip(
    s: State,
    p: Any,
    H: float,
    H_X: float,
    H_Y: float,
    delta: float,
    v_x: float,
    v_y: float,
    u_z: float,
    treatment: int,
    f_z: float,
) -> float:
    """Rate of Q at the end of the step, docs/theory.md (25) by the scheme of (38)."""
    h = p.h
    inertia = 1.0 + 1.0 / p.mu
    d = h * p.xi_z * p.eta_z / inertia
    force = u_z - (p.eta_z * p.eta_z + p.eta_c * p.eta_c / p.mu) * s[Q]
    if treatment == Z_UNIFORM:
        force += inertia * f_z
    else:
        # H' and H'' along the motion, velocities at mid-step.
        m_x = 0.5 * (s[V_X] + v_x)
        m_y = 0.5 * (s[V_Y] + v_y)
        H_XY = p.beta * p.k_x * p.k_y * math.cos(p.k_x * s[X]) * math.cos(p.k_y * s[Y])
        H_rate = H_X * m_x + H_Y * m_y
        H_rate2 = (
            -H * (p.k_x * p.k_x * m_x * m_x + p.k_y * p.k_y * m_y * m_y)
            + 2.0 * H_XY * m_x * m_y
            + (H_X * (v_x - s[V_X]) + H_Y * (v_y - s[V_Y])) / h
        )
        force += H_rate2 + 2.0 * p.xi_z * p.eta_z * H_rate
        force += p.eta_z * p.eta_z * (H - delta) + (p.eta_c * p.eta_c * p.a - p.w) / p.mu
    return ((1.0 - d) * s[V_Q] + h * force / inertia) / (1.0 + d)
