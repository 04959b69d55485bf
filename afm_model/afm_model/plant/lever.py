"""Plant `lever`: a stiff scanner, a cantilever that bends and twists, a tip that sticks and slides.

The scanner is three damped oscillators, the bending of the cantilever one to three, its torsion one or none; bending
sideways and the higher modes follow the force without delay. Friction acts between tip and sample, set-valued, behind
the lateral stiffness 8 G* a of the contact. Scheme: implicit midpoint rule, the contact solved at mid-step;
docs/lever.md (14) to (23).
"""

import math
from typing import Any

from ..contact.table import table
from ..jit import kernel
from ..parts.header import HEADER
from ..parts.part import Channel, Plant
from ..records import record_at
from ..sample import surface
from .lever_check import check, warnings
from .lever_constants import CONSTANTS, lever_constants, rows
from .lever_contact import hold, indent, place_frame, slide
from .lever_parameters import LeverGroup
from .lever_start import rest
from .lever_state import STATE
from .lever_thermal import agitate


@kernel
def step(v: Any, unused: Any, p: Any, s: Any, m: Any) -> None:
    """Advance the state by one step h in place.

    Parameters
    ----------
    v : record of DRIVE [V]
        Held over the step.
    unused : random numbers
    p, s : records of CONSTANTS and STATE
    m : block of the instrument, for the sample and the table of the contact
    """
    g = record_at(m, 0, HEADER)
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

    # The sample where the tip is expected; a sliding tip goes on as in the step before.
    u_x, u_y = s.U_x + s.S_x, s.U_y + s.S_y
    H = surface(u_x / p.x0, u_y / p.x0, m)
    place_frame(H, p, s, m, g.plant_map)
    slope_x, slope_y = H.slope_x * p.rise, H.slope_y * p.rise
    # Displacement of the sample against the tip, without force.
    d_x, d_y = s.X + half * r_x - tip_x - u_x, s.Y + half * r_y - tip_y - u_y
    d_z = s.Z + half * r_z + H.height * p.z0 - p.a - tip_z
    # From the place that the tip holds on to, along the surface.
    b_x, b_y = d_x + u_x - s.A_x, d_y + u_y - s.A_y
    b_z = d_z - slope_x * (u_x - s.A_x) - slope_y * (u_y - s.A_y)

    flat = slope_x == 0.0 and slope_y == 0.0
    if flat:
        n_x, n_y, n_z, t_x, t_z, o_x, o_y, o_z = 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0
        w_nn, w_n1, w_n2, w_11, w_12, w_22 = p.W_zz, 0.0, p.W_yz, p.W_x, 0.0, p.W_yy
        target, e_1, e_2 = d_z, b_x, b_y
    else:
        # Normal n, tangents t (without y) and o.
        n_z = 1.0 / math.sqrt(1.0 + slope_x * slope_x + slope_y * slope_y)
        n_x, n_y = n_z * slope_x, n_z * slope_y
        t_x = 1.0 / math.sqrt(1.0 + slope_x * slope_x)
        t_z = -t_x * slope_x
        o_x, o_y, o_z = n_y * t_z, n_z * t_x - n_x * t_z, -n_y * t_x
        W_x, W_yy, W_yz, W_zz = p.W_x, p.W_yy, p.W_yz, p.W_zz
        wn_x, wn_y, wn_z = W_x * n_x, W_yy * n_y + W_yz * n_z, W_yz * n_y + W_zz * n_z
        wt_x, wt_y, wt_z = W_x * t_x, W_yz * t_z, W_zz * t_z
        w_nn = n_x * wn_x + n_y * wn_y + n_z * wn_z
        w_n1 = t_x * wn_x + t_z * wn_z
        w_n2 = o_x * wn_x + o_y * wn_y + o_z * wn_z
        w_11 = t_x * wt_x + t_z * wt_z
        w_12 = o_x * wt_x + o_y * wt_y + o_z * wt_z
        w_22 = o_x * o_x * W_x + o_y * (o_y * W_yy + o_z * W_yz) + o_z * (o_y * W_yz + o_z * W_zz)
        target = n_x * d_x + n_y * d_y + n_z * d_z
        e_1 = t_x * b_x + t_z * b_z
        e_2 = o_x * b_x + o_y * b_y + o_z * b_z

    # The tip holds on if friction can take what that needs; else it slides, friction being at its bound. First what it
    # did in the last step.
    at = g.plant_map
    delta, N, bound, a = s.delta, s.N, s.F_max, s.a
    k = p.stiffness_per_radius * a
    d_1, d_2 = s.d_1, s.d_2
    T_1 = T_2 = 0.0
    stick = True
    slid = s.stuck == 0.0 and a > 0.0
    if slid:
        delta, N, bound, a, d_1, d_2 = slide(
            delta, d_1, d_2, target, e_1, e_2, w_nn, w_n1, w_n2, w_11, w_12, w_22, s, p, m, at
        )
        T_1, T_2 = bound * d_1, bound * d_2
        # How far it slid, times the contact's stiffness.
        way = d_1 * (e_1 - w_n1 * N - w_11 * T_1 - w_12 * T_2) + d_2 * (e_2 - w_n2 * N - w_12 * T_1 - w_22 * T_2)
        stick = p.stiffness_per_radius * a * way < bound
    if stick:
        # What the load does to the tangential force comes back as compliance.
        c_1, c_2 = hold(w_n1, w_n2, k, w_11, w_12, w_22)
        T_1, T_2 = hold(e_1, e_2, k, w_11, w_12, w_22)
        w_n = w_nn - w_n1 * c_1 - w_n2 * c_2
        delta, N, bound, a = indent(s.delta, target - w_n1 * T_1 - w_n2 * T_2, w_n, 0.0, s, p, m, at)
        T_1 -= c_1 * N
        T_2 -= c_2 * N
        size = math.sqrt(T_1 * T_1 + T_2 * T_2)
        if size > bound:
            stick = False
            d_1, d_2 = T_1 / size, T_2 / size
            if not slid and a > 0.0:
                delta, N, bound, a, d_1, d_2 = slide(
                    delta, d_1, d_2, target, e_1, e_2, w_nn, w_n1, w_n2, w_11, w_12, w_22, s, p, m, at
                )
            T_1, T_2 = bound * d_1, bound * d_2
    s.d_1, s.d_2 = d_1, d_2

    # Force of the sample on the tip, in the laboratory; where the tip is now on the sample.
    s.T_x, s.T_y = T_1 * t_x + T_2 * o_x, T_2 * o_y
    F_x = N * n_x + s.T_x
    F_y = N * n_y + s.T_y
    F_z = N * n_z + T_1 * t_z + T_2 * o_z
    u_x += d_x - p.W_x * F_x - delta * n_x
    u_y += d_y - p.W_yy * F_y - p.W_yz * F_z - delta * n_y
    in_contact = a > 0.0
    s.stuck = 1.0 if stick and in_contact else 0.0
    if s.stuck != 0.0:
        s.S_x = s.S_y = 0.0
    else:
        s.S_x, s.S_y = (u_x - s.U_x, u_y - s.U_y)
        s.A_x, s.A_y = u_x, u_y
        if in_contact:
            s.A_x -= s.T_x / (p.stiffness_per_radius * a)
            s.A_y -= s.T_y / (p.stiffness_per_radius * a)
    s.U_x, s.U_y, s.delta, s.a, s.N, s.F_max = u_x, u_y, delta, a, N, bound
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
def show(p: Any, s: Any, h: float) -> None:
    """What follows without delay: where the tip is, what the photodiode shows; rates over a step of length h."""
    tip = p.mode_z[0] * s.q[0] + p.mode_z[1] * s.q[1] + p.mode_z[2] * s.q[2] + p.rest_yz * s.F_y + p.rest_zz * s.F_z
    s.tip_rate = (tip - s.tip) / h
    s.tip = tip
    s.shown = p.mode_shown[0] * s.q[0] + p.mode_shown[1] * s.q[1] + p.mode_shown[2] * s.q[2]
    s.shown += p.shown_y * s.F_y + p.shown_z * s.F_z
    s.twist = s.phi + p.twist_x * s.F_x


@kernel
def observe(p: Any, s: Any, o: Any) -> None:
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
    constants=CONSTANTS,
    state=STATE,
    values=lever_constants,
    check=check,
    rest=rest,
    step=step,
    observe=observe,
    map=lambda parameters: table(parameters.plant.contact, rows(parameters)),
    sample_in_si=True,
    warnings=warnings,
    channels=(
        Channel("truth/lateral_force", "N", "F_x"),
        Channel("truth/torsion", "rad", "twist"),
        Channel("truth/place_x", "m", "U_x"),
        Channel("truth/place_y", "m", "U_y"),
        Channel("truth/indentation", "m", "delta"),
        Channel("truth/contact_radius", "m", "a"),
    ),
)
