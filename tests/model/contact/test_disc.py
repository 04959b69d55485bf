"""Claims about dry friction as a projection on a disc."""

import math

import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from afm_model.contact.friction import SLIP, STICK, friction_impulse, project_disc

numbers = st.floats(-1e3, 1e3)
radii = st.floats(0.0, 1e3)
ROUNDING = 1e-12  # numbers up to 1e3, a few operations


@given(numbers, numbers, radii)
def test_projection_is_idempotent(x, y, radius):
    once = project_disc(x, y, radius)
    twice = project_disc(once[0], once[1], radius)
    assert twice[:2] == pytest.approx(once[:2], rel=1e-15, abs=1e-300)


@given(numbers, numbers, numbers, numbers, radii)
def test_projection_brings_no_two_points_further_apart(x, y, x2, y2, radius):
    p, q = project_disc(x, y, radius), project_disc(x2, y2, radius)
    assert math.hypot(p[0] - q[0], p[1] - q[1]) <= math.hypot(x - x2, y - y2) + ROUNDING


@given(numbers, numbers, radii, st.floats(0.0, 1.0), st.floats(0.0, 2.0 * math.pi))
def test_projection_is_the_nearest_point_of_the_disc(x, y, radius, share, angle):
    p = project_disc(x, y, radius)
    other = (share * radius * math.cos(angle), share * radius * math.sin(angle))
    # Squares below 1e-300 vanish.
    assert math.hypot(p[0], p[1]) <= radius * (1.0 + 1e-15) + 1e-150
    assert math.hypot(x - p[0], y - p[1]) <= math.hypot(x - other[0], y - other[1]) + ROUNDING


@given(numbers, numbers, radii)
def test_points_of_the_disc_stay_and_others_move_to_its_rim(x, y, radius):
    p_x, p_y, branch = project_disc(x, y, radius)
    if x * x + y * y <= radius * radius:
        assert (p_x, p_y, branch) == (x, y, STICK)
    else:
        assert branch == SLIP
        # Below 1e-150 the square of the distance leaves the range of numbers.
        assume(math.hypot(x, y) > 1e-150)
        assert math.hypot(p_x, p_y) == pytest.approx(radius, rel=1e-15, abs=1e-320)


def test_without_friction_every_motion_slips_and_only_rest_sticks():
    assert project_disc(3.0, 4.0, 0.0) == (0.0, 0.0, SLIP)
    assert project_disc(0.0, 0.0, 0.0) == (0.0, 0.0, STICK)


velocities = st.floats(-1e2, 1e2)
masses = st.floats(1.0, 1.1)
step = (velocities, velocities, velocities, velocities, masses, masses, st.floats(1e-6, 1e2))


@given(*step)
def test_impulse_stops_the_motion_or_has_the_size_of_slipping_friction(p_x, p_y, v_x, v_y, m_x, m_y, radius):
    j_x, j_y, stick = friction_impulse(p_x, p_y, v_x, v_y, m_x, m_y, radius)
    if stick:
        assert (j_x, j_y) == (p_x, p_y)
        assert math.hypot(p_x, p_y) <= radius * (1.0 + 1e-15)
    else:
        assert math.hypot(j_x, j_y) == pytest.approx(radius, rel=1e-14)


@given(*step)
# Friction along the velocity at mid-step would push beyond rest: the momentum lies across it, hardly outside the disc.
@example(1.01, 1e-4, 0.0, 100.0, 1.0, 1.0, 1.0)
def test_friction_dissipates_in_every_step(p_x, p_y, v_x, v_y, m_x, m_y, radius):
    j_x, j_y, _ = friction_impulse(p_x, p_y, v_x, v_y, m_x, m_y, radius)
    power = j_x * (p_x - j_x) / m_x + j_y * (p_y - j_y) / m_y
    # With the velocity at the end of the step. Both branches give j.(p - j) >= 0; only a difference of the two
    # dampings, 8e-5 in the scanner and up to 0.1 here, can turn the velocity against j.
    turned = 0.5 * abs(1.0 / m_x - 1.0 / m_y) * radius * (math.hypot(p_x, p_y) + radius)
    assert power >= -turned - ROUNDING * (1.0 + radius)


@given(st.floats(1.0, 5.0), st.floats(1.0, 100.0), st.floats(0.0, 2.0 * math.pi), st.floats(1e-3, 1e2))
def test_friction_dissipates_near_rest_whatever_the_direction(momentum, speed, angle, radius):
    p = momentum * radius
    v_x, v_y = speed * radius * math.cos(angle), speed * radius * math.sin(angle)
    j_x, j_y, _ = friction_impulse(p, 0.0, v_x, v_y, 1.0, 1.0, radius)
    assert j_x * (p - j_x) - j_y * j_y >= -ROUNDING * radius**2


@given(st.floats(-1e2, 1e2), st.floats(-1e2, 1e2), st.floats(1e-6, 1e2))
def test_friction_alone_never_reverses_a_motion(v_x, v_y, radius):
    j_x, j_y, _ = friction_impulse(v_x, v_y, v_x, v_y, 1.0, 1.0, radius)
    assert (v_x - j_x) * v_x >= 0.0
    assert (v_y - j_y) * v_y >= 0.0


@given(st.floats(1.0, 1e2), st.floats(0.0, 2.0 * math.pi), st.floats(1e-6, 0.05))
def test_slipping_friction_opposes_the_velocity(speed, angle, radius):
    v_x, v_y = speed * math.cos(angle), speed * math.sin(angle)
    j_x, j_y, stick = friction_impulse(v_x, v_y, v_x, v_y, 1.0, 1.0, radius)
    assert not stick
    assert (j_x, j_y) == pytest.approx((radius * math.cos(angle), radius * math.sin(angle)), abs=ROUNDING)
