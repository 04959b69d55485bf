"""Claims about the nondimensional constants (table 1 and section 4 of the paper)."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from afm_model import InstrumentParameters, build, flatten
from afm_model.plant import plant_constants
from afm_model.sample import PAPER

from .. import session
from ..rolling import bench


def test_constants_of_the_paper():
    c = bench(0.01)
    p = c.p
    # Each as many digits as given in the derivation from section 4 of the paper.
    assert [p.eta_x, p.eta_y, p.eta_z, p.eta_c] == pytest.approx([0.4204, 0.2558, 0.4311, 1.5080], abs=5e-5)
    assert p.L_s == pytest.approx(2.538, abs=5e-4)
    assert p.f_s == pytest.approx(5.04, abs=5e-3)
    assert p.f_s * 2.0 ** (4.0 / 3.0) == pytest.approx(12.70, abs=5e-3)
    assert (p.w, p.a, p.r) == pytest.approx((0.01, 0.0, 0.4), rel=1e-14)
    assert (c.sample.beta, c.sample.k_x, c.sample.k_y) == pytest.approx((0.125, 0.5, 0.5), rel=1e-14)
    assert p.h == pytest.approx(0.01, rel=1e-14)


def test_force_units_are_15_nN_lateral_and_60_nN_normal():
    values = InstrumentParameters()
    p = bench(0.01).p
    assert values.contact.pull_off_force == pytest.approx(p.L_s * session.NORMAL, rel=1e-13)
    assert values.contact.friction_at_pull_off == pytest.approx(p.f_s * session.LATERAL, rel=1e-13)
    assert values.contact.friction_at_pull_off == pytest.approx(75.6e-9, abs=0.05e-9)  # three digits are given


def test_spring_constant_of_the_cantilever_is_1_364_N_per_m():
    values = InstrumentParameters()
    k_c = values.cantilever.m_c * (2.0 * math.pi * values.cantilever.f_c) ** 2
    assert k_c == pytest.approx(1.364, abs=5e-4)  # four digits are given


def test_M_15_bounds_the_friction_up_to_a_load_of_92_nN():
    p = bench(0.01).p
    load = 92e-9 / session.NORMAL
    assert p.f_s * (1.0 + math.sqrt(1.0 + load / p.L_s)) ** (4.0 / 3.0) == pytest.approx(
        15.0, abs=0.02
    )  # 92 is rounded


def test_work_of_adhesion_is_twice_gamma():
    by_work = build(InstrumentParameters, {"contact.work_of_adhesion": 0.808})
    assert plant_constants(by_work) == pytest.approx(plant_constants(InstrumentParameters()), rel=1e-15)


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
    return np.column_stack([y.deflection, y.deflection_rate, y.lateral_force, y.position, y.velocity])


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
    doubled = {"contact.R": 20e-9, "cantilever.m_c": 3e-9, "scanner.mass_ratio": 50.0}
    p = bench(0.01, **{name.replace(".", "__"): value for name, value in doubled.items()}).p
    assert p.r == pytest.approx(0.2, rel=1e-14)
    assert p.mu == 50.0
    # L_s ~ R / m_c; f_s ~ (R |L_s|)^(2/3) / m_p = R^(4/3) / m_p.
    q = bench(0.01).p
    assert p.L_s == pytest.approx(q.L_s, rel=1e-13)
    assert p.f_s == pytest.approx(q.f_s * 0.5 ** (4.0 / 3.0) * 4.0, rel=1e-13)
    assert p.delta_0 == pytest.approx(q.delta_0 * 0.5 ** (1.0 / 3.0), rel=1e-13)


OWN = {
    "plant.dt": {"h": 1, "inverse_h": -1},
    "scanner.f_x": {"eta_x": 1, "spring_x": 2, "gain_x": 2},
    "scanner.f_y": {"eta_y": 1, "spring_y": 2, "gain_y": 2},
    "scanner.f_z": {"eta_z": 1, "spring_z": 2, "gain_z": 2},
    "cantilever.f_c": {"eta_c": 1, "spring_c": 2},
    "scanner.xi_x": {"xi_x": 1},
    "scanner.xi_y": {"xi_y": 1},
    "scanner.xi_z": {"xi_z": 1},
    "cantilever.xi_c": {"xi_c": 1},
    "contact.zeta_n": {"zeta_n": 1},
    "cantilever.a": {"a": 1},
    "cantilever.W": {"w": 1},
    "sample.beta": {"beta": 1},
    "sample.k_x": {"k_x": 1},
    "sample.k_y": {"k_y": 1},
    "piezo.sensitivity_x": {"gain_x": 1},
    "piezo.sensitivity_y": {"gain_y": 1},
    "piezo.sensitivity_z": {"gain_z": 1},
}
"""What each parameter sets, and with which power of it."""


def all_constants(values: dict[str, float]) -> dict[str, float]:
    """Constants of the plant and of its sample by name."""
    parameters = build(InstrumentParameters, values)
    return {**plant_constants(parameters), **PAPER.values(parameters)}


@pytest.mark.parametrize(("name", "own"), OWN.items())
def test_each_constant_comes_from_its_own_parameter(name, own):
    default = flatten(InstrumentParameters())[name]
    new = 1.1 * default or 1e-8
    together = {"detector.sample_period": new, "plant.control_period": new} if name == "plant.dt" else {}
    base, changed = all_constants({}), all_constants({name: new} | together)
    differ = {field for field in base if base[field] != changed[field]}
    assert {field for field in differ if not field.startswith(("keep_", "take_"))} == set(own)
    for axis in "xyzc":
        before, after = (c["h"] * c[f"xi_{axis}"] * c[f"eta_{axis}"] for c in (base, changed))
        assert (f"keep_{axis}" in differ) == (f"take_{axis}" in differ) == (before != after)
        assert changed[f"keep_{axis}"] == pytest.approx(1.0 - after, rel=1e-15)
        assert changed[f"take_{axis}"] == pytest.approx(1.0 / (1.0 + after), rel=1e-15)
    if default:
        for field, power in own.items():
            assert changed[field] == pytest.approx(1.1**power * base[field], rel=1e-14)


def test_a_volt_is_a_static_displacement_of_one_sensitivity():
    p = all_constants({"piezo.sensitivity_x": 10e-9, "piezo.sensitivity_y": 20e-9, "piezo.sensitivity_z": 30e-9})
    displaced = [p["gain_x"] / p["eta_x"] ** 2, p["gain_y"] / p["eta_y"] ** 2, p["gain_z"] / p["eta_z"] ** 2]
    assert np.array(displaced) * [session.X0, session.X0, session.Z0] == pytest.approx([10e-9, 20e-9, 30e-9], rel=1e-14)


def test_constants_in_SI_are_the_units_of_what_a_plant_tells():
    p = all_constants({})
    assert (p["x0"], p["z0"]) == (session.X0, session.Z0)
    assert (p["lateral_speed"], p["vertical_speed"]) == pytest.approx((2.5e-6, 1e-3), rel=1e-14)
    assert (p["lateral_force"], p["normal_force"]) == pytest.approx((session.LATERAL, session.NORMAL), rel=1e-14)
