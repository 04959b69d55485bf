"""Plant `lever`: a stiff scanner, a cantilever that bends and twists, a tip that sticks and slides.

The scanner is three damped oscillators, the bending of the cantilever one to three, its torsion one or none; bending
sideways and the higher modes follow the force without delay. Friction acts between tip and sample, set-valued, behind
the lateral stiffness 8 G* a of the contact; on a sample of atoms the tip moves in their potential instead. Scheme:
implicit midpoint rule, the contact solved at mid-step; docs/lever.md (14) to (23).
"""

from ..contact.contact_table import table
from ..core.jit import kernel
from ..core.records import Block, record_at
from ..parts.header import BlockHeader
from ..parts.part import Channel, Plant
from ..parts.signals import Drive, Truth
from .lever_check import check, warnings
from .lever_constants import Constants, lever_constants, rows
from .lever_friction import on_surface
from .lever_lattice import on_lattice
from .lever_parameters import LeverGroup
from .lever_start import rest
from .lever_state import State
from .lever_thermal import agitate


@kernel
def step(v: Drive, unused: Block, p: Constants, s: State, m: Block) -> None:
    """Advance the state by one step h in place.

    Parameters
    ----------
    v : record of Drive [V]
        Held over the step.
    unused : random numbers
    p, s : records of Constants and State
    m : block of the instrument, for the sample and the table of the contact
    """
    g = record_at(m, 0, BlockHeader)
    half = p.half

    # Rates at mid-step if the tip felt no force, docs/lever.md (15); positions there.
    r_x = (s.V_X + half * p.w2[0] * (p.metres[0] * v.voltage[0] - s.X)) * p.inverse[0]
    r_y = (s.V_Y + half * p.w2[1] * (p.metres[1] * v.voltage[1] - s.Y)) * p.inverse[1]
    r_z = (s.V_Z + half * p.w2[2] * (p.metres[2] * v.voltage[2] - s.Z)) * p.inverse[2]
    v_0 = (s.v[0] - half * p.mode_w2[0] * s.q[0]) * p.mode_inverse[0]
    v_1 = (s.v[1] - half * p.mode_w2[1] * s.q[1]) * p.mode_inverse[1]
    v_2 = (s.v[2] - half * p.mode_w2[2] * s.q[2]) * p.mode_inverse[2]
    v_phi = (s.v_phi - half * p.twist_w2 * s.phi) * p.twist_inverse
    v_0, v_1, v_2, v_phi = agitate(v_0, v_1, v_2, v_phi, p, s)
    q_0, q_1, q_2 = s.q[0] + half * v_0, s.q[1] + half * v_1, s.q[2] + half * v_2
    tip_x = p.arm * (s.phi + half * v_phi)
    tip_y = p.mode_y[0] * q_0 + p.mode_y[1] * q_1 + p.mode_y[2] * q_2
    tip_z = p.mode_z[0] * q_0 + p.mode_z[1] * q_1 + p.mode_z[2] * q_2

    # Force of the sample on the tip, from where the tip would be on the sample without it.
    P_x, P_y, P_z = s.X + half * r_x - tip_x, s.Y + half * r_y - tip_y, s.Z + half * r_z
    if p.lattice != 0.0:
        F_x, F_y, F_z = on_lattice(P_x, P_y, P_z - p.a - tip_z, p, s, m, g.plant_map)
        s.T_x, s.T_y = F_x, F_y
    else:
        F_x, F_y, F_z = on_surface(P_x, P_y, P_z, tip_z, p, s, m, g.plant_map)
    s.F_x, s.F_y, s.F_z = F_x, F_y, F_z

    # The whole step at the rates of its middle.
    r_x -= p.push[0] * F_x
    r_y -= p.push[1] * F_y
    r_z -= p.push[2] * F_z
    v_0 += p.mode_push[0] * (p.mode_y[0] * F_y + p.mode_z[0] * F_z)
    v_1 += p.mode_push[1] * (p.mode_y[1] * F_y + p.mode_z[1] * F_z)
    v_2 += p.mode_push[2] * (p.mode_y[2] * F_y + p.mode_z[2] * F_z)
    v_phi += p.twist_push * F_x
    h = p.h
    s.X += h * r_x
    s.Y += h * r_y
    s.Z += h * r_z
    s.V_X, s.V_Y, s.V_Z = 2.0 * r_x - s.V_X, 2.0 * r_y - s.V_Y, 2.0 * r_z - s.V_Z
    s.q[0] += h * v_0
    s.q[1] += h * v_1
    s.q[2] += h * v_2
    s.v[0], s.v[1], s.v[2] = 2.0 * v_0 - s.v[0], 2.0 * v_1 - s.v[1], 2.0 * v_2 - s.v[2]
    s.phi += h * v_phi
    s.v_phi = 2.0 * v_phi - s.v_phi
    s.steps += 1.0
    show(p, s, h)


@kernel
def show(p: Constants, s: State, h: float) -> None:
    """What follows without delay: where the tip is, what the photodiode shows; rates over a step of length h."""
    tip = p.mode_z[0] * s.q[0] + p.mode_z[1] * s.q[1] + p.mode_z[2] * s.q[2] + p.rest_yz * s.F_y + p.rest_zz * s.F_z
    s.tip_rate = (tip - s.tip) / h
    s.tip = tip
    s.shown = p.mode_shown[0] * s.q[0] + p.mode_shown[1] * s.q[1] + p.mode_shown[2] * s.q[2]
    s.shown += p.shown_y * s.F_y + p.shown_z * s.F_z
    s.twist = s.phi + p.twist_x * s.F_x


@kernel
def observe(p: Constants, s: State, o: Truth) -> None:
    """See `afm_model.parts.Plant`. `friction` is the part of the force that lies in the surface."""
    o.position[0], o.position[1], o.position[2] = s.X, s.Y, s.Z
    o.velocity[0], o.velocity[1], o.velocity[2] = s.V_X, s.V_Y, s.V_Z
    o.tip_height = p.a + s.tip
    o.tip_rate = s.tip_rate
    o.friction[0], o.friction[1] = s.T_x, s.T_y
    o.friction_bound = s.F_max
    o.normal_force = s.N
    o.contact = 1.0 if s.a > 0.0 else 0.0
    o.stuck = s.stuck
    o.deflection_excess = s.shown - s.tip
    o.lateral_excess = p.force_per_twist * s.twist - s.T_x


LEVER = Plant(
    name="lever",
    parameters=LeverGroup,
    constants=Constants,
    state=State,
    values=lever_constants,
    check=check,
    rest=rest,
    step=step,
    observe=observe,
    map=lambda parameters: table(parameters.plant.contact, rows(parameters)),
    sample_in_si=True,
    takes_lattice=True,
    warnings=warnings,
    channels=(
        Channel("truth/lateral_force", "N", "F_x"),
        Channel("truth/torsion", "rad", "twist"),
        Channel("truth/place_x", "m", "U_x"),
        Channel("truth/place_y", "m", "U_y"),
        Channel("truth/apex_x", "m", "A_x"),
        Channel("truth/apex_y", "m", "A_y"),
        Channel("truth/indentation", "m", "delta"),
        Channel("truth/contact_radius", "m", "a"),
    ),
)
