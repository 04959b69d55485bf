"""Claims about the nondimensional constants (table 1 and section 4 of the paper)."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_model import InstrumentParameters, build, flatten
from afm_model.plant import plant_constants
from afm_model.plant.constants import FIELDS

from .. import session
from ..rolling import constants, named


def test_constants_of_the_paper():
    p = named(constants(0.01))
    # Each as many digits as given in the derivation from section 4 of the paper.
    assert [p.eta_x, p.eta_y, p.eta_z, p.eta_c] == pytest.approx([0.4204, 0.2558, 0.4311, 1.5080], abs=5e-5)
    assert p.L_s == pytest.approx(2.538, abs=5e-4)
    assert p.f_s == pytest.approx(5.04, abs=5e-3)
    assert p.f_s * 2.0 ** (4.0 / 3.0) == pytest.approx(12.70, abs=5e-3)
    assert (p.w, p.a, p.beta, p.k_x, p.k_y, p.r) == pytest.approx((0.01, 0.0, 0.125, 0.5, 0.5, 0.4), rel=1e-14)
    assert p.h == pytest.approx(0.01, rel=1e-14)


def test_force_units_are_15_nN_lateral_and_60_nN_normal():
    values = InstrumentParameters()
    p = named(constants(0.01))
    assert values.contact.pull_off_force == pytest.approx(p.L_s * session.NORMAL, rel=1e-13)
    assert values.contact.friction_at_pull_off == pytest.approx(p.f_s * session.LATERAL, rel=1e-13)
    assert values.contact.friction_at_pull_off == pytest.approx(75.6e-9, abs=0.05e-9)  # three digits are given


def test_spring_constant_of_the_cantilever_is_1_364_N_per_m():
    values = InstrumentParameters()
    k_c = values.cantilever.m_c * (2.0 * math.pi * values.cantilever.f_c) ** 2
    assert k_c == pytest.approx(1.364, abs=5e-4)  # four digits are given


def test_M_15_bounds_the_friction_up_to_a_load_of_92_nN():
    p = named(constants(0.01))
    load = 92e-9 / session.NORMAL
    assert p.f_s * (1.0 + math.sqrt(1.0 + load / p.L_s)) ** (4.0 / 3.0) == pytest.approx(
        15.0, abs=0.02
    )  # 92 is rounded


def test_work_of_adhesion_is_twice_gamma():
    by_gamma = constants(0.01)
    by_work = constants(0.01, contact__work_of_adhesion=0.808)
    assert by_work == pytest.approx(by_gamma, rel=1e-15)


BUMPS = {"sample.beta": 2e-9, "sample.k_x": 5e8, "sample.k_y": 5e8}
"""A sample smooth enough for the tip to follow it at the speed of this motion: no contact is lost."""


def trajectory(values: dict[str, float]) -> np.ndarray:
    """Deflection, its rate, lateral force, scanner position and velocity [SI] under given voltages."""
    scope = session.instrument(
        {"cantilever.W": 30e-9, "plant.control_period": 5e-6, "detector.sample_period": 5e-6} | values, block_ticks=2000
    )
    for k in range(2000):
        swing = math.sin(1000.0 * k * 5e-6)
        scope.tick(np.array([1.3 * swing, 2.6 * swing, 0.5]))
    y = scope.take_block().measurements
    return np.column_stack([y[:, :3], y[:, 5:11]])


def difference(values: dict[str, float], changed: dict[str, float]) -> float:
    """Largest difference that the change makes, relative to the largest value of each signal."""
    plain, other = trajectory(values), trajectory(values | changed)
    largest = np.abs(plain).max(axis=0)
    assert (largest[[0, 3, 4]] > 1e-9).all()
    return float((np.abs(other - plain).max(axis=0) / largest).max())


# Round-off of 1e-16 per step over 1e4 steps; the motion does not amplify it.
ROUNDING = 1e-11


factors = st.floats(0.1, 10.0)


@settings(max_examples=5)
@given(factors, factors)
def test_trajectory_does_not_depend_on_the_frequency_scale_nor_on_the_length_scales_at_their_ratio(rate, length):
    scales = {"scales.w0": 1e4 * rate, "scales.x0": 2.5e-10 * length, "scales.z0": 1e-7 * length}
    assert difference(BUMPS, scales) < ROUNDING


@settings(max_examples=5)
@given(factors, factors)
def test_trajectory_over_a_flat_sample_does_not_depend_on_any_length_scale(lateral, vertical):
    scales = {"scales.x0": 2.5e-10 * lateral, "scales.z0": 1e-7 * vertical}
    assert difference({"sample.beta": 0.0}, scales) < ROUNDING


def test_ratio_of_the_length_scales_sets_the_curvature_of_the_sample():
    # The curvature is taken in coordinates scaled by x0 and z0: this ratio is part of the model, not a choice of units.
    assert difference(BUMPS, {"scales.x0": 7.5e-10}) > 1e-5


def test_constants_follow_the_parameters_not_the_defaults():
    doubled = {"contact.R": 20e-9, "cantilever.m_c": 3e-9, "scanner.mu": 50.0}
    p = named(plant_constants(build(InstrumentParameters, doubled), 1e-6))
    assert p.r == pytest.approx(0.2, rel=1e-14)
    assert p.mu == 50.0
    # L_s ~ R / m_c; f_s ~ (R |L_s|)^(2/3) / m_p = R^(4/3) / m_p.
    q = named(constants(0.01))
    assert p.L_s == pytest.approx(q.L_s, rel=1e-13)
    assert p.f_s == pytest.approx(q.f_s * 0.5 ** (4.0 / 3.0) * 4.0, rel=1e-13)
    assert p.delta_0 == pytest.approx(q.delta_0 * 0.5 ** (1.0 / 3.0), rel=1e-13)


OWN = {
    "scanner.f_x": "eta_x",
    "scanner.f_y": "eta_y",
    "scanner.f_z": "eta_z",
    "cantilever.f_c": "eta_c",
    "scanner.xi_x": "xi_x",
    "scanner.xi_y": "xi_y",
    "scanner.xi_z": "xi_z",
    "cantilever.xi_c": "xi_c",
    "contact.zeta_n": "zeta_n",
    "cantilever.a": "a",
    "cantilever.W": "w",
    "sample.beta": "beta",
    "sample.k_x": "k_x",
    "sample.k_y": "k_y",
}


@pytest.mark.parametrize(("name", "field"), OWN.items())
def test_each_constant_comes_from_its_own_parameter(name, field):
    default = flatten(InstrumentParameters())[name]
    base = plant_constants(InstrumentParameters(), 1e-6)
    changed = plant_constants(build(InstrumentParameters, {name: 1.1 * default or 1e-8}), 1e-6)
    assert [n for n, x, y in zip(FIELDS, base, changed, strict=True) if x != y] == [field]
    if default:
        assert getattr(named(changed), field) == pytest.approx(1.1 * getattr(named(base), field), rel=1e-14)
