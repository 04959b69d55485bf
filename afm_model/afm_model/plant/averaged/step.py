"""Step of the plant `averaged`: the scanner, and amplitude and phase of a tip that taps; docs/dynamic.md (54), (55).

The deflection of the end in its first mode is Re(a exp(i theta)), theta being the phase of the drive. Half of a step
of the free oscillator, exact; a step of the mean force, whose first harmonic is taken as a complex stiffness times the
motion of the tip; half of a step of the free oscillator.
"""

import math

from ...cantilever.beam import MODES
from ...compiled.jit import kernel, routine
from ...compiled.records import Block, record_at
from ...core.elementary import exp, sincos
from ...parts.dispatch import surface
from ...parts.header import BlockHeader
from ...parts.signals import BASE, TIP, Actuation, Surface, Truth
from .force_table import LEAST, ROW, look_up
from .state import Constants, Ledger, State

SINUSOIDAL = 0.02
"""Largest first harmonic of the force over spring constant and amplitude at which the average is held to hold."""
FAINT = 0.01
"""The same, times Q, of an amplitude that is smaller than those in the table, or of a tip that adhesion may hold, which
is larger than spring constant times amplitude: it changes amplitude and phase by less than a percent and a degree.
"""
STIFF = 15.0
"""Largest stiffness of a viscous contact over the spring constant. The modes beyond the first give way by 0.029 of the
static compliance, that is by 0.4 of the indentation here: what viscosity takes is then known to 8 %.
"""
_OF_RADIUS = 8.0
"""Of a radius that grows like the root of the depth, its mean a_1 is (2 depth / A)^(3/2) times an eighth."""


@kernel
def times(a: float, b: float, c: float, d: float) -> tuple[float, float]:
    """(a + i b) (c + i d)."""
    return a * c - b * d, a * d + b * c


@kernel
def over(a: float, b: float, c: float, d: float) -> tuple[float, float]:
    """(a + i b) / (c + i d)."""
    per = 1.0 / (c * c + d * d)
    return (a * c + b * d) * per, (b * c - a * d) * per


@routine
def excite(t: float, v: Actuation, p: Constants, s: State, own: Ledger) -> None:
    """Make what follows from the excitation at time t [s], without a jump of the motion; docs/dynamic.md (55)."""
    turn = v.angular_frequency if v.angular_frequency != 0.0 else p.w[0]
    if own.known != 0.0:
        # The same motion over the new phase.
        back = own.phase + own.turn * (t - own.since) - (v.phase + turn * (t - v.since))
        sine, cosine = sincos(back)
        s.a_re, s.a_im = times(s.a_re, s.a_im, cosine, sine)
    own.known, own.turn = 1.0, turn
    own.amplitude, own.angular_frequency, own.phase = v.amplitude, v.angular_frequency, v.phase
    own.since, own.excited = v.since, v.excited
    B, w, h = v.amplitude, p.w[0], p.h
    by_base = v.excited == BASE
    if not by_base and v.excited != TIP:
        B = 0.0
    # A free oscillation over the frame decays by exp(pole t).
    pole_re = -0.5 * w / p.Q
    pole_im = w * math.sqrt(1.0 - 0.25 / (p.Q * p.Q)) - turn
    decay = exp(0.5 * h * pole_re)
    sine, cosine = sincos(0.5 * h * pole_im)
    own.half_re, own.half_im = decay * cosine, decay * sine
    own.y_re = own.y_im = own.z_re = own.z_im = own.shown_re = own.shown_im = 0.0
    own.free_re = own.free_im = 0.0
    if by_base:
        own.y_re, own.z_re = B * p.base_y, B * p.base_z
    else:
        own.y_re, own.z_re, own.shown_re = B * p.pushed_y, B * p.pushed_z, B * p.pushed_shown
    for i in range(MODES):
        if p.w[i] == 0.0:
            continue
        r = turn / p.w[i]
        push = B * p.by_base[i] * r * r if by_base else B * p.k * p.compliance[i]
        q_re, q_im = over(push, 0.0, 1.0 - r * r, r / p.Q)
        if i == 0:
            own.free_re, own.free_im = q_re, q_im
            # Steady motion is exact: - pole over (1 - r^2 + i r / Q), times the compliance.
            own.give_re, own.give_im = over(-pole_re, -pole_im, 1.0 - r * r, r / p.Q)
            own.give_re *= p.compliance[0]
            own.give_im *= p.compliance[0]
        else:
            own.y_re, own.y_im = own.y_re + p.mode_y[i] * q_re, own.y_im + p.mode_y[i] * q_im
            own.z_re, own.z_im = own.z_re + p.mode_z[i] * q_re, own.z_im + p.mode_z[i] * q_im
            own.shown_re += p.mode_shown[i] * q_re
            own.shown_im += p.mode_shown[i] * q_im


@kernel
def force(u: float, A: float, H: Surface, p: Constants, m: Block, at: int) -> tuple[float, float, float, float, float]:
    """`look_up` at nearest distance u and amplitude A [m] over the sample H, and the distance at which contact ends
    [m].
    """
    row = 0
    if p.of_materials > 1:
        for i in range(p.of_materials):
            first = at + i * p.of_curvatures * ROW
            if m[first] == H.adhesion and m[first + 1] == H.modulus:
                row = i * p.of_curvatures
    # One row, or between two.
    count, f, per = 1, 0.0, 1.0
    if p.of_curvatures > 1:
        widened = 1.0 + H.curvature * p.rise / p.x0 * p.R
        place = (widened - p.curvature_first) / p.curvature_step
        between = min(max(int(place), 0), p.of_curvatures - 2)
        count, row, f, per = 2, row + between, place - between, 1.0 / widened
    F_0 = stiffness = radius = rub = end = 0.0
    for i in range(count):
        one = at + (row + i) * ROW
        share = f if i == 1 else 1.0 - f
        F_i, stiffness_i, radius_i, rub_i = look_up(u, A, m, one)
        F_0 += share * per * F_i
        stiffness += share * per * stiffness_i
        radius += share * per * radius_i
        rub += share * per * rub_i
        end -= share * m[one + 2]
    return F_0, stiffness, radius, rub, end


@kernel
def free(own: Ledger, s: State) -> None:
    """Half of a step of the free oscillator: exact."""
    a, b = times(s.a_re - own.free_re, s.a_im - own.free_im, own.half_re, own.half_im)
    s.a_re, s.a_im = own.free_re + a, own.free_im + b


@kernel
def step(t: float, v: Actuation, unused: Block, p: Constants, s: State, m: Block) -> None:
    """Advance the state by one step h in place.

    Parameters
    ----------
    t : float [s]
        At the begin of the step.
    v : record of Actuation
        Drive, held over the step, and how the cantilever is excited.
    unused : random numbers
    p, s : records of Constants and State
    m : block of the instrument, for the sample and the table of the force
    """
    g = record_at(m, 0, BlockHeader)
    own = record_at(m, g.plant_ledger, Ledger)
    same = own.known != 0.0 and own.amplitude == v.amplitude and own.angular_frequency == v.angular_frequency
    if not (same and own.phase == v.phase and own.since == v.since and own.excited == v.excited):
        excite(t, v, p, s, own)
    half, h = p.half, p.h
    # Scanner: rates at mid-step without the sample, as in the plant lever.
    r_x = (s.V_X + half * p.w2[0] * (p.metres[0] * v.voltage[0] - s.X)) * p.inverse[0]
    r_y = (s.V_Y + half * p.w2[1] * (p.metres[1] * v.voltage[1] - s.Y)) * p.inverse[1]
    r_z = (s.V_Z + half * p.w2[2] * (p.metres[2] * v.voltage[2] - s.Z)) * p.inverse[2]
    H = surface((s.X + half * r_x) / p.x0, (s.Y + half * r_y) / p.x0, m)
    n_x, n_y, n_z = H.slope_x * p.rise, H.slope_y * p.rise, 1.0
    if n_x != 0.0 or n_y != 0.0:
        n_z = 1.0 / math.sqrt(1.0 + n_x * n_x + n_y * n_y)
        n_x *= n_z
        n_y *= n_z

    free(own, s)
    # Motion of the tip along the normal, and the force of the sample on it.
    way = p.mode_y[0] * n_y + p.mode_z[0] * n_z
    T_re = way * s.a_re + (n_y * own.y_re + n_z * own.z_re)
    T_im = way * s.a_im + (n_y * own.y_im + n_z * own.z_im)
    A = math.sqrt(T_re * T_re + T_im * T_im)
    u = n_z * (p.a - (s.Z + half * r_z) - H.height * p.z0) - A
    F_0, stiffness, radius, rub, end = force(u, A, H, p, m, g.plant_map)
    viscous, rub = p.viscosity * H.viscosity * own.turn * radius, H.strength * rub
    loss = viscous + rub
    # Its first harmonic is (stiffness - i loss) T; over a step T grows by the factor R = exp(x), by Pade's (2, 2).
    per = way * way * h
    x_re, x_im = times(own.give_re * per, own.give_im * per, stiffness, -loss)
    y_re, y_im = times(x_re, x_im, x_re, x_im)
    e_re, e_im = 1.0 + y_re / 12.0, y_im / 12.0
    R_re, R_im = over(x_re, x_im, e_re - 0.5 * x_re, e_im - 0.5 * x_im)
    d_re, d_im = times(R_re, R_im, T_re, T_im)
    per = 1.0 / way
    s.a_re += d_re * per
    s.a_im += d_im * per
    free(own, s)

    s.F_0, s.F_re, s.F_im = F_0, stiffness * A, -loss * A
    s.nearest, s.amplitude = u, A
    s.touching = 1.0 if u < end else 0.0
    free_again = u >= end or p.k * A >= p.pull * H.adhesion
    most = (SINUSOIDAL if A >= LEAST and free_again else FAINT / p.Q) * p.k
    beyond = stiffness * stiffness + loss * loss > most * most
    if viscous > 0.0 and u < end:
        # Where attraction balances the motion the depth, and with it what viscosity takes, is a small difference.
        part = 2.0 * (end - u) / A
        spring = 1.5 * p.K * H.modulus * _OF_RADIUS * radius / (part * math.sqrt(part))
        beyond = beyond or stiffness > loss or spring > STIFF * p.k
    s.outside = 1.0 if beyond else 0.0
    work = 0.5 * own.turn * A * A * h
    own.viscous += viscous * work
    own.rubbed += rub * work
    own.time_outside += h * s.outside
    r_x -= p.push[0] * F_0 * n_x
    r_y -= p.push[1] * F_0 * n_y
    r_z -= p.push[2] * F_0 * n_z
    s.X += h * r_x
    s.Y += h * r_y
    s.Z += h * r_z
    s.V_X, s.V_Y, s.V_Z = 2.0 * r_x - s.V_X, 2.0 * r_y - s.V_Y, 2.0 * r_z - s.V_Z
    # What the modes beyond the first show under the first harmonic of the force: without delay.
    rest = p.static_y * n_y + p.static_z * n_z - p.mode_shown[0] * p.compliance[0] * way
    f_re, f_im = times(stiffness, -loss, T_re, T_im)
    show(t + h, n_y * F_0, n_z * F_0, rest * f_re, rest * f_im, p, s, own)


@kernel
def show(t: float, F_y: float, F_z: float, r_re: float, r_im: float, p: Constants, s: State, own: Ledger) -> None:
    """What the photodiode shows at time t [s], with r of the modes beyond the first, and where the tip is then."""
    sine, cosine = sincos(own.phase + own.turn * (t - own.since))
    q = s.a_re * cosine - s.a_im * sine
    tip = p.tip_z * F_z + p.mode_z[0] * q + (own.z_re * cosine - own.z_im * sine)
    s.tip_rate = (tip - s.tip) / p.h
    s.tip = tip
    moved = p.mode_shown[0] * q + ((own.shown_re + r_re) * cosine - (own.shown_im + r_im) * sine)
    s.shown = p.static_y * F_y + p.static_z * F_z + moved


@kernel
def observe(p: Constants, s: State, o: Truth) -> None:
    """See `afm_model.parts.Plant`. There is no friction; `normal_force` is the mean over a cycle, and `contact` says
    whether the tip touches in it.
    """
    o.position[0], o.position[1], o.position[2] = s.X, s.Y, s.Z
    o.velocity[0], o.velocity[1], o.velocity[2] = s.V_X, s.V_Y, s.V_Z
    o.tip_height = p.a + s.tip
    o.tip_rate = s.tip_rate
    o.friction[0] = o.friction[1] = o.friction_bound = 0.0
    o.normal_force = s.F_0
    o.contact = s.touching
    o.stuck = 0.0
    o.deflection_excess = s.shown - s.tip
    o.lateral_excess = 0.0
