"""The default plant: scanner (X, Y, Z), cantilever (Q) and a compliant JKR contact that can be lost and made.

X'' = U_x - eta_x^2 X - 2 xi_x eta_x X' - f d_x           (Y alike)
Z'' = U_z - eta_z^2 Z - 2 xi_z eta_z Z' - N/mu
Q'' = N - w - eta_c^2 (Q - a) - 2 xi_c eta_c Q'
delta = Z + H(X, Y) - Q
N = N_JKR(delta, R_e) + 2 zeta_n sqrt(dN/d delta) delta'  in contact, else 0

Equations and scheme: docs/theory.md (22) to (24), (37) to (42).
"""

import math
from typing import Any

from ..contact.jkr import INDENTATION_FIXED_GRIPS, load_of_u, stiffness_of_u, u_of_indentation
from ..contact.surface import effective_radius_ratio, surface
from ..jit import kernel
from .lateral import State, kick_lateral, store_friction
from .state import CONTACT, V_Q, V_X, V_Y, V_Z, N, Q, X, Y, Z

_AREA = 4.0 ** (2.0 / 3.0)
"""Contact area at zero load over that at pull-off."""


@kernel
def step_compliant(s: State, p: Any, u_x: float, u_y: float, u_z: float) -> None:
    """Advance the state by one step h in place: half drift, kick at mid-step, half drift (second order in slip).

    Parameters
    ----------
    s : ndarray (SIZE,)
    p : record of plant constants
    u_x, u_y, u_z : float [w0^2 x0], [w0^2 x0], [w0^2 z0]
        Drive, held over the step.
    """
    h = p.h
    half = 0.5 * h
    s[X] += half * s[V_X]
    s[Y] += half * s[V_Y]
    s[Z] += half * s[V_Z]
    s[Q] += half * s[V_Q]

    # Contact at mid-step: snap-in when the surfaces meet, snap-off at the fixed-grips limit.
    H, H_X, H_Y = surface(s[X], s[Y], p.beta, p.k_x, p.k_y)
    rho = effective_radius_ratio(H, p.k_x, p.k_y, p.r)
    rho_third = rho ** (1.0 / 3.0)
    delta = s[Z] + H - s[Q]
    d = delta / (p.delta_0 * rho_third)
    touching = delta >= 0.0 or (s[CONTACT] != 0.0 and d > INDENTATION_FIXED_GRIPS)
    s[CONTACT] = 1.0 if touching else 0.0
    n_elastic = 0.0
    dashpot = 0.0
    f = 0.0
    if touching:
        u = u_of_indentation(d)
        n_elastic = p.L_s * rho * load_of_u(u)
        stiffness = p.L_s * rho * stiffness_of_u(u) / (p.delta_0 * rho_third)
        dashpot = 2.0 * p.zeta_n * math.sqrt(max(stiffness, 0.0))
        u2 = u * u
        f = p.f_s * _AREA * rho * rho_third * u2 * u2

    # Lateral kick, then the vertical one with the contact dashpot implicit.
    v_x, v_y, f_x, f_y = kick_lateral(s, p, u_x, u_y, f)
    store_friction(s, f_x, f_y, f)
    d_z = h * p.xi_z * p.eta_z
    d_c = h * p.xi_c * p.eta_c
    v_z = ((1.0 - d_z) * s[V_Z] + h * (u_z - p.eta_z * p.eta_z * s[Z] - n_elastic / p.mu)) / (1.0 + d_z)
    v_q = ((1.0 - d_c) * s[V_Q] + h * (n_elastic - p.w - p.eta_c * p.eta_c * (s[Q] - p.a))) / (1.0 + d_c)
    g_z = h * dashpot / (p.mu * (1.0 + d_z))
    g_q = h * dashpot / (1.0 + d_c)
    H_rate = 0.5 * (H_X * (s[V_X] + v_x) + H_Y * (s[V_Y] + v_y))
    delta_rate = (0.5 * (s[V_Z] + v_z - s[V_Q] - v_q) + H_rate) / (1.0 + 0.5 * (g_z + g_q))
    s[V_X] = v_x
    s[V_Y] = v_y
    s[V_Z] = v_z - g_z * delta_rate
    s[V_Q] = v_q + g_q * delta_rate
    s[N] = n_elastic + dashpot * delta_rate

    s[X] += half * s[V_X]
    s[Y] += half * s[V_Y]
    s[Z] += half * s[V_Z]
    s[Q] += half * s[V_Q]
