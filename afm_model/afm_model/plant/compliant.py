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

from ..compiled.jit import kernel
from ..compiled.records import Block
from ..contact.friction import bound_of_area
from ..contact.jkr import INDENTATION_FIXED_GRIPS, load_of_u, radius_ratios, stiffness_of_u, u_of_indentation
from ..parts.dispatch import surface
from ..parts.part import SPRING, Plant, Tree
from ..parts.signals import Actuation
from .constants import Constants, observe, plant_constants
from .initial import rest, start_free
from .lateral import kick_lateral, store_friction
from .parameters import PlantGroup
from .state import State
from .steps import require_contact_at_rest, require_resolved_step


@kernel
def step(t: float, v: Actuation, unused: Block, p: Constants, s: State, m: Block) -> None:
    """Advance the state by one step h in place: half drift, kick at mid-step, half drift (second order in slip).

    Parameters
    ----------
    t : float [s]
        At the begin of the step.
    v : record of Actuation
        Its drive [V] counts; an excitation does not.
        Held over the step.
    unused : random numbers
    p, s : records of Constants and State
    m : block of the instrument, for the sample
    """
    u_x = p.gain_x * v.voltage[0]
    u_y = p.gain_y * v.voltage[1]
    u_z = p.gain_z * v.voltage[2]
    h = p.h
    half = 0.5 * h
    s.X += half * s.V_X
    s.Y += half * s.V_Y
    s.Z += half * s.V_Z
    s.Q += half * s.V_Q

    # Contact at mid-step: snap-in when the surfaces meet, snap-off at the fixed-grips limit.
    H = surface(s.X, s.Y, m)
    H_X, H_Y = H.slope_x, H.slope_y
    rho, rho_third, _, inverse_third = radius_ratios(H, p.r)
    delta = s.Z + H.height - s.Q
    d = (delta * p.inverse_delta_0) * inverse_third
    touching = delta >= 0.0 or (s.contact != 0.0 and d > INDENTATION_FIXED_GRIPS)
    s.contact = 1.0 if touching else 0.0
    n_elastic = 0.0
    dashpot = 0.0
    f = 0.0
    if touching:
        u = u_of_indentation(d)
        pull_off = p.L_s * rho
        n_elastic = pull_off * load_of_u(u)
        stiffness = (pull_off * (p.inverse_delta_0 * inverse_third)) * stiffness_of_u(u)
        dashpot = 2.0 * p.zeta_n * math.sqrt(max(stiffness, 0.0))
        f = bound_of_area(p.f_s * H.strength, rho, rho_third, u)

    # Lateral kick, then the vertical one with the contact dashpot implicit.
    v_x, v_y, f_x, f_y = kick_lateral(s, p, u_x, u_y, f)
    store_friction(s, f_x, f_y, f)
    v_z = (p.keep_z * s.V_Z + h * ((u_z - p.spring_z * s.Z) - n_elastic * p.inverse_mu)) * p.take_z
    v_q = (p.keep_c * s.V_Q + h * (n_elastic - (p.w + p.spring_c * (s.Q - p.a)))) * p.take_c
    g_z = (h * (p.inverse_mu * p.take_z)) * dashpot
    g_q = (h * p.take_c) * dashpot
    H_rate = 0.5 * (H_X * (s.V_X + v_x) + H_Y * (s.V_Y + v_y))
    delta_rate = (0.5 * (s.V_Z + v_z - s.V_Q - v_q) + H_rate) * (1.0 / (1.0 + 0.5 * (g_z + g_q)))
    s.V_X = v_x
    s.V_Y = v_y
    s.V_Z = v_z - g_z * delta_rate
    s.V_Q = v_q + g_q * delta_rate
    s.N = n_elastic + dashpot * delta_rate

    s.X += half * s.V_X
    s.Y += half * s.V_Y
    s.Z += half * s.V_Z
    s.Q += half * s.V_Q


def _check(parameters: Tree) -> None:
    if parameters.plant.gap == 0.0:
        require_contact_at_rest(parameters)
    require_resolved_step(parameters, with_contact=True)


def _rest(parameters: Tree, p: Any, s: Any, m: Any) -> tuple[float, float, float]:
    if parameters.plant.gap > 0.0:
        return start_free(parameters, p, s, m)
    return rest(parameters, p, s, m)


COMPLIANT = Plant(
    name="compliant",
    parameters=PlantGroup,
    constants=Constants,
    state=State,
    values=plant_constants,
    check=_check,
    rest=_rest,
    step=step,
    observe=observe,
    contact=SPRING,
    lanes=True,
)
