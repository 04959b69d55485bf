"""Claims about the baseline of force curves: slope and interference of light change results within uncertainties."""

import math

import numpy as np
import pytest

from afm_model.analysis import contact_fit, deflection_sensitivity, force_curve
from afm_model.analysis.baseline import Baseline

from .test_curves import made_up as straight_lines
from .test_modulus import RADIUS, WORK, E, K, made_up

CLEAN = made_up("maugis")
BASELINES = {
    "straight": lambda z: 0.0 * z,
    "slope": lambda z: 0.01 * z,
    "falling": lambda z: -0.01 * z,
    "interference": lambda z: 1e-9 * np.sin(2.0 * math.pi * z / 330e-9 + 1.0),
    "interference, 170 nm": lambda z: 0.5e-9 * np.sin(2.0 * math.pi * z / 170e-9 + 4.0),
}


@pytest.mark.parametrize("name", BASELINES)
def test_work_of_adhesion_and_modulus_are_right_within_their_uncertainties_on_any_baseline(rng, name):
    z, d = CLEAN
    d = d + BASELINES[name](z) + 0.02e-9 * rng.standard_normal(z.size)
    found = contact_fit(z, d, K, RADIUS, sensitivity_error=0.0, part="retract")
    assert found.work_of_adhesion.value == pytest.approx(WORK, abs=2.5 * found.work_of_adhesion.uncertainty)
    assert found.work_of_adhesion.uncertainty < 0.1 * WORK
    assert found.modulus.value == pytest.approx(E, abs=2.5 * found.modulus.uncertainty)
    adhesion = force_curve(z, d, K).adhesion
    assert adhesion.value == pytest.approx(-K * (CLEAN[1].min() - 0.3e-9), abs=2.5 * adhesion.uncertainty + 2e-11)


def test_slope_of_the_baseline_is_found_and_changes_no_sensitivity(rng):
    z, d = straight_lines(rng, 0.05e-9)
    sloped = force_curve(z, d + 0.01 * z, 2.0)
    assert sloped.slope.value == pytest.approx(0.01, abs=3.0 * sloped.slope.uncertainty)
    assert sloped.slope.uncertainty < 2e-3
    assert sloped.told == ""
    straight, tilted = (deflection_sensitivity(z, each / 40e-9) for each in (d, d + 0.01 * z))
    assert tilted.value == pytest.approx(straight.value, rel=1e-4)
    # A slope that is not corrected makes the sensitivity wrong by as much.
    assert abs(tilted.value / 40e-9 - 1.0) < 2e-3


def test_baseline_that_is_not_straight_is_named(rng):
    z, d = straight_lines(rng, 0.05e-9)
    d = d + 0.5e-9 * np.sin(2.0 * math.pi * z / 80e-9)
    told = force_curve(z, d, 2.0).told
    assert told.startswith("the baseline is not straight: it deviates by 0.0")
    assert "interference of light or drift" in told
    assert contact_fit(z, d, 2.0, 10e-9, part="retract").told


def draw(rng: np.random.Generator) -> tuple[float, float]:
    """Deviations of the baseline 0 and 30 nm beyond the free part, in their uncertainties."""
    length, samples, noise = rng.uniform(60e-9, 600e-9), int(rng.integers(300, 2000)), 10.0 ** rng.uniform(-11.0, -9.7)
    slope, period, amplitude, phase = (
        rng.normal() * 0.01,
        rng.uniform(1e-7, 7e-7),
        10.0 ** rng.uniform(-10.5, -9),
        6.3 * rng.random(),
    )

    def truth(z: np.ndarray) -> np.ndarray:
        return slope * z + amplitude * np.sin(2.0 * math.pi * z / period + phase)

    z = np.linspace(-length, 0.0, samples)
    made = Baseline(z, truth(z) + noise * rng.standard_normal(samples), 50e-9, 20e-9)
    places = np.array([0.0, 30e-9])
    found = [made.sum_of(1.0, place) for place in places]
    return tuple((each.value - right) / each.uncertainty for each, right in zip(found, truth(places), strict=True))


def test_baseline_in_contact_is_within_two_uncertainties_in_ninety_five_percent_of_all_curves():
    off = np.abs([draw(np.random.default_rng([7, seed])) for seed in range(60)])
    # 95 % less 2.6 standard deviations of the count.
    assert (np.mean(off < 2.0, axis=0) > 0.87).all()
    assert (np.mean(off < 1.0, axis=0) > 0.52).all()
    # Half the uncertainties would be refused.
    assert (np.mean(off < 1.0, axis=0) < 0.9).all()


def test_curve_that_is_padded_by_nan_is_analysed_as_it_was_measured(rng):
    z, d = made_up("maugis", samples=1500)
    d = d + 0.02e-9 * rng.standard_normal(z.size)
    padded = [np.append(each, np.full(40, np.nan)) for each in (z, d)]
    assert force_curve(*padded, K) == force_curve(z, d, K)
    assert deflection_sensitivity(*padded) == deflection_sensitivity(z, d)
    with pytest.raises(ValueError, match="not finite between measured samples"):
        force_curve(z, np.where(np.arange(z.size) == 10, np.nan, d), K)


def test_curve_that_starts_on_the_sample_is_refused():
    z = np.concatenate([np.linspace(0.0, 50e-9, 500), np.linspace(50e-9, 0.0, 500)])
    with pytest.raises(ValueError, match="on the sample from the begin of the approach on: lift it further"):
        force_curve(z, z - 5e-9 + 3e-3 * (z - 25e-9) ** 2 / 25e-9, 0.2)
