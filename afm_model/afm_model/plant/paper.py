"""The paper's six-state plant, its (5): the tip never leaves the sample, the indentation follows the static load.

    (1 + 1/mu) Q'' = U_z + H'' - 2 xi_z eta_z (Q' - H') - (eta_z^2 + eta_c^2/mu) Q
                     + eta_z^2 (H - delta) + (eta_c^2 a - w)/mu
    N = Q'' + eta_c^2 (Q - a) + w

Q is z_c of the paper, measured from the tip apex. delta = delta_JKR(N_static) with N_static = eta_c^2 (Q - a) + w,
its rates dropped. Three treatments of z: computed (above), held at the setpoint (section 4.1 of the paper), or with
the unknown f_z of the error dynamics drawn at random (section 4.2): Q'' is then the control's part plus f_z.
Equations: docs/theory.md (25) to (27), (43).
"""

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import kernel
from ..compiled.records import Block
from ..contact.friction import bound_of_load
from ..contact.jkr import radius_ratios
from ..core.random_numbers import RandomStream
from ..parts.dispatch import surface
from ..parts.part import RIGID, Numbers, Plant, Tree
from ..parts.signals import Actuation, Surface
from .constants import Constants, observe, plant_constants
from .initial import rest
from .lateral import kick_lateral, store_friction
from .parameters import PlantGroup
from .state import State
from .statics import place_sample, static_indentation, static_load
from .steps import require_contact_at_rest, require_resolved_step

Z_COMPUTED, Z_HELD, Z_UNIFORM = range(3)
TREATMENTS = {"computed": Z_COMPUTED, "held": Z_HELD, "uniform": Z_UNIFORM}


@kernel
def step(t: float, v: Actuation, r: Block, p: Constants, s: State, m: Block) -> None:
    """Advance the state by one step h in place, with the scheme of the compliant plant.

    Parameters
    ----------
    t : float [s]
        At the begin of the step.
    v : record of Actuation
        Its drive [V] counts; an excitation does not.
        Held over the step.
    r : pointer
        The drawn f_z [w0^2 z0], used by Z_UNIFORM alone.
    p, s : records of Constants and State
    m : block of the instrument, for the sample
    """
    u_x = p.gain_x * v.voltage[0]
    u_y = p.gain_y * v.voltage[1]
    u_z = p.gain_z * v.voltage[2]
    f_z = r[0]
    h = p.h
    half = 0.5 * h
    s.X += half * s.V_X
    s.Y += half * s.V_Y
    s.Q += half * s.V_Q
    H = surface(s.X, s.Y, m)
    rho, third, inverse, _ = radius_ratios(H, p.r)
    per_load = p.inverse_L_s * inverse
    strength = p.f_s * H.strength
    load = static_load(p, s.Q)
    delta = static_indentation(p, third, load * per_load)

    if p.treatment == Z_HELD:
        f = bound_of_load(strength, rho, load * per_load)
        v_x, v_y, f_x, f_y = kick_lateral(s, p, u_x, u_y, f)
        v_q = s.V_Q
    else:
        # N needs X'' through H'', X'' needs N through friction: friction by the last load first, then once more (43).
        f = bound_of_load(strength, rho, s.N * per_load)
        v_x, v_y, f_x, f_y = kick_lateral(s, p, u_x, u_y, f)
        v_q = _kick_tip(s, p, H, delta, v_x, v_y, u_z, f_z)
        load = (v_q - s.V_Q) * p.inverse_h + static_load(p, s.Q)
        f = bound_of_load(strength, rho, load * per_load)
        v_x, v_y, f_x, f_y = kick_lateral(s, p, u_x, u_y, f)
        v_q = _kick_tip(s, p, H, delta, v_x, v_y, u_z, f_z)
        load = (v_q - s.V_Q) * p.inverse_h + static_load(p, s.Q)

    store_friction(s, f_x, f_y, f)
    s.V_X = v_x
    s.V_Y = v_y
    s.V_Q = v_q
    s.N = load
    s.contact = 1.0
    s.X += half * v_x
    s.Y += half * v_y
    s.Q += half * v_q
    place_sample(s, p, m)


@kernel
def _kick_tip(
    s: State, p: Constants, H: Surface, delta: float, v_x: float, v_y: float, u_z: float, f_z: float
) -> float:
    """Rate of Q at the end of the step, docs/theory.md (25) by the scheme of (38)."""
    h = p.h
    inertia = 1.0 + p.inverse_mu
    d = h * p.xi_z * p.eta_z
    force = u_z - (p.spring_z + p.spring_c * p.inverse_mu) * s.Q
    if p.treatment == Z_UNIFORM:
        force += inertia * f_z
    else:
        # H' and H'' along the motion, velocities at mid-step.
        m_x = 0.5 * (s.V_X + v_x)
        m_y = 0.5 * (s.V_Y + v_y)
        H_rate = H.slope_x * m_x + H.slope_y * m_y
        H_rate2 = (
            H.curvature_xx * m_x * m_x
            + H.curvature_yy * m_y * m_y
            + 2.0 * H.curvature_xy * m_x * m_y
            + (H.slope_x * (v_x - s.V_X) + H.slope_y * (v_y - s.V_Y)) * p.inverse_h
        )
        force += H_rate2 + 2.0 * p.xi_z * p.eta_z * H_rate
        force += p.spring_z * (H.height - delta) + (p.spring_c * p.a - p.w) * p.inverse_mu
    return ((inertia - d) * s.V_Q + h * force) * (1.0 / (inertia + d))


def _values(parameters: Tree) -> Numbers:
    plant = parameters.plant
    return plant_constants(parameters, TREATMENTS[plant.z])


def _draw(parameters: Tree, generator: RandomStream, ticks: int) -> NDArray[np.float64] | None:
    """f_z of section 4.2 of the paper."""
    plant = parameters.plant
    return plant.M_z * (2.0 * generator.random((ticks, 1)) - 1.0) if plant.z == "uniform" else None


def _check(parameters: Tree) -> None:
    if parameters.plant.gap > 0.0:
        raise ValueError(f"plant.gap = {parameters.plant.gap:g} m is not allowed: for the paper's plant it must be 0 m")
    require_contact_at_rest(parameters)
    require_resolved_step(parameters, with_contact=False)


PAPER = Plant(
    name="paper",
    parameters=PlantGroup,
    constants=Constants,
    state=State,
    values=_values,
    check=_check,
    draws=1,
    draw=_draw,
    rest=rest,
    step=step,
    observe=observe,
    contact=RIGID,
    lanes=True,
    common=lambda p: {"treatment": p.treatment},
)
