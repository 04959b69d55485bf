"""Claims about the lateral motion with friction, against an event-driven reference and closed forms."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from .. import oracle
from ..oracle import Trajectory, event_driven, paper_lateral
from ..rolling import Bench, bench, held, held_under_sine
from ..tables import columns

AMPLITUDE, OMEGA = 20.0, 0.005  # section 4.1 of the paper
PERIOD = 2.0 * math.pi / OMEGA
Z_R = 0.01


def load(c: Bench) -> float:
    """Static load at the setpoint of section 4.1."""
    p = c.p
    return float(p.eta_c**2 * (Z_R - p.a) + p.w)


def error(period: Trajectory, h: float) -> float:
    """Largest distance from the reference over one period [x0]."""
    c = bench(h)
    s, _ = c.rest(Z_R)
    positions = held_under_sine(s, c, AMPLITUDE, OMEGA, round(1.0 / h), len(period.times))
    return float(np.abs(positions - period.positions).max())


def order(steps: list[float], errors: list[float]) -> float:
    """Exponent of the step in the error, fitted over some steps."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def test_error_over_one_period_is_below_a_thousandth_of_x0_at_the_default_step(period):
    # The motion spans 130 x0.
    assert error(period, 0.01) < 1e-3


def test_error_over_one_period_is_below_1e_5_x0_at_a_tenth_of_the_default_step(period):
    assert error(period, 0.001) < 1e-5


def test_scheme_is_of_second_order_where_steps_are_short(period):
    steps = [0.002, 0.001, 0.0005]
    assert order(steps, [error(period, h) for h in steps]) == pytest.approx(2.0, abs=0.2)


def test_scheme_converges_faster_than_first_order_across_stick_and_slip(period):
    steps = [0.02, 0.01, 0.005, 0.002, 0.001]
    # A slip that ends inside a step leaves an error of first order in that step alone.
    assert order(steps, [error(period, h) for h in steps]) > 1.0


def test_scheme_is_of_second_order_in_smooth_slip():
    start = (0.0, 0.0, 30.0, 20.0)
    times = np.arange(5.0) * 0.5  # it slips throughout and stops at 2.3
    smooth = event_driven(
        paper_lateral(load(bench(0.01))), lambda t: (3.0, -2.0), lambda t: (0.0, 0.0), times, initial=start
    )
    assert smooth.stick_phases == []
    steps = [0.02, 0.01, 0.005, 0.0025]
    errors = []
    for h in steps:
        c = bench(h)
        s, _ = c.rest(Z_R)
        s.V_X, s.V_Y = start[2:]
        every = round(0.5 / h)
        drives = np.tile([3.0, -2.0], (every * 4, 1))
        positions = columns(held(s, c, drives)[::every], "X", "Y")
        errors.append(np.abs(positions - smooth.positions).max())
    # Three halvings: the next order of the error shifts the slope by less than this.
    assert order(steps, errors) == pytest.approx(2.0, abs=0.2)


def test_reference_and_scheme_stick_at_the_same_times(period):
    c = bench(0.01)
    s, _ = c.rest(Z_R)
    t = (np.arange(round(period.times[-1] / 0.01)) + 0.5) * 0.01
    drive = AMPLITUDE * np.sin(OMEGA * t)
    states = held(s, c, np.column_stack([drive, drive]))
    stuck = np.concatenate([[False], (states.V_X[1:] == 0.0) & (states.V_Y[1:] == 0.0), [False]])
    edges = np.flatnonzero(stuck[1:] != stuck[:-1]).reshape(-1, 2) * 0.01
    assert len(edges) == len(period.stick_phases)
    # A phase starts and ends on a step, and the motion before it is right to 1e-3 x0 at 1 x0 per unit or less.
    assert edges == pytest.approx(np.array(period.stick_phases), abs=0.03)


def slip_once(push: float, h: float, duration: float) -> tuple[Any, Bench]:
    """One axis of a flat sample: states from rest under a constant drive of `push` along x, and the plant."""
    c = bench(h, sample__beta=0.0)
    s, _ = c.rest(Z_R)
    return held(s, c, np.tile([push, 0.0], (round(duration / h), 1))), c


def test_a_slip_under_constant_drive_lasts_half_a_damped_period():
    h = 0.001
    states, c = slip_once(16.0, h, 20.0)
    p = c.p
    slipping = np.flatnonzero(states.V_X != 0.0)
    duration = (slipping[-1] - slipping[0] + 1) * h
    # It starts within the first and stops within the last step.
    assert duration == pytest.approx(math.pi / (p.eta_x * math.sqrt(1.0 - p.xi_x**2)), abs=2.0 * h)


def test_a_slip_under_constant_drive_overshoots_by_the_damping_of_half_a_period():
    push = 16.0
    states, c = slip_once(push, 0.01, 20.0)
    p = c.p
    f = states.F_max[1]
    overshoot = math.exp(-math.pi * p.xi_x / math.sqrt(1.0 - p.xi_x**2))
    # Second order in the step: (eta h)^2 / 24 = 7e-7 in the period, less in the distance.
    assert states.X[-1] == pytest.approx((push - f) / p.eta_x**2 * (1.0 + overshoot), rel=1e-6)


def test_a_square_drive_gives_stick_slip_of_the_closed_form_swing():
    h, half, swings = 0.01, 12.0, 80
    c = bench(h, sample__beta=0.0)
    p = c.p
    s, _ = c.rest(Z_R)
    f = s.F_max
    push = 1.05 * f
    n = round(half / h)
    drives = np.zeros((2 * swings * n, 2))
    drives[:, 0] = np.where(np.arange(len(drives)) // n % 2 == 0, push, -push)
    states = held(s, c, drives)
    # Every slip from -A ends at A: A = E + e (E + A), E = (push - f) / eta^2, e the damping of half a period.
    e = math.exp(-math.pi * p.xi_x / math.sqrt(1.0 - p.xi_x**2))
    swing = (push - f) / p.eta_x**2 * (1.0 + e) / (1.0 - e)
    ends = states.X[n::n]
    # Left of the start after 160 slips: e^160 = 1e-8; second order of a slip's distance, 1e-6, over 1 - e = 0.11.
    assert np.abs(ends[-4:]) == pytest.approx(swing, rel=3e-5)
    assert np.sign(ends[-4:]).tolist() == [1.0, -1.0, 1.0, -1.0]
    # One slip of half a damped period per half period of the drive, exact rest for the remainder.
    slipping = np.count_nonzero(states.V_X[-2 * n :]) * h
    assert slipping == pytest.approx(2.0 * math.pi / (p.eta_x * math.sqrt(1.0 - p.xi_x**2)), abs=4.0 * h)


def test_below_friction_the_scanner_rests_exactly():
    c = bench(0.01)
    s, _ = c.rest(Z_R)
    f = s.F_max
    angle = np.linspace(0.0, 2.0 * np.pi, 5000)
    states = held(s, c, 0.999 * f * np.column_stack([np.cos(angle), np.sin(angle)]))
    # Rest is a velocity of exactly zero, not a creep: not one bit of the position changes.
    assert not columns(states, "V_X", "V_Y").any()
    assert not columns(states, "X", "Y").any()
    # Static friction is what the drive needs.
    assert states.F_x[1:] == pytest.approx(0.999 * f * np.cos(angle), abs=1e-12)


def test_just_above_friction_the_scanner_slips():
    c = bench(0.01)
    s, _ = c.rest(Z_R)
    states = held(s, c, np.tile([1.001 * s.F_max, 0.0], (2, 1)))
    assert states.V_X[1] > 0.0


def one_step(angle: float, ratio: float, X: float, Y: float) -> tuple[Any, np.ndarray, float]:
    """State after a step from rest at (X, Y) under a force of `ratio` times friction; that force; friction's bound."""
    c = bench(0.001)
    p = c.p
    s, _ = c.rest(Z_R)
    s.X, s.Y = X, Y
    f = paper_lateral(load(c)).friction(X, Y)
    force = ratio * f * np.array([math.cos(angle), math.sin(angle)])
    # Unequal axes: the springs take a different part of the drive on each.
    drive = force + np.array([p.eta_x**2 * X, p.eta_y**2 * Y])
    return held(s, c, drive[None, :])[-1], force, f


angles, places = st.floats(0.0, 2.0 * math.pi), st.floats(-100.0, 100.0)


@given(angles, st.floats(0.0, 1.0 - 1e-9), places, places)
def test_at_rest_within_the_disc_friction_is_the_applied_force_and_nothing_moves(angle, ratio, X, Y):
    after, force, f = one_step(angle, ratio, X, Y)
    # Case (ii) of the paper. Forces of up to 30 units cancel.
    assert columns(after, "F_x", "F_y") == pytest.approx(force, abs=1e-13 * f + 1e-12)
    assert columns(after, "X", "Y", "V_X", "V_Y").tolist() == [X, Y, 0.0, 0.0]


@given(angles, st.floats(1.0 + 1e-9, 2.0), places, places)
def test_where_slip_begins_friction_lies_along_the_applied_force_in_two_dimensions(angle, ratio, X, Y):
    after, force, f = one_step(angle, ratio, X, Y)
    direction = force / (ratio * f)
    # Case (iii) of the paper: size f along F_a, and the motion starts along it too, as both components of what is left.
    assert columns(after, "F_x", "F_y") == pytest.approx(f * direction, abs=1e-11)
    p = bench(0.001).p
    gained = columns(after, "V_X", "V_Y") * [1.0 + p.h * p.xi_x * p.eta_x, 1.0 + p.h * p.xi_y * p.eta_y] / p.h
    assert gained == pytest.approx((ratio - 1.0) * f * direction, abs=1e-11)


@pytest.mark.parametrize(
    ("settings", "tolerance"),
    [
        ({"_RTOL": 1e-12}, 1e-9),
        ({"_LAUNCH": 5e-4, "_STOPPED": 1e-8, "_MOVING": 0.4}, 1e-9),
        ({"_RTOL": 1e-9, "_ATOL": 1e-10}, 1e-7),
    ],
)
def test_the_reference_agrees_with_itself_under_other_settings(period, monkeypatch, settings, tolerance):
    for name, value in settings.items():
        monkeypatch.setattr(oracle, name, value)
    again = event_driven(
        paper_lateral(load(bench(0.01))),
        lambda t: (AMPLITUDE * math.sin(OMEGA * t),) * 2,
        lambda t: (AMPLITUDE * OMEGA * math.cos(OMEGA * t),) * 2,
        np.arange(141.0),  # three rests and three slips
    )
    # A thousandth of the smallest error that it measures, 1e-6.
    assert np.abs(again.positions - period.positions[:141]).max() < tolerance
