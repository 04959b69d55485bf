"""Claims about the compliant plant: contact made and lost, resonances, energy, symmetry."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from afm_model.contact import jkr
from afm_model.parameters import InstrumentParameters, build, stable_step

from ..rolling import Bench, bench, compliant, frequency
from ..tables import columns, negated, numbers

UNDAMPED = {"scanner__xi_z": 0.0, "cantilever__xi_c": 0.0, "contact__zeta_n": 0.0}
FLAT = {"sample__beta": 0.0}
RATES = ("V_X", "V_Y", "V_Z", "V_Q")


def still(n: int, u_z: float = 0.0) -> np.ndarray:
    """Drives of n steps without lateral drive."""
    return np.tile([0.0, 0.0, u_z], (n, 1))


def contact_resonance(h: float, z_r: float) -> float:
    """Angular frequency of small vibrations of the tip against the sample, at the load of setpoint z_r."""
    c = bench(h, cantilever__W=0.0, **UNDAMPED)
    s, u_z = c.rest(z_r)
    s.V_Q = 1e-7
    states = compliant(s, c, still(round(20.0 / h), u_z))
    return frequency(states.V_Q - states.V_Z, h)


def test_contact_stiffness_at_zero_load_is_329_N_per_m():
    p = bench(0.01).p
    stiffness = jkr.stiffness_of_u(1.0) * p.L_s / p.delta_0
    assert stiffness * 6e-9 * 1e4**2 == pytest.approx(329.0, abs=0.5)  # three digits are given


def test_contact_resonance_is_that_of_the_two_coupled_masses():
    p = bench(0.001, cantilever__W=0.0, **UNDAMPED).p
    k = jkr.stiffness_of_u(1.0) * p.L_s / p.delta_0
    stiffness = np.array([[p.eta_z**2 + k / p.mu, -k / p.mu], [-k, p.eta_c**2 + k]])
    fast = math.sqrt(np.linalg.eigvals(stiffness).max())
    assert fast == pytest.approx(23.586, abs=5e-4)
    # (omega h)^2 / 24 = 2e-5 of the scheme; amplitude 1e-7 / 23.6 of an indentation scale 0.017 bends nothing.
    assert contact_resonance(0.001, 0.0) == pytest.approx(fast, rel=5e-5)


def test_contact_resonance_at_the_paper_setpoint_is_23_64():
    # W = 0 in this run: the height that gives the load of z_r = 0.01 and w = 0.01.
    p = bench(0.001).p
    assert contact_resonance(0.001, 0.01 + p.w / p.eta_c**2) == pytest.approx(23.64, abs=5e-3)  # four digits are given


def test_explicit_step_limit_is_two_over_the_contact_resonance():
    # The slow mode shifts the coupled resonance by 2e-5.
    flat = build(InstrumentParameters, {"sample.beta": 0.0, "cantilever.W": 0.0, "reference.z_r": 0.0})
    assert stable_step(flat) * 1e4 == pytest.approx(2.0 / 23.586, rel=1e-4)


def test_free_cantilever_rings_at_its_damped_resonance_and_decays_at_its_damping():
    h = 0.01
    c = bench(h)
    p = c.p
    s, _ = c.rest(0.0)
    s.Z, s.contact = -10.0, 0.0
    s.V_Q = 0.1
    states = compliant(s, c, still(10_000, -10.0 * p.eta_z**2))
    assert not states.contact[1:].any()
    assert not columns(states[1:], "N", "F_max").any()
    # Out of contact the cantilever is bent by its load alone.
    bend = states.Q - p.a + p.w / p.eta_c**2
    omega = p.eta_c * math.sqrt(1.0 - p.xi_c**2)
    # (omega h)^2 / 24 = 1e-5 of the scheme.
    assert frequency(bend, h) == pytest.approx(omega, rel=2e-5)
    assert frequency(bend, h) * 1e4 / (2.0 * math.pi) == pytest.approx(2400.0, rel=1e-4)
    top = np.abs(states.V_Q)
    periods = round(20 * 2.0 * math.pi / omega / h)
    decay = math.log(top[:500].max() / top[periods : periods + 500].max())
    # A maximum read on a grid of 0.015 rad is low by its square.
    assert decay == pytest.approx(p.xi_c * p.eta_c * periods * h, rel=1e-3)


def one_step(indentation: float, in_contact: bool) -> Any:
    """State after a very short step at rest with the given delta R_e / a0^2, on a flat sample."""
    c = bench(1e-9, **FLAT)
    s, _ = c.rest(0.0)
    s.Q = 0.0
    s.Z = indentation * c.p.delta_0
    s.contact = float(in_contact)
    return compliant(s, c, still(1))[-1]


def test_contact_under_fixed_grips_breaks_at_minus_0_2752():
    assert one_step(-0.27515, in_contact=True).contact == 1.0
    assert one_step(-0.27517, in_contact=True).contact == 0.0


def test_load_when_fixed_grips_break_is_5_9_of_the_pull_off_force():
    p = bench(0.01).p
    # 4 (u^6 - u^3) at u^3 = 1/6; the slope is infinite there: 1e-5 away costs a few times its root.
    assert one_step(-0.27515, in_contact=True).N == pytest.approx(-5.0 / 9.0 * p.L_s, rel=2e-2)


def test_surfaces_apart_do_not_attract_until_they_meet():
    apart, met = one_step(-1e-6, in_contact=False), one_step(1e-12, in_contact=False)
    assert (apart.contact, apart.N, apart.F_max) == (0.0, 0.0, 0.0)
    assert met.contact == 1.0


def test_snap_in_pulls_with_8_9_of_the_pull_off_force():
    p = bench(0.01).p
    # The surfaces move by their elastic acceleration times the step 1e-9 before the force is read.
    assert one_step(1e-12, in_contact=False).N == pytest.approx(-8.0 / 9.0 * p.L_s, rel=1e-8)


def energy(states: Any, c: Bench) -> np.ndarray:
    """Energy [m_c w0^2 z0^2] of the vertical motion over a flat sample, that of the contact's surfaces included."""
    p = c.p
    v_z, v_q, z, q = (states[name] for name in ("V_Z", "V_Q", "Z", "Q"))
    u = np.array([jkr.u_of_indentation(d) for d in (z - q) / p.delta_0])
    # Integral of N over the indentation along the branch from u = 0; out of contact nothing is stored.
    stored = 4.0 * p.L_s * p.delta_0 * (0.4 * u**10 - 2.0 / 3.0 * u**7 + u**4 / 6.0) * states.contact
    springs = 0.5 * p.mu * (p.eta_z * z) ** 2 + 0.5 * (p.eta_c * (q - p.a)) ** 2 + p.w * q
    return 0.5 * p.mu * v_z**2 + 0.5 * v_q**2 + springs + stored


def test_each_step_obeys_the_equations_of_motion_at_its_middle(rng):
    h = 0.005
    c = bench(h, cantilever__a=2e-8, cantilever__W=60e-9, cantilever__xi_c=0.03)
    p = c.p
    s, u_z = c.rest(0.01)
    s.V_X, s.V_Y = 3.0, 2.0
    s.V_Z, s.V_Q = 0.01, 0.1
    drives = np.column_stack([np.full(600, 13.0), np.full(600, 9.0), u_z * (1.0 + 0.2 * rng.uniform(size=600))])
    before, after = (t := compliant(s, c, drives))[:-1], t[1:]
    assert after.contact.all()
    X, Y, Z, Q = (before[name] + 0.5 * h * before[f"V_{name}"] for name in "XYZQ")
    V, W, V_Z, V_Q = (0.5 * (before[name] + after[name]) for name in RATES)
    A, B, A_Z, A_Q = ((after[name] - before[name]) / h for name in RATES)
    # Sample, curvature and JKR contact of section 1; |L_s| ~ R_e, a_0^2 / R_e ~ R_e^(1/3), a^2 ~ R_e^(4/3).
    H = c.sample.beta * np.sin(0.5 * X) * np.sin(0.5 * Y)
    H_rate = 0.5 * c.sample.beta * (np.cos(0.5 * X) * np.sin(0.5 * Y) * V + np.sin(0.5 * X) * np.cos(0.5 * Y) * W)
    rho = 1.0 / (1.0 + 0.25 * H * p.r)
    L_s, scale = p.L_s * rho, p.delta_0 * rho ** (1.0 / 3.0)
    u = np.array([np.roots([1.0, 0.0, 0.0, -2.0 / 3.0, -d]).real.max() for d in (Z + H - Q) / scale])
    slope = 4.0 * (6.0 * u**5 - 3.0 * u**2) / (4.0 * u**3 - 2.0 / 3.0) * L_s / scale
    load = 4.0 * L_s * (u**6 - u**3) + 2.0 * p.zeta_n * np.sqrt(slope) * (V_Z + H_rate - V_Q)
    f = p.f_s * rho ** (4.0 / 3.0) * 4.0 ** (2.0 / 3.0) * u**4
    # The scheme meets these equations to round-off: that of a rate over h.
    close = {"rel": 1e-9, "abs": 1e-9}
    assert after.N == pytest.approx(load, **close)
    assert after.F_max == pytest.approx(f, **close)
    free_x = drives[:, 0] - p.eta_x**2 * X - 2.0 * p.xi_x * p.eta_x * V
    free_y = drives[:, 1] - p.eta_y**2 * Y - 2.0 * p.xi_y * p.eta_y * W
    assert pytest.approx(free_x - after.F_x, **close) == A
    assert pytest.approx(free_y - after.F_y, **close) == B
    assert pytest.approx(drives[:, 2] - p.eta_z**2 * Z - 2.0 * p.xi_z * p.eta_z * V_Z - load / p.mu, **close) == A_Z
    assert pytest.approx(load - p.w - p.eta_c**2 * (Q - p.a) - 2.0 * p.xi_c * p.eta_c * V_Q, **close) == A_Q
    assert np.ptp(X) > 10.0
    assert np.ptp(load) > 0.1


tosses = st.tuples(st.floats(-0.004, 0.01), st.floats(-0.3, 0.3), st.floats(-0.03, 0.03))
"""Displacement of the piezo, rates of the tip and of the piezo: some break the contact."""
seeds = st.integers(0, 2**32 - 1)
FEW = settings(max_examples=20)
"""Runs of thousands of steps."""


def tossed(c: Bench, toss: tuple[float, float, float], size: float = 1.0) -> Any:
    """A state in contact with the piezo and the tip out of balance."""
    s, _ = c.rest(0.0)
    s.Z += size * toss[0]
    s.V_Q, s.V_Z = size * toss[1], size * toss[2]
    return s


def largest_rise(values: np.ndarray) -> float:
    """How far the energy ever climbs above what it was before."""
    return float((values - np.minimum.accumulate(values)).max())


@FEW
@given(tosses)
def test_energy_over_a_flat_sample_never_grows_without_drive(toss):
    c = bench(0.01, **FLAT)
    p = c.p
    states = compliant(tossed(c, toss), c, still(4000))
    event("contact lost" if not states.contact.all() else "in contact")
    # A contact that opens or closes does so up to one step late: (omega h)^2 / 2 = 3 % of the surface energy.
    assert largest_rise(energy(states, c)) < 0.03 * p.L_s * p.delta_0


def test_contact_lost_and_made_again_costs_energy():
    c = bench(0.01, **FLAT)
    states = compliant(tossed(c, (0.0, 0.3, 0.0)), c, still(4000))
    assert not states.contact.all()
    values = energy(states, c)
    assert values[-1] < values[0]


@FEW
@given(tosses)
def test_energy_over_a_flat_sample_falls_in_every_step_while_in_contact(toss):
    c = bench(0.01, **FLAT)
    states = compliant(tossed(c, toss, 0.2), c, still(4000))
    assert states.contact.all()
    values = energy(states, c)
    # The leapfrog's energy waves by (omega h / 2)^2 = 1 % of a vibration that decays by 4 % per step.
    assert largest_rise(values) <= 1e-4 * (values[0] - values.min()) + 1e-15


def test_undamped_energy_is_kept_to_second_order_in_the_step():
    start = tossed(bench(0.01, **FLAT, **UNDAMPED), (0.007, 0.2, -0.02), 0.2)
    rises = []
    for h in (0.01, 0.005):
        c = bench(h, **FLAT, **UNDAMPED)
        states = compliant(start, c, still(round(50.0 / h)))
        assert states.contact.all()
        rises.append(np.ptp(energy(states, c)))
    # Exactly 4 for a linear spring; the contact hardens.
    assert rises[0] / rises[1] == pytest.approx(4.0, abs=0.2)


def test_over_bumps_the_model_has_no_potential_and_energy_can_grow():
    # Assumption 5 of docs/theory.md: the vertical force alone, without the lateral reaction of the slope.
    c = bench(0.01)
    p = c.p
    s, u_z = c.rest(0.0)
    s.V_X, s.V_Y = 10.0, 8.0
    states = compliant(s, c, still(2000, u_z))
    assert states.contact.all()
    X, Y = states.X, states.Y
    H = c.sample.beta * np.sin(c.sample.k_x * X) * np.sin(c.sample.k_y * Y)
    rho = 1.0 / (1.0 + 0.25 * H * p.r)
    scale = p.delta_0 * rho ** (1.0 / 3.0)
    u = np.array([jkr.u_of_indentation(d) for d in (states.Z + H - states.Q) / scale])
    stored = 4.0 * p.L_s * rho * scale * (0.4 * u**10 - 2.0 / 3.0 * u**7 + u**4 / 6.0)
    v_x, v_y, v_z, v_q = (states[name] for name in RATES)
    # In m_c w0^2 z0^2, with the work of the constant drive.
    lateral = 0.5 * p.mu * (2.5e-10 / 1e-7) ** 2 * (v_x**2 + v_y**2 + (p.eta_x * X) ** 2 + (p.eta_y * Y) ** 2)
    springs = 0.5 * p.mu * (p.eta_z * states.Z) ** 2 + 0.5 * (p.eta_c * (states.Q - p.a)) ** 2
    total = lateral + springs + 0.5 * p.mu * v_z**2 + 0.5 * v_q**2 + p.w * states.Q + stored
    total -= p.mu * u_z * states.Z
    assert lateral[0] == pytest.approx(0.051, abs=5e-4)
    assert (total - total[0]).max() == pytest.approx(0.156, abs=5e-4)  # digits given


def random_drives(rng: np.random.Generator, n: int, u_z: float) -> np.ndarray:
    """Lateral drives of several tones up to 3 rad per unit that make the scanner slip, turn and stop."""
    t = np.arange(n) * 0.01
    drives = still(n, u_z)
    for axis in range(2):
        for _ in range(4):
            drives[:, axis] += rng.normal(0.0, 15.0) * np.sin(rng.uniform(0.0, 3.0) * t + rng.uniform(0.0, 6.0))
    return drives


@FEW
@given(seeds)
def test_friction_dissipates_in_every_step_of_random_motions(seed):
    rng = np.random.default_rng(seed)
    c = bench(0.01)
    s, u_z = c.rest(0.01)
    s.V_X, s.V_Y = rng.normal(0.0, 20.0, 2)
    after = compliant(s, c, random_drives(rng, 10_000, u_z))[1:]
    friction, velocity = columns(after, "F_x", "F_y"), columns(after, "V_X", "V_Y")
    # With the velocity at the end of the step; at rest the power is exactly zero.
    assert (friction * velocity).sum(axis=1).min() >= 0.0
    size = np.hypot(*friction.T)
    # f by three operations.
    assert (size <= after.F_max * (1.0 + 1e-14)).all()
    slips = velocity.any(axis=1)
    assert size[slips] == pytest.approx(after.F_max[slips], rel=1e-13)
    event("with rests" if not slips.all() else "slips throughout")


def moved(rng: np.random.Generator) -> tuple[Any, float, np.ndarray]:
    """Start, z drive and lateral drives of a random motion, for the symmetries."""
    c = bench(0.01)
    s, u_z = c.rest(0.01)
    s.X, s.Y = rng.uniform(-20.0, 20.0, 2)
    s.V_X, s.V_Y = rng.normal(0.0, 10.0, 2)
    return s, u_z, random_drives(rng, 5000, u_z)


@FEW
@given(seeds)
def test_mirrored_sample_and_drive_give_the_mirrored_motion_to_the_last_bit(seed):
    s, _, drives = moved(np.random.default_rng(seed))
    plain = compliant(s, bench(0.01), drives)
    flip = ("X", "V_X", "F_x")
    # H is odd in x: the mirror image of the sample has the opposite height.
    mirrored = compliant(negated(s, *flip), bench(0.01, sample__beta=-12.5e-9), drives * [-1.0, 1.0, 1.0])
    np.testing.assert_array_equal(numbers(mirrored), numbers(negated(plain, *flip)))


@FEW
@given(seeds)
def test_inverting_both_axes_gives_the_inverted_motion_to_the_last_bit(seed):
    s, _, drives = moved(np.random.default_rng(seed))
    c = bench(0.01)
    flip = ("X", "V_X", "F_x", "Y", "V_Y", "F_y")
    inverted = compliant(negated(s, *flip), c, drives * [-1.0, -1.0, 1.0])
    np.testing.assert_array_equal(numbers(inverted), numbers(negated(compliant(s, c, drives), *flip)))


@FEW
@given(seeds, st.floats(0.0, 2.0 * math.pi))
def test_friction_over_a_flat_sample_knows_no_axes(seed, angle):
    c = bench(0.01, scanner__f_y=669.07, scanner__xi_y=0.0366, **FLAT)
    s, _, drives = moved(np.random.default_rng(seed))
    s.Z = c.rest(0.01)[0].Z
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    pairs = (("X", "Y"), ("V_X", "V_Y"))

    def turned(states: Any) -> Any:
        out = states.copy()
        for x, y in pairs:
            both = columns(states, x, y) @ turn.T
            out[x], out[y] = both[..., 0], both[..., 1]
        return out

    expected = turned(compliant(s, c, drives))
    drives[:, :2] = drives[:, :2] @ turn.T
    found = compliant(turned(s), c, drives)
    for pair in pairs:
        # Round-off, amplified where a slip ends: the friction's direction turns quickly there.
        assert columns(found, *pair) == pytest.approx(columns(expected, *pair), abs=1e-8)


def test_quiet_stick_has_a_velocity_of_exactly_zero():
    c = bench(0.01)
    s, u_z = c.rest(0.01)
    drives = still(20_000, u_z)
    drives[:1000, :2] = 20.0  # a push into a slip, then nothing
    states = compliant(s, c, drives)
    assert states.V_X[500] != 0.0
    assert not columns(states[-10_000:], "V_X", "V_Y").any()
    assert np.ptp(columns(states[-10_000:], "X", "Y"), axis=0).tolist() == [0.0, 0.0]
