"""Claims about modulus and adhesion from force curves: made-up curves with noise, and curves of the simulator."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from afm_model.analysis import (
    ContactFit,
    Estimate,
    along_normal,
    contact_fit,
    tilted_deflection,
    tilted_stiffness,
    young,
)
from afm_model.contact.maugis import MODELS, branch, pull_off

from .bench import curve

E, WORK, RADIUS, K, REACH = 3.5e9, 0.08, 10e-9, 5.0, 0.165e-9
"""E* [Pa], work of adhesion [J/m^2], radius [m], spring constant [N/m], range of the adhesive stress [m]."""
ZERO = 0.3e-9
"""Deflection of the free cantilever [m]."""


def made_up(
    model: str,
    stiffness: float = K,
    modulus: float = E,
    top: float = 20e-9,
    samples: int = 4000,
    work: float = WORK,
    radius: float = RADIUS,
) -> tuple[np.ndarray, np.ndarray]:
    """z and deflection of a curve, from the exact contact by bisection at each sample; free before contact."""
    reduced = 4.0 / 3.0 * modulus
    force = math.pi * work * radius
    length = (math.pi**2 * work**2 * radius / reduced**2) ** (1.0 / 3.0)
    stress = 16.0 / (9.0 * math.sqrt(3.0)) * work / REACH
    exact = branch(model, 2.0 * stress * (radius / (math.pi * work * reduced**2)) ** (1.0 / 3.0))
    indentation = exact.least_indentation + np.linspace(0.0, (1.5 * top / force + 3.0) ** (1.0 / 3.0), 20_001) ** 2
    bent = force / stiffness * exact.solve(indentation)[1]
    way = length * indentation + bent
    off = int(np.argmin(way))
    way, bent = way[off:], bent[off:]
    far = float(np.interp(top / stiffness, bent, way))
    z_in = np.linspace(2.0 * way[0] - 40e-9, far, samples)
    z_out = z_in[::-1]
    d_in = np.where(z_in > max(way[0], 0.2e-9), np.interp(z_in, way, bent), 0.0)
    d_out = np.where(z_out >= way[0], np.interp(z_out, way, bent), 0.0)
    return np.concatenate([z_in, z_out]), np.concatenate([d_in, d_out]) + ZERO


def fit(z: np.ndarray, d: np.ndarray, **more: Any) -> ContactFit:
    return contact_fit(z, d, K, RADIUS, **({"sensitivity_error": 0.0} | more))


@pytest.mark.parametrize("model", MODELS)
def test_contact_of_a_curve_without_noise_is_recovered_within_a_thousandth(model):
    found = fit(*made_up(model), model=model)
    assert found.modulus.value == pytest.approx(E, rel=1e-3)
    assert found.work_of_adhesion.value == pytest.approx(WORK, rel=2e-3)
    assert found.contact_point == pytest.approx(0.0, abs=1e-12)
    # Way of the scanner, less what the cantilever bends.
    assert found.indentation == pytest.approx(made_up(model)[0].max() - made_up(model)[1].max() + ZERO, rel=1e-3)
    tabor = (RADIUS * WORK**2 / (E**2 * REACH**3)) ** (1.0 / 3.0)
    assert found.tabor.value == pytest.approx(tabor, rel=3e-3)
    most = pull_off(model, 1.157 * tabor) * math.pi * WORK * RADIUS
    assert found.pull_off.value == pytest.approx(most, rel=3e-3)


def test_contact_does_not_depend_on_where_z_is_counted_from():
    z, d = made_up("maugis")
    here, there = fit(z, d), fit(z + 40e-6, d)
    assert there.contact_point - 40e-6 == pytest.approx(here.contact_point, abs=1e-13)
    assert there.modulus.value == pytest.approx(here.modulus.value, rel=1e-5)


@pytest.mark.parametrize("noise", [0.0, 0.02e-9])
def test_work_of_adhesion_of_a_soft_sample_is_recovered_though_its_pull_is_bent(rng, noise):
    work, radius = 0.05, 500e-9
    z, d = made_up("jkr", stiffness=2.0, modulus=5e6, top=150e-9, work=work, radius=radius)
    found = contact_fit(
        z, d + noise * rng.standard_normal(z.size), 2.0, radius, model="jkr", part="retract", sensitivity_error=0.0
    )
    assert found.work_of_adhesion.value == pytest.approx(work, rel=1e-3)
    assert found.modulus.value == pytest.approx(5e6, rel=3e-3)


@pytest.mark.parametrize("memory", [0.0, 0.95])
def test_uncertainties_are_those_of_repeated_noise_with_its_correlation(rng, memory):
    z, d = made_up("dmt", samples=2000)
    values, told = [], []
    for _ in range(24):
        noise = lfilter([math.sqrt(1.0 - memory**2)], [1.0, -memory], rng.standard_normal(z.size))
        found = fit(z, d + 0.05e-9 * noise, model="dmt", part="retract")
        values.append((found.modulus.value, found.work_of_adhesion.value))
        told.append((found.modulus.uncertainty, found.work_of_adhesion.uncertainty))
    scatter, of_told = np.std(values, axis=0), np.median(told, axis=0)
    # 24 repetitions know a standard deviation to 15 %. With white noise more is told: the
    # correlation is the longer one of two that were measured, and half of what noise adds to the lowest sample counts.
    assert 0.65 < of_told[0] / scatter[0] < 2.2
    assert 0.65 < of_told[1] / scatter[1] < 2.5
    assert np.mean(values, axis=0)[0] == pytest.approx(E, abs=1.0 * scatter[0])


def test_correlated_noise_makes_the_modulus_less_certain_than_white_noise_of_the_same_size(rng):
    z, d = made_up("dmt")
    white = rng.standard_normal(z.size)
    slow = lfilter([math.sqrt(1.0 - 0.95**2)], [1.0, -0.95], white)
    told = [fit(z, d + 0.05e-9 * noise, model="dmt", part="retract").modulus.uncertainty for noise in (white, slow)]
    # A correlation time of 39 samples: six times the uncertainty.
    assert 3.0 < told[1] / told[0] < 12.0


def test_model_that_is_not_for_this_tabor_number_is_told(rng):
    z, d = made_up("maugis")
    d = d + 0.02e-9 * rng.standard_normal(z.size)
    assert fit(z, d).told == ""
    assert "DMT is for less than 0.1: use maugis" in fit(z, d, model="dmt").told
    assert "JKR is for more than 5: use maugis" in fit(z, d, model="jkr").told


def test_stiff_sample_under_a_soft_cantilever_tells_no_modulus_and_says_so(rng):
    z, d = made_up("maugis", stiffness=0.2, modulus=50e9)
    found = contact_fit(z, d + 0.1e-9 * rng.standard_normal(z.size), 0.2, RADIUS)
    assert found.modulus.uncertainty > 0.3 * found.modulus.value
    z, d = made_up("maugis", stiffness=0.02, modulus=50e9, top=5e-9)
    soft = contact_fit(z, d + 0.5e-9 * rng.standard_normal(z.size), 0.02, RADIUS)
    assert soft.modulus.uncertainty > 0.5 * soft.modulus.value
    assert "does not determine the modulus" in soft.told
    assert "take a stiffer cantilever" in soft.told
    # The adhesion is told all the same.
    assert found.work_of_adhesion.value == pytest.approx(WORK, rel=0.15)


def test_what_is_known_within_limits_counts_in_the_uncertainty():
    z, d = made_up("dmt")
    exact = contact_fit(z, d, K, RADIUS, model="dmt", sensitivity_error=0.0)
    # From F = K sqrt(R) d^(3/2) at a large load: E* goes with the root of the radius inversely, and with k.
    blunt = contact_fit(z, d, K, Estimate(RADIUS, 0.2 * RADIUS), model="dmt", sensitivity_error=0.0)
    assert blunt.modulus.uncertainty / E == pytest.approx(0.1, rel=0.2)
    stiff = contact_fit(z, d, Estimate(K, 0.1 * K), RADIUS, model="dmt", sensitivity_error=0.0)
    assert stiff.modulus.uncertainty / E == pytest.approx(0.1, rel=0.2)
    scaled = contact_fit(z, d, K, RADIUS, model="dmt", sensitivity_error=0.02)
    assert scaled.modulus.uncertainty > 5.0 * exact.modulus.uncertainty
    assert exact.modulus.value == pytest.approx(E, rel=1e-3)


def test_range_of_the_adhesive_stress_can_be_left_open(rng):
    z, d = made_up("maugis")
    found = fit(z, d + 0.02e-9 * rng.standard_normal(z.size), reach=Estimate(REACH, REACH), part="retract")
    assert found.modulus.value == pytest.approx(E, abs=3.0 * found.modulus.uncertainty)
    # The shape hardly tells it: the Tabor number is uncertain by as much as the range.
    assert found.tabor.uncertainty > 0.3 * found.tabor.value


LEVER = {
    "plant.k": 2.8,
    "plant.f0": 75e3,
    "plant.Q": 200.0,
    "plant.width": 28e-6,
    "plant.thickness": 3e-6,
    "plant.pair": "si_polystyrene",
    "plant.dt": 0.25e-6,
    "plant.gap": 20e-9,
    "reference.ramp": 80e-9,
    "reference.trigger_force": 30e-9,
}
"""A cantilever stiff enough for polystyrene."""


def test_modulus_of_a_simulated_polymer_is_recovered_within_two_percent_and_one_thousandth_without_friction():
    for values, most, of_work, part in (
        (LEVER, 0.02, 0.04, "both"),
        (LEVER | {"plant.tau": 1e3}, 1e-3, 5e-3, "retract"),
    ):
        record = curve(values)
        pair = record.done.parameters.plant.pair_numbers
        found = contact_fit(record.z, record.deflection, 2.8, RADIUS, sensitivity_error=0.0, part=part)
        assert found.modulus.value == pytest.approx(0.75 * pair.K, rel=most)
        assert found.work_of_adhesion.value == pytest.approx(pair.work_of_adhesion, rel=of_work)
        assert found.told == ""


@pytest.mark.parametrize("angle", [-0.028, 0.028])
def test_modulus_on_a_slope_is_recovered_along_its_normal_and_wrong_by_percents_without(angle):
    tilted = LEVER | {"plant.tilt": 0.2, "plant.tau": 1e3, "sample.kind": "plane", "sample.angle_y": angle}
    record = curve(tilted)
    plant = record.done.parameters.plant
    c = plant.cantilever_numbers
    geometry = (0.2, c.tip_height + 0.5 * c.thickness, c.length)
    # Vertical, as by the sensitivity of a curve on a flat sample.
    vertical = record.deflection / tilted_deflection(*geometry)
    E_star = 0.75 * plant.pair_numbers.K

    def modulus(z: np.ndarray, deflection: np.ndarray, k: float) -> float:
        fit = contact_fit(z, deflection, k, RADIUS, sensitivity_error=0.0, part="retract")
        return fit.modulus.value

    corrected = along_normal(record.z, vertical, 2.8, math.tan(angle), *geometry)
    assert modulus(*corrected) == pytest.approx(E_star, rel=1e-3)
    wrong = modulus(record.z, vertical, tilted_stiffness(2.8, *geometry)) / E_star - 1.0
    # -2.4 times the angle by the geometry; the baseline takes a third of it, as a slope.
    assert -2.5 < wrong / angle < -1.2


def test_modulus_of_a_simulated_oxide_is_not_told_by_a_soft_cantilever():
    record = curve({})
    found = contact_fit(record.z, record.deflection, 0.2, RADIUS)
    assert found.modulus.uncertainty > 0.5 * found.modulus.value
    assert found.told.startswith("the curve does not determine the modulus, only that E* is above")
    bound = float(found.told.split("above ")[1].split(" Pa")[0])
    assert 0.0 < bound < 0.75 * record.done.parameters.plant.pair_numbers.K


def test_young_modulus_takes_off_what_the_tip_gives_way():
    E_sample, nu, tip = 3.2e9, 0.33, (169e9, 0.27)
    E_star = 1.0 / ((1.0 - nu**2) / E_sample + (1.0 - tip[1] ** 2) / tip[0])
    found = young(Estimate(E_star, 0.01 * E_star), nu, tip)
    assert found.value == pytest.approx(E_sample)
    assert found.uncertainty / E_sample == pytest.approx(0.01 * E_sample / (1.0 - nu**2) / E_star)
    with pytest.raises(ValueError, match="above that of the tip alone"):
        young(Estimate(300e9, 0.0), nu, tip)


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"model": "hertz"}, "model = hertz is not allowed: it must be one of maugis, jkr, dmt"),
        ({"part": "all"}, "part = all is not allowed"),
        ({"sensitivity_error": 1.5}, "sensitivity_error = 1.5 is not allowed"),
        ({"reach": 0.0}, "reach = 0 is not allowed: it must be > 0"),
    ],
)
def test_what_is_not_allowed_is_refused_in_a_sentence(more, told):
    with pytest.raises(ValueError, match=told):
        fit(*made_up("dmt"), **more)


def test_curve_whose_tip_does_not_come_off_or_is_sampled_coarsely_is_refused():
    z, d = made_up("dmt")
    ends = z.size // 2 + int(np.argmin(d[z.size // 2 :]))
    with pytest.raises(ValueError, match="the retract ends before the tip comes off"):
        fit(z[: ends - 5], d[: ends - 5])
    with pytest.raises(ValueError, match="points of the approach are in contact"):
        fit(*made_up("dmt", samples=60))
