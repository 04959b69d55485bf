"""Step of the plant `lever`: stiff scanner, cantilever that bends and twists, tip that sticks and slides.

The scanner is three damped oscillators, the bending of the cantilever one to three, its torsion one or none; bending
sideways and the higher modes follow the force without delay. Friction acts between tip and sample, set-valued, in
series with the lateral stiffness 8 G* a of the contact; on a sample of atoms the tip moves in their potential instead.
Scheme: implicit midpoint rule, the contact solved at mid-step; docs/lever.md (14) to (23), (41).
"""

import math
from typing import Any

from ...cantilever.beam import MODES
from ...compiled.jit import kernel, routine
from ...compiled.records import Block, record_at
from ...compiled.ways import by_lane, kept, rare
from ...contact.contact_table import ROW
from ...core.elementary import sincos, square
from ...core.random_numbers import normal
from ...parts.signals import BASE, LATERAL, TIP, Actuation, Truth
from .constants import PARTS, Constants
from .state import State, ledger_of, table_of
from .tip_on_lattice import on_lattice
from .tip_on_surface import on_surface


@kernel
def mode_rate(i: int, base: float, force: float, p: Constants, s: State) -> float:
    """Rate of bending mode i at mid-step without the sample, docs/lever.md (14), as an acceleration of the base and a
    force on the tip excite it.
    """
    rate = (s.v[i] - p.half * p.mode_w2[i] * s.q[i]) * p.mode_inverse[i]
    if base != 0.0 or force != 0.0:
        rate += p.mode_push[i] * force - p.mode_base[i] * base
    if p.thermal != 0.0:
        rate += p.kick[i] * normal(p.thermal_key, 4 * int(p.counts * s.steps) + i)
    return float(rate)


@kernel
def step(t: float, v: Actuation, unused: Block, p: Constants, s: State, m: Block) -> None:
    """Advance the state by one step h in place: at once, or in PARTS where the tip moves fast at the sample, (41).

    Parameters
    ----------
    t : float [s]
        At the begin of the step.
    v : record of Actuation
        Drive, held over the step, and how the base of the cantilever moves.
    unused : random numbers
    p, s : records of Constants and State
    m : block of the instrument, for the sample and the table of the contact
    """
    at = table_of(m)
    before = s.delta
    if rare(s.fast > 0.0, m):
        _in_parts(t, v, p, s, m, at)
    else:
        _whole(t, v, p, s, m, at)
    way = abs(s.delta - before)
    swift = way > p.swift * s.unit_indentation and s.delta + 2.0 * way > s.end
    # A driven tip is at the sample for a small part of its swing, again and again.
    settling = p.settling if v.amplitude == 0.0 and v.second_amplitude == 0.0 else 1.0
    kept(s, m).fast = settling if swift else s.fast


@kernel
def advance(t: float, v: Actuation, p: Constants, s: State, m: Block, at: int) -> None:
    """Advance the state by the step h of these constants; the table of the contact begins at m[at]."""
    half = p.half
    moved = end = acceleration = force = rocking = 0.0
    # Way of the tip, slope and twist that are shown, per that of the excitation.
    by_x = by_y = by_z = by_shown = by_twist = 0.0
    if v.amplitude != 0.0 or v.second_amplitude != 0.0:
        # At mid-step as the scheme sees what stands at each step where it should, docs/lever.md (39).
        turn = v.angular_frequency * half
        own = ledger_of(m)
        if own.turn != turn:
            own.turn = turn
            own.dip, own.swing = sincos(turn)
            own.hardness = square(own.dip / own.swing / half)
        sine, cosine = sincos(v.phase + v.angular_frequency * (t + half - v.since))
        moved = v.amplitude * own.swing * cosine
        inertia = -moved * own.hardness
        end = v.amplitude * (cosine * own.swing - sine * own.dip)
        if v.second_amplitude != 0.0:
            turn = v.second_angular_frequency * half
            if own.second_turn != turn:
                own.second_turn = turn
                own.second_dip, own.second_swing = sincos(turn)
                own.second_hardness = square(own.second_dip / own.second_swing / half)
            sine, cosine = sincos(v.second_phase + v.second_angular_frequency * (t + half - v.second_since))
            more = v.second_amplitude * own.second_swing * cosine
            moved += more
            inertia -= more * own.second_hardness
            end += v.second_amplitude * (cosine * own.second_swing - sine * own.second_dip)
        if v.excited == BASE:
            acceleration, by_y, by_z = inertia, p.base_y, p.base_z
        elif v.excited == TIP:
            force, by_y, by_z, by_shown = p.k * moved, p.pushed_y, p.pushed_z, p.pushed_shown
        elif v.excited == LATERAL:
            by_x = 1.0
        else:
            rocking, by_x, by_twist = inertia, 1.0, p.base_twist

    # Rates at mid-step if the tip felt no force, docs/lever.md (15); positions there.
    r_x = (s.V_X + half * p.w2[0] * (p.metres[0] * v.voltage[0] - s.X)) * p.inverse[0]
    r_y = (s.V_Y + half * p.w2[1] * (p.metres[1] * v.voltage[1] - s.Y)) * p.inverse[1]
    r_z = (s.V_Z + half * p.w2[2] * (p.metres[2] * v.voltage[2] - s.Z)) * p.inverse[2]
    rates = (
        mode_rate(0, acceleration, force, p, s),
        mode_rate(1, acceleration, force, p, s),
        mode_rate(2, acceleration, force, p, s),
    )
    v_phi = (s.v_phi - half * p.twist_w2 * s.phi) * p.twist_inverse - p.twist_base * rocking
    if p.thermal != 0.0:
        v_phi += p.twist_kick * normal(p.thermal_key, 4 * int(p.counts * s.steps) + 3)
    tip_x = p.arm * (s.phi + half * v_phi) + by_x * moved
    tip_y, tip_z = by_y * moved, by_z * moved
    for i in range(MODES):
        q = s.q[i] + half * rates[i]
        tip_y += p.mode_y[i] * q
        tip_z += p.mode_z[i] * q

    # Force of the sample on the tip, from where the tip would be on the sample without it.
    P_x, P_y, P_z = s.X + half * r_x - tip_x, s.Y + half * r_y - tip_y, s.Z + half * r_z
    D_x, D_y, D_z = half * (r_x - p.arm * v_phi), half * r_y, half * r_z
    D_x, D_y, D_z = D_x - by_x * (end - moved), D_y - by_y * (end - moved), D_z - by_z * (end - moved)
    for i in range(MODES):
        D_y -= half * p.mode_y[i] * rates[i]
        D_z -= half * p.mode_z[i] * rates[i]
    F_x, F_y, F_z = _on_sample(P_x, P_y, P_z, tip_z, D_x, D_y, D_z, p, s, m, at)

    # The whole step at the rates of its middle.
    n = kept(s, m)
    r_x -= p.push[0] * F_x
    r_y -= p.push[1] * F_y
    r_z -= p.push[2] * F_z
    h = p.h
    for i in range(MODES):
        rate = rates[i] + p.mode_push[i] * (p.mode_y[i] * F_y + p.mode_z[i] * F_z)
        n.q[i] += h * rate
        n.v[i] = 2.0 * rate - s.v[i]
    v_phi += p.twist_push * F_x
    n.X += h * r_x
    n.Y += h * r_y
    n.Z += h * r_z
    n.V_X, n.V_Y, n.V_Z = 2.0 * r_x - s.V_X, 2.0 * r_y - s.V_Y, 2.0 * r_z - s.V_Z
    n.phi += h * v_phi
    n.v_phi = 2.0 * v_phi - s.v_phi
    n.steps += 1.0 / p.counts
    show(by_z * end, by_shown * end, by_twist * end, p, n, h)


@routine
def _advance(t: float, v: Actuation, p: Constants, s: State, m: Block, at: int) -> None:
    """As `advance`, compiled once for whole steps and parts."""
    advance(t, v, p, s, m, at)


@kernel
def _in_parts_alone(t: float, v: Actuation, p: Constants, s: State, m: Block, at: int) -> None:
    fine = record_at(m, at + p.rows * ROW, Constants)
    rescale(1.0 / PARTS, p, fine, s)
    for part in range(PARTS):
        _advance(t + part * fine.h, v, fine, s, m, at)
    rescale(PARTS, fine, p, s)
    s.fast -= 1.0


@kernel
def _never(t: float, v: Actuation, p: Constants, s: State, m: Any, at: int) -> None:
    pass


_in_parts = by_lane(_in_parts_alone, _never)
_whole = by_lane(_advance, advance)


@kernel
def rescale(ways: float, p: Constants, to: Constants, s: State) -> None:
    """Go over to steps of another length: rates are those of its frequencies w~ (15), so that oscillations keep their
    amplitude, and a sliding tip goes so many times as far in a step.
    """
    for i in range(MODES):
        if p.mode_w2[i] != 0.0:
            s.v[i] *= math.sqrt(to.mode_w2[i] / p.mode_w2[i])
    if p.twist_w2 != 0.0:
        s.v_phi *= math.sqrt(to.twist_w2 / p.twist_w2)
    s.S_x *= ways
    s.S_y *= ways


@kernel
def _on_sample_alone(
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
    if p.lattice != 0.0:
        return on_lattice(P_x, P_y, P_z - p.a - tip_z, D_x, D_y, D_z, p, s, m, at)
    return on_surface(P_x, P_y, P_z, tip_z, D_x, D_y, D_z, p, s, m, at)


_on_sample = by_lane(_on_sample_alone, on_surface)
"""Force of the sample on the tip, see `on_surface`; instruments on a lattice do not run in lanes."""


@kernel
def show(tip: float, shown: float, twist: float, p: Constants, s: State, h: float) -> None:
    """What follows without delay: where the tip is and what the photodiode shows, from what the excitation alone makes
    of them; rates over a step of length h.
    """
    for i in range(MODES):
        tip += p.mode_z[i] * s.q[i]
        shown += p.mode_shown[i] * s.q[i]
    tip += p.rest_yz * s.F_y
    tip += p.rest_zz * s.F_z
    s.tip_rate = (tip - s.tip) / h
    s.tip = tip
    s.shown = shown + (p.shown_y * s.F_y + p.shown_z * s.F_z)
    s.twist = twist + (s.phi + p.twist_x * s.F_x)


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
    # The photodiode shows the slope: none of what the base moves by.
    o.deflection_excess = s.shown - s.tip
    o.lateral_excess = p.force_per_twist * s.twist - s.T_x
