"""Claims about the JKR contact, against the equations of section 1 of the paper."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_model.contact import jkr

R_E, K, GAMMA = 40e-9, 44.80e9, 0.404
PULL_OFF = 3.0 * math.pi * R_E * GAMMA
ROUNDING = 1e-14  # a dozen operations on numbers of order one
loads = st.floats(-1.0, 1e3)
branch = st.floats(jkr.U_FIXED_GRIPS, 10.0)


def printed_radius(load: float) -> float:
    """Contact radius as printed in section 1."""
    adhesion = 6.0 * math.pi * R_E * GAMMA
    root = math.sqrt(max(2.0 * adhesion * load + adhesion**2, 0.0))
    return (R_E / K * (load + adhesion + root)) ** (1.0 / 3.0)


@given(st.floats(-0.999, 1e3))
def test_contact_radius_is_the_printed_equation(load_ratio):
    load = load_ratio * PULL_OFF
    # The square root at pull-off turns round-off 1e-16 into 1e-8 of the radius; 1e-3 above it, into 1e-13.
    assert jkr.contact_radius(load, R_E, K, GAMMA) == pytest.approx(printed_radius(load), rel=1e-12)


def test_radius_at_zero_load_is_8_16_nm():
    # Three digits are given in the derivation from the paper's values.
    assert jkr.radius_at_zero_load(R_E, K, GAMMA) == pytest.approx(8.16e-9, abs=0.005e-9)
    assert jkr.contact_radius(0.0, R_E, K, GAMMA) == pytest.approx(printed_radius(0.0), rel=ROUNDING)


def test_contact_area_at_pull_off_is_pi_times_a_cube_root_of_3_pi_gamma_R2_over_K_squared():
    area = math.pi * jkr.contact_radius(-PULL_OFF, R_E, K, GAMMA) ** 2
    assert area == pytest.approx(math.pi * (3.0 * math.pi * GAMMA * R_E**2 / K) ** (2.0 / 3.0), rel=ROUNDING)


def test_no_load_below_pull_off_has_an_equilibrium():
    with pytest.raises(ValueError, match="pull-off"):
        jkr.contact_radius(-1.000001 * PULL_OFF, R_E, K, GAMMA)


def test_pull_off_at_fixed_load_is_the_least_load_and_stands_at_u3_one_half():
    u = np.linspace(jkr.U_FIXED_GRIPS, 2.0, 200_001)
    loads = np.array([jkr.load_of_u(x) for x in u])
    # A grid step of 7e-6 misses the minimum by its square.
    assert loads.min() == pytest.approx(-1.0, abs=1e-9)
    assert u[loads.argmin()] ** 3 == pytest.approx(0.5, abs=2e-5)


def test_static_pull_off_force_is_3_pi_gamma_R():
    # Force against indentation, scanned as a displacement-controlled experiment would.
    d = np.linspace(jkr.INDENTATION_FIXED_GRIPS, 0.5, 100_001)
    force = np.array([jkr.load_of_u(jkr.u_of_indentation(x)) for x in d]) * PULL_OFF
    assert PULL_OFF == pytest.approx(152.3e-9, abs=0.05e-9)  # four digits are given
    assert force.min() == pytest.approx(-PULL_OFF, rel=1e-9)  # square of the grid step


def test_the_stiffness_vanishes_at_pull_off_and_diverges_at_the_fixed_grips_limit():
    assert jkr.stiffness_of_u(0.5 ** (1.0 / 3.0)) == pytest.approx(0.0, abs=ROUNDING)
    assert jkr.stiffness_of_u(jkr.U_FIXED_GRIPS * (1.0 + 1e-9)) < -1e8


def test_fixed_grips_limit_is_minus_0_2752():
    assert jkr.INDENTATION_FIXED_GRIPS == pytest.approx(-0.2752, abs=5e-5)  # four digits are given
    assert jkr.INDENTATION_FIXED_GRIPS == pytest.approx(-0.5 * (1.0 / 6.0) ** (1.0 / 3.0), rel=ROUNDING)


def test_surfaces_that_meet_snap_in_with_8_9_of_the_pull_off_force():
    assert jkr.load_of_u(jkr.u_of_indentation(0.0)) == pytest.approx(-8.0 / 9.0, rel=ROUNDING)


@given(loads)
def test_indentation_is_the_printed_equation(load_ratio):
    a_0 = jkr.radius_at_zero_load(R_E, K, GAMMA)
    u = jkr.u_of_load(load_ratio)
    a = u**2 * a_0
    printed = a**2 / R_E * (1.0 - 2.0 / 3.0 * (a_0 / a) ** 1.5)
    # The bracket cancels near zero indentation: compare on the scale a0^2 / R_e.
    scale = a_0**2 / R_E
    assert jkr.indentation_of_u(u) * scale == pytest.approx(printed, rel=1e-13, abs=1e-14 * scale)


@given(loads)
def test_friction_ratio_is_one_plus_root_one_plus_load_to_the_four_thirds(load_ratio):
    ratio = (jkr.u_of_load(load_ratio) / jkr.u_of_load(-1.0)) ** 4
    assert ratio == pytest.approx((1.0 + math.sqrt(1.0 + load_ratio)) ** (4.0 / 3.0), rel=ROUNDING)


@given(loads)
def test_load_of_u_inverts_u_of_load(load_ratio):
    # Near pull-off the square root costs half of the digits of 1 + L, none of those of L.
    assert jkr.load_of_u(jkr.u_of_load(load_ratio)) == pytest.approx(load_ratio, rel=1e-13, abs=1e-14)


@given(st.one_of(st.floats(jkr.INDENTATION_FIXED_GRIPS, 5.0), st.floats(5.0, 1e30)))
def test_u_of_indentation_solves_the_quartic(d):
    u = jkr.u_of_indentation(d)
    assert u >= jkr.U_FIXED_GRIPS
    # A few roundings of u.
    assert jkr.indentation_of_u(u) == pytest.approx(d, rel=2e-15, abs=1e-15)


@given(branch)
def test_u_of_indentation_inverts_indentation_of_u(u):
    # d(delta)/du vanishes at the fold: round-off there costs half of the digits.
    slope = abs(4.0 * u**3 - 2.0 / 3.0)
    tolerance = 1e-13 + min(1e-14 / max(slope, 1e-300), 1e-7)
    assert jkr.u_of_indentation(jkr.indentation_of_u(u)) == pytest.approx(u, rel=tolerance)


@given(st.floats(-10.0, jkr.INDENTATION_FIXED_GRIPS))
def test_beyond_the_fixed_grips_limit_the_branch_ends(d):
    assert jkr.u_of_indentation(d) == jkr.U_FIXED_GRIPS


@given(st.floats(-0.27, 10.0))
def test_stiffness_is_the_slope_of_the_force(d):
    step = 1e-5 * max(1.0, abs(d))

    def force(x: float) -> float:
        return jkr.load_of_u(jkr.u_of_indentation(x))

    slope = (force(d + step) - force(d - step)) / (2.0 * step)
    stiffness = jkr.stiffness_of_u(jkr.u_of_indentation(d))
    # Central difference: third derivative times step^2, large only near the fold, 0.005 away at the nearest.
    assert slope == pytest.approx(stiffness, rel=1e-5, abs=1e-5)


def test_load_that_pulls_has_no_contact_without_adhesion():
    with pytest.raises(ValueError, match="without adhesion there is no contact"):
        jkr.hertz_radius(-1e-9, R_E, K)


def test_without_adhesion_the_contact_is_that_of_hertz():
    load = 100e-9
    # The correction to the radius is of the order sqrt(|L_s| / L) / 3 * 2.
    faint = 1e-14
    assert jkr.contact_radius(load, R_E, K, faint) == pytest.approx(jkr.hertz_radius(load, R_E, K), rel=1e-5)


def test_adhesion_enlarges_the_contact():
    for load in (0.0, 10e-9, 1e-6):
        assert jkr.contact_radius(load, R_E, K, GAMMA) > jkr.hertz_radius(load, R_E, K)
