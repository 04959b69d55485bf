"""Claims about friction over load: strength, work of adhesion and pull-off are found within what is told of them."""

import math

import numpy as np
import pytest

from afm_model.analysis import Estimate, friction_load_fit, friction_loop
from afm_model.contact.maugis import pull_off
from afm_model.microscope.verbs import FrictionLoop

from ..microscope.test_local import APPROACH, local

MODULUS, RADIUS, WORK, STRENGTH, REACH = 46e9, 10e-9, 0.1, 0.3e9, 0.165e-9
LOADS = np.array([-4.0, -2.0, 0.0, 5.0, 10.0, 20.0, 30.0, 40.0]) * 1e-9
PULL = math.pi * WORK * RADIUS
"""Unit of force [N]: of DMT a pull-off is 2 of it, of JKR 1.5."""


def _dmt(loads: np.ndarray) -> np.ndarray:
    """Friction by the closed form of DMT: Hertz under the load and the pull-off."""
    return STRENGTH * math.pi * (0.75 * RADIUS * (loads + 2.0 * PULL) / MODULUS) ** (2.0 / 3.0)


def test_closed_forms_are_found_and_amontons_line_is_none_of_them():
    found = friction_load_fit(LOADS, _dmt(LOADS), MODULUS, RADIUS, model="dmt", reach=REACH)
    assert found.strength.value == pytest.approx(STRENGTH, rel=1e-5)
    assert found.work_of_adhesion.value == pytest.approx(WORK, rel=1e-5)
    assert found.pull_off.value == pytest.approx(2.0 * PULL, rel=1e-5)
    assert found.line.rms > 1e3 * found.rms
    assert "DMT is for less than 0.1: use maugis" in found.told
    # JKR: a^3 = 3 R / 4 E (L + 3 F + sqrt(6 F L + 9 F^2)), F = pi w R.
    reached = LOADS + 3.0 * PULL + np.sqrt(6.0 * PULL * LOADS + 9.0 * PULL**2)
    jkr = STRENGTH * math.pi * (0.75 * RADIUS / MODULUS * reached) ** (2.0 / 3.0)
    found = friction_load_fit(LOADS, jkr, MODULUS, RADIUS, model="jkr", reach=REACH)
    assert (found.strength.value, found.work_of_adhesion.value) == pytest.approx((STRENGTH, WORK), rel=1e-5)
    assert found.pull_off.value == pytest.approx(1.5 * PULL, rel=1e-5)


def test_truth_is_within_one_and_two_uncertainties_as_often_as_they_say():
    clean, off = _dmt(LOADS), []
    for seed in range(120):
        noisy = clean + np.random.default_rng(seed).normal(0.0, 0.02e-9, LOADS.size)
        found = friction_load_fit(LOADS, noisy, MODULUS, RADIUS, model="dmt", reach=REACH)
        pairs = (found.strength, STRENGTH), (found.work_of_adhesion, WORK), (found.pull_off, 2.0 * PULL)
        off.append([(each.value - true) / each.uncertainty for each, true in pairs])
    # Three standard deviations of chance: 13 and 6 %.
    one, two = (np.mean(np.abs(off) < limit, axis=0) for limit in (1.0, 2.0))
    assert (np.abs(one - 0.70) < 0.14).all(), one
    assert (two > 0.89).all(), two


def test_uncertainties_of_modulus_and_radius_and_a_measured_pull_off_count():
    def fit(loads, modulus=MODULUS, radius=RADIUS, **more):
        noisy = _dmt(loads) + np.random.default_rng(1).normal(0.0, 0.02e-9, loads.size)
        return friction_load_fit(loads, noisy, modulus, radius, model="dmt", reach=REACH, **more)

    plain = fit(LOADS)
    # tau is as E^(2/3), so that 6 % of E are 4 % of it; the radius also gives the work, pi w R being the pull-off.
    soft = fit(LOADS, modulus=Estimate(MODULUS, 0.06 * MODULUS))
    expected = math.hypot(plain.strength.uncertainty, 0.04 * STRENGTH)
    assert soft.strength.uncertainty == pytest.approx(expected, rel=0.03)
    blunt = fit(LOADS, radius=Estimate(RADIUS, 1e-9))
    assert blunt.work_of_adhesion.uncertainty == pytest.approx(0.1 * WORK, rel=0.1)
    pressed = LOADS[LOADS >= 20e-9]
    far = np.linspace(38e-9, 40e-9, 5)
    assert "give the adhesion of a force curve" in fit(far).told
    helped = fit(far, adhesion=Estimate(2.0 * PULL, 0.05 * PULL))
    assert helped.told.startswith("the Tabor number")
    assert helped.work_of_adhesion.uncertainty < 0.1 * WORK
    with pytest.raises(ValueError, match="needs four loads at least: there are 3"):
        fit(pressed)
    with pytest.raises(ValueError, match="friction does not grow with the load"):
        friction_load_fit(LOADS, -LOADS, MODULUS, RADIUS)
    with pytest.raises(ValueError, match="model = hertz is not allowed: it must be one of"):
        friction_load_fit(LOADS, LOADS, MODULUS, RADIUS, model="hertz")


def test_loops_of_the_simulated_microscope_tell_its_strength_and_work_of_adhesion():
    microscope = local()
    microscope.set_sample({"kind": "flat"})
    microscope.execute(APPROACH)
    loads, widths = np.array([2.0, 5.0, 10.0, 20.0, 30.0]) * 1e-9, []
    for force in loads:
        microscope.set_setpoint(force=float(force))
        loop = microscope.execute(FrictionLoop(length=10e-9, line_rate=10.0)).result
        widths.append(friction_loop(loop.position, loop.lateral).half_width)
    plant = microscope.instrument.parameters.plant
    pair, radius = plant.pair_numbers, plant.cantilever_numbers.tip_radius
    found = friction_load_fit(loads, [each.value for each in widths], 0.75 * pair.K, radius, reach=pair.range)
    assert found.strength.value == pytest.approx(pair.tau, rel=2e-3)
    assert found.work_of_adhesion.value == pytest.approx(pair.work_of_adhesion, rel=5e-3)
    pull = math.pi * pair.work_of_adhesion * radius * pull_off("maugis", plant.transition)
    assert found.pull_off.value == pytest.approx(pull, rel=5e-3)
    assert found.told == ""
