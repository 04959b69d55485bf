"""Claims about the spring constant from a thermal record: made-up records of a known spectrum, then the simulator."""

import math

import numpy as np
import pytest

from afm_model import Controller, ControllerParameters, Instrument, InstrumentParameters, build
from afm_model.analysis import Estimate, deflection_sensitivity, spring_constant, thermal

from .bench import curve

KT = 1.380649e-23 * 295.0
RATE, SENSITIVITY = 500e3, 60e-9


def record(k: float, f0: float, Q: float, noise: float, duration: float, seed: int) -> np.ndarray:
    """Voltage of a cantilever as a photodiode shows it [V], white noise `noise` [m/sqrt(Hz)] added; n random phases."""
    n = round(duration * RATE)
    f = np.fft.rfftfreq(n, 1.0 / RATE)
    variance = 0.817428 * KT / k
    density = 2.0 * variance / (math.pi * f0 * Q) / ((1.0 - (f / f0) ** 2) ** 2 + (f / (f0 * Q)) ** 2) + noise**2
    generator = np.random.default_rng(seed)
    pair = generator.standard_normal((2, len(f)))
    return np.fft.irfft((pair[0] + 1j * pair[1]) * np.sqrt(density * RATE * n) / 2.0, n) / SENSITIVITY


@pytest.mark.parametrize(
    ("k", "f0", "Q", "noise"), [(0.2, 23e3, 40.0, 100e-15), (40.0, 170e3, 400.0, 100e-15), (0.05, 12e3, 15.0, 1e-12)]
)
def test_spring_constants_of_made_up_records_scatter_about_the_true_one_as_the_uncertainty_tells(k, f0, Q, noise):
    found = [spring_constant(record(k, f0, Q, noise, 0.5, seed), RATE, SENSITIVITY, 295.0) for seed in range(12)]
    for name, true in (("k", k), ("f0", f0), ("Q", Q), ("floor", noise)):
        values, errors = np.array([getattr(each, name) for each in found]).T
        off = (values - true) / errors
        # Twelve standard normal numbers: their mean and their mean square within three standard errors and more.
        assert abs(off.mean()) < 3.0 / 12.0**0.5
        assert 0.2 < np.mean(off**2) < 1.0 + 3.0 * (2.0 / 12.0) ** 0.5
    # Cannot be better than the independent swings in the record.
    assert found[0].k.uncertainty > 0.9 * k * math.sqrt(Q / (math.pi * f0 * 0.5))


def test_drift_and_a_tilted_cantilever_are_taken_into_account():
    volts = record(0.2, 23e3, 40.0, 100e-15, 1.0, 0)
    plain = spring_constant(volts, RATE, SENSITIVITY, 295.0)
    drifting = volts + np.linspace(0.0, 1.0, len(volts))
    assert spring_constant(drifting, RATE, SENSITIVITY, 295.0).k.value == pytest.approx(plain.k.value, rel=1e-2)
    # A tip that slides: the end moves at right angles to the cantilever, its vertical part is that of the sample.
    tilted = spring_constant(volts, RATE, SENSITIVITY * math.cos(0.2), 295.0, tilt=0.2)
    assert tilted.k.value == pytest.approx(plain.k.value, rel=1e-9)
    # A sensitivity known to 3 % makes it worse by 6 %.
    rough = spring_constant(volts, RATE, Estimate(SENSITIVITY, 0.03 * SENSITIVITY), 295.0)
    assert rough.k.uncertainty == pytest.approx(math.hypot(plain.k.uncertainty, 0.06 * plain.k.value), rel=1e-9)


@pytest.mark.parametrize(("f0", "Q"), [(23e3, 40.0), (13e3, 80.0)])
def test_second_mode_that_an_adc_of_100_khz_folds_beside_the_first_one_changes_nothing(f0, Q):
    """Folded from 6.27 f0 to 44 kHz or 18.5 kHz, with 0.251 of k_B T / k; both modes alone at the full rate."""
    ratios = []
    for seed in range(8):
        first = record(0.2, f0, Q, 1e-15, 1.0, seed)
        second = math.sqrt(0.251 / 0.817428) * record(0.2, 6.2669 * f0, Q, 1e-15, 1.0, 100 + seed)
        alone = spring_constant(first, RATE, SENSITIVITY, 295.0)
        folded = spring_constant((first + second)[::5], RATE / 5.0, SENSITIVITY, 295.0)
        assert folded.f0.value == pytest.approx(f0, rel=5e-3)
        ratios.append(folded.k.value / alone.k.value)
    assert np.mean(ratios) == pytest.approx(1.0, abs=5e-3)


@pytest.mark.parametrize("tilt", [0.2, -0.3])
def test_sensitivity_of_a_simulated_curve_of_a_tilted_cantilever_gives_its_hidden_spring_constant(tilt):
    """The record is made up for the hidden k; the sensitivity is what a curve of the simulator on graphite says."""
    measured = curve({"plant.tilt": tilt, "plant.pair": "si_graphite"})
    sensitivity = deflection_sensitivity(measured.z, measured.voltage)
    shown = measured.done.parameters.detector.deflection_sensitivity
    volts = record(0.2, 23e3, 40.0, 100e-15, 1.0, 0) * SENSITIVITY / shown
    c = measured.done.parameters.plant.cantilever_numbers
    tip = {"tip_height": c.tip_height + 0.5 * c.thickness, "length": c.length}
    plain = spring_constant(volts, RATE, shown, 295.0)
    found = spring_constant(volts, RATE, sensitivity, 295.0, tilt=tilt, **tip)
    # What is left is what the contact gives way, 0.2 %, twice, and friction.
    assert found.k.value == pytest.approx(plain.k.value, rel=8e-3)
    assert abs(spring_constant(volts, RATE, sensitivity, 295.0).k.value / plain.k.value - 1.0) > 0.05


def test_the_simulated_cantilever_gets_its_own_spring_constant_back_within_three_per_cent():
    values = {
        "plant.kind": "lever", "sample.kind": "flat", "plant.gap": 1e-6, "plant.temperature": 295.0, "plant.Q": 20.0,
        "plant.control_period": 1e-4, "detector.sample_period": 1.0 / RATE,
        "detector.deflection_sensitivity": SENSITIVITY, "detector.noise": 2e-5,
        "reference.amplitude_x": 0.0, "reference.amplitude_y": 0.0,
    }  # fmt: skip
    parameters = build(InstrumentParameters, values)
    scope, law = Instrument(parameters, 1000), Controller(build(ControllerParameters, {"law.kind": "open_loop"}))
    volts = []
    for _ in range(20):
        scope.close_loop(law, 1000)
        volts.append(scope.take_block().samples[0])
    found = spring_constant(np.concatenate(volts), RATE, SENSITIVITY, 295.0)
    assert found.k.value == pytest.approx(0.2, rel=0.03)
    floor = 2e-5 * SENSITIVITY * math.sqrt(2.0 / RATE)
    for estimate, true in ((found.k, 0.2), (found.f0, 26e3), (found.Q, 20.0), (found.floor, floor)):
        assert abs(estimate.value - true) < 3.0 * estimate.uncertainty


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"temperature": -3.0}, "temperature = -3 is not allowed"),
        ({"band": (1e3, 1e6)}, "band = 1000 to 1e.06 Hz is not allowed"),
        ({"voltage": np.zeros(5000)}, "all samples are equal"),
        ({"voltage": np.ones(10)}, r"voltage of shape \(10,\) is not allowed"),
        ({"tilt": 2.0}, "tilt = 2 rad is not allowed"),
        ({"voltage": record(0.2, 23e3, 40.0, 1e-13, 0.02, 0)}, "too short for a resonance"),
        ({"voltage": np.random.default_rng(0).standard_normal(50_000)}, "no resonance found"),
        ({"band": (60e3, 100e3)}, "no resonance found"),
    ],
)
def test_what_cannot_be_analysed_is_refused_in_one_sentence(change, told):
    given = {"voltage": record(0.2, 23e3, 40.0, 1e-13, 0.1, 0), "temperature": 295.0} | change
    with pytest.raises(ValueError, match=told):
        spring_constant(given["voltage"], RATE, SENSITIVITY, given["temperature"],
                        band=given.get("band"), tilt=given.get("tilt", 0.0))  # fmt: skip


def test_spectra_of_windows_that_overlap_count_as_independent_by_what_they_have_in_common():
    # Parseval: squared correlations with all bins of a window that is shifted, summed, of white noise.
    n, count = 512, 2 * 16 - 1
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(n) / n)
    power = n / np.sum(window**2) ** 2
    beside, over = power * np.sum(window**4), power * np.sum((window[n // 2 :] * window[: n // 2]) ** 2)
    assert pytest.approx(count / (beside + 2.0 * (count - 1) / count * over)) == thermal._INDEPENDENT
