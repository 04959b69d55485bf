"""The tip of the plant `lever` on a smooth sample: it sticks, or slides with friction at its bound.

Equations: docs/lever.md (16) to (23), (47) to (50).
"""

import math

from ...compiled.jit import kernel
from ...compiled.records import Block
from ...compiled.ways import kept
from ...core.random_numbers import normal as standard_normal
from ...parts.dispatch import surface
from .balance import balance
from .constants import Constants
from .contact import place_frame
from .end import show_end
from .slide import Apart, way_slid
from .state import Ledger, State, ledger_of


@kernel
def on_surface(
    P_x: float,
    P_y: float,
    P_z: float,
    tip_z: float,
    D_x: float,
    D_y: float,
    D_z: float,
    p: Constants,
    s: State,
    m: Block,
    at: int,
) -> tuple[float, float, float]:
    """Force of the sample on the tip at mid-step; writes what the contact has come to into the state s.

    Parameters
    ----------
    P_x, P_y : floats [m]
        Place of the tip on the sample at mid-step, if it felt no force.
    P_z, tip_z : floats [m]
        Height of the scanner and deflection of the tip there, if it felt no force.
    D_x, D_y, D_z : floats [m]
        Path of the sample against the tip in the second half of the step, if it felt no force.
    p, s : records of Constants and State
    m, at : block of the instrument, where the table of the contact begins

    Returns
    -------
    (F_x, F_y, F_z) : floats [N]
    """
    # The sample where the tip is expected; a sliding tip goes on as in the step before.
    u_x, u_y = s.U_x + s.S_x, s.U_y + s.S_y
    H = surface(u_x / p.x0, u_y / p.x0, m)
    place_frame(H, p, s, m, at)
    slope_x, slope_y = H.slope_x * p.rise, H.slope_y * p.rise
    shear = p.stiffness_per_radius * H.modulus
    # Displacement of the sample against the tip, without force.
    d_x, d_y = P_x - u_x, P_y - u_y
    d_z = P_z + H.height * p.z0 - p.a - tip_z
    # From the place that the tip holds on to, along the surface.
    b_x, b_y = d_x + u_x - s.A_x, d_y + u_y - s.A_y
    b_z = d_z - slope_x * (u_x - s.A_x) - slope_y * (u_y - s.A_y)

    # Of what the sample tells: on one that is flat everywhere the compiler leaves the other way out.
    flat = H.slope_x == 0.0 and H.slope_y == 0.0
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

    if p.viscosity != 0.0:
        at_rate(n_x, n_y, n_z, target, w_nn, D_x, D_y, D_z, p, s, m)

    c = Apart(target, e_1, e_2, w_nn, w_n1, w_n2, w_11, w_12, w_22, shear)
    (delta, N, bound, a, d_1, d_2, stiffness, growth), T_1, T_2, stick = balance(c, s, p, m, at)

    # Force of the sample on the tip, in the laboratory; where the tip is now on the sample.
    n = kept(s, m)
    T_x, T_y = T_1 * t_x + T_2 * o_x, T_2 * o_y
    F_x = N * n_x + T_x
    F_y = N * n_y + T_y
    F_z = N * n_z + T_1 * t_z + T_2 * o_z
    u_x += d_x - p.W_x * F_x - delta * n_x
    u_y += d_y - p.W_yy * F_y - p.W_yz * F_z - delta * n_y
    stuck, sliding = stick and a > 0.0, not stick and a > 0.0
    n.A_x = s.A_x if stuck else u_x - T_x / (shear * a) if sliding else u_x
    n.A_y = s.A_y if stuck else u_y - T_y / (shear * a) if sliding else u_y
    n.S_x, n.S_y = 0.0 if stuck else u_x - s.U_x, 0.0 if stuck else u_y - s.U_y
    # How far it slid, force times that.
    way = way_slid(N, T_1, T_2, d_1, d_2, c)
    own = kept(ledger_of(m), m)
    own.rubbed += bound * (way - bound / (shear * a)) if sliding else 0.0
    own.stiffness, own.growth = stiffness, growth
    n.stuck = 1.0 if stuck else 0.0
    n.d_1, n.d_2, n.T_x, n.T_y = d_1, d_2, T_x, T_y
    deeper = delta - s.delta
    n.U_x, n.U_y, n.delta, n.a, n.N, n.F_max = u_x, u_y, delta, a, N, bound
    n.F_x, n.F_y, n.F_z = F_x, F_y, F_z
    if p.viscosity != 0.0 or p.bridge != 0.0:
        lose(deeper, p, s, m)
    if p.thermal != 0.0:
        D_x -= (p.W_x - p.rest_x) * F_x
        D_y -= (p.W_yy - p.rest_yy) * F_y + (p.W_yz - p.rest_yz) * F_z
        D_z -= (p.W_yz - p.rest_yz) * F_y + (p.W_zz - p.rest_zz) * F_z
        show_end(n_x, n_y, n_z, s.stuck * shear * a, D_x, D_y, D_z, p, s, m, at)
    return F_x, F_y, F_z


@kernel
def at_rate(
    n_x: float,
    n_y: float,
    n_z: float,
    target: float,
    w_nn: float,
    D_x: float,
    D_y: float,
    D_z: float,
    p: Constants,
    s: State,
    m: Block,
) -> None:
    """Write into the ledger at which rate the indentation at mid-step changes, and the thermal force of the viscosity,
    docs/lever.md (48).

    Parameters
    ----------
    n_x, n_y, n_z : floats
        Normal of the surface.
    target, w_nn : float [m], [m/N]
        Indentation without force, and how it falls with the normal force.
    D_x, D_y, D_z : floats [m]
        Way of the sample against the tip in a half of the step, without force.
    p, s, m : records of Constants and State, block of the instrument
    """
    own = ledger_of(m)
    way = n_x * D_x + n_y * D_y + n_z * D_z
    # What follows the force without delay goes from that of the last step, or with heat of its end, to that of this.
    r_x, r_y, r_z = p.rest_x * n_x, p.rest_yy * n_y + p.rest_yz * n_z, p.rest_yz * n_y + p.rest_zz * n_z
    rest = r_x * s.F_x + r_y * s.F_y + r_z * s.F_z
    share, heat = 1.0, 0.0
    if p.thermal != 0.0:
        way += rest
        # A step that begins in contact is one of a body at this temperature.
        count = int(p.counts * s.steps)
        heat = math.sqrt(p.viscous_noise * own.eta * s.a) * standard_normal(p.viscous_key, count)
    else:
        # The force to come is the normal one, as the balance has it, and friction as it was.
        T_x, T_y, T_z = s.F_x - s.N * n_x, s.F_y - s.N * n_y, s.F_z - s.N * n_z
        aside = n_x * p.W_x * T_x + n_y * (p.W_yy * T_y + p.W_yz * T_z) + n_z * (p.W_yz * T_y + p.W_zz * T_z)
        part = 0.5 * (r_x * n_x + r_y * n_y + r_z * n_z) / w_nn
        way += 0.5 * (rest + r_x * T_x + r_y * T_y + r_z * T_z) - part * aside
        share -= part
    own.per = share / p.half
    own.origin = target - way / share
    whole = p.relaxation + p.half
    own.drag = own.eta * p.half / whole
    own.push = (p.relaxation * own.arm + p.half * heat) / whole


@kernel
def lose(deeper: float, p: Constants, s: State, m: Block) -> None:
    """Count what viscosity and bridge have taken in this step, and make or break the bridge, docs/lever.md (50).

    Parameters
    ----------
    deeper : float [m]
        Growth of the indentation from the middle of the last step to that of this one.
    p, s, m : records of Constants and State, block of the instrument
    """
    own = ledger_of(m)
    if p.viscosity != 0.0:
        work = stored = arm = 0.0
        if s.a > 0.0:
            rate = own.per * (s.delta - own.origin)
            force = own.drag * s.a * rate + own.push
            work = force * rate * p.h
            if p.relaxation > 0.0 and own.eta > 0.0:
                arm = 2.0 * force - own.arm
                # What leaves the contact takes its share along.
                if s.a < own.arm_radius:
                    arm *= s.a / own.arm_radius
                stored = 0.5 * p.relaxation * arm * arm / (own.eta * s.a)
        own.viscous += work - (stored - own.stored)
        own.stored, own.arm, own.arm_radius = stored, arm, s.a
    if p.bridge == 0.0:
        return
    # Its force begins and ends with the next step: by the distance in the middle of that one, as far as it is known.
    # Its work is that from where this step ends.
    gap, to = max(s.end - s.delta - 0.5 * deeper, 0.0), s.end - s.delta - deeper
    if own.bridge == 0.0 and to <= p.bridge_begin and own.pull > 0.0:
        own.bridge = 1.0
        own.bridged += bound_energy(gap, own) - bound_energy(p.bridge_end, own)
    elif own.bridge != 0.0 and to > p.bridge_end:
        own.bridge = 0.0
        own.bridged += bound_energy(p.bridge_end, own) - bound_energy(gap, own)


@kernel
def bound_energy(gap: float, own: Ledger) -> float:
    """Work that it would take to draw a bridge from a distance [m] out without end [J], docs/lever.md (49)."""
    # sqrt(gap^2 + spread2) - gap, without a difference.
    return own.pull * own.spread2 / (math.sqrt(gap * gap + own.spread2) + gap)
