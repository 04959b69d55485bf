"""Claims about the photodiode: density and bandwidth of its noise, crosstalk, gains, the rate that is measured."""

import numpy as np
import pytest
from scipy.signal import lfilter, welch

from afm_model import InstrumentParameters, ParameterError, build
from afm_model.detector import PHOTODIODE

from .. import session

DENSITY = 2e-6
"""[V/sqrt(Hz)]"""
STILL = {"sample.beta": 0.0, "plant.control_period": 1e-4}
"""At rest, a hundred samples of 1 us in a tick."""


def volts(values: dict[str, object], ticks: int) -> tuple[np.ndarray, float]:
    """Deflection and lateral voltage (2, n) of an instrument at rest, and the rate of the samples."""
    scope = session.instrument(STILL | values, ticks)
    drive = scope.drive
    for _ in range(ticks):
        scope.tick(drive)
    return scope.take_block().samples[:2], 1.0 / scope.parameters.detector.sample_period


def spectrum(x: np.ndarray, rate: float, length: int = 1024) -> tuple[np.ndarray, np.ndarray, float]:
    """Frequencies, one-sided density, its standard error (relative)."""
    f, power = welch(x, rate, nperseg=length, noverlap=0, window="boxcar", detrend="constant")
    return f[1:-1], np.sqrt(power[1:-1]), 0.5 / np.sqrt(len(x) // length)


@pytest.mark.parametrize(
    "values",
    [
        {"detector.noise_density": DENSITY},
        {"detector.noise_density": DENSITY, "detector.sample_period": 4e-6, "plant.dt": 5e-7},
        {"detector.noise_density": DENSITY, "detector.sample_period": 1e-5, "plant.control_period": 1e-3},
        {"detector.deflection_noise_density": DENSITY * 10e-9},
    ],
)
def test_density_is_as_given_whatever_step_and_rate(values):
    signals, rate = volts(values, 600)
    for signal in signals:
        _, density, error = spectrum(signal, rate)
        # White: all bins alike, so that their mean has the error of the whole record.
        assert np.sqrt((density**2).mean()) == pytest.approx(DENSITY, rel=5.0 / np.sqrt(len(signal)))
        low, high = density[: len(density) // 2], density[len(density) // 2 :]
        assert np.sqrt((low**2).mean() / (high**2).mean()) == pytest.approx(1.0, abs=10.0 * error / np.sqrt(len(low)))


@pytest.mark.parametrize("period", [1e-6, 4e-6])
def test_noise_behind_a_low_pass_has_its_spectrum_and_size_at_any_rate_of_the_adc(period):
    corner = 2e4
    given = {"detector.noise_density": DENSITY, "detector.bandwidth": corner, "detector.sample_period": period}
    signal, rate = (each for each in volts(given, 2000))
    f, density, error = spectrum(signal[0], rate)
    expected = DENSITY / np.sqrt(1.0 + (f / corner) ** 2)
    pass_band = (f > 1e3) & (f < 3.0 * corner)
    ratio = (density / expected)[pass_band] ** 2
    # What the sampling folds into this band: (f / (rate - f))^2, below 9 % of the power at its edge at 250 kHz.
    folded = (60e3 / (rate - 60e3)) ** 2
    assert ratio.mean() == pytest.approx(1.0, abs=10.0 * error / np.sqrt(pass_band.sum()) + 0.5 * folded)
    # Of a low-pass of first order the equivalent bandwidth of noise is pi/2 of its own.
    rms = DENSITY * np.sqrt(0.5 * np.pi * corner)
    independent = signal.shape[1] * period * 2.0 * np.pi * corner
    assert signal[0].std() == pytest.approx(rms, rel=5.0 / np.sqrt(independent))


def test_rms_noise_is_that_of_a_sample_with_and_without_a_low_pass():
    for values in ({}, {"detector.bandwidth": 1e5}):
        signals, _ = volts({"detector.noise": 3e-3} | values, 200)
        assert signals.std(axis=1) == pytest.approx(3e-3, rel=5.0 / np.sqrt(1.2e4))


def moved(values: dict[str, object]) -> tuple[np.ndarray, np.ndarray, str]:
    """Voltages (2, n) and measured deflection of a lever that slides over a plane in open loop; hash of the motion."""
    sliding = {
        "plant.kind": "lever",
        "sample.kind": "plane",
        "sample.angle_x": 0.02,
        "reference.z_r": 50e-9,
        "plant.control_period": 2e-5,
    }
    scope = session.instrument(sliding | values, 400)
    start = scope.drive
    for k in range(400):
        scope.tick(start + np.array([3.0 * np.sin(0.05 * k), 0.0, 0.5 * np.sin(0.03 * k)]))
    block = scope.take_block()
    return block.samples[:2], block.measurements, scope.trajectory_sha256()


def test_crosstalk_and_gains_are_recovered_from_voltages_with_and_without():
    matrix = np.array([[1.05, 0.03], [-0.02, 0.9]])
    given = {
        "detector.deflection_gain": matrix[0, 0],
        "detector.lateral_in_deflection": matrix[0, 1],
        "detector.deflection_in_lateral": matrix[1, 0],
        "detector.lateral_gain": matrix[1, 1],
    }
    clean, _, before = moved({})
    crossed, _, after = moved(given)
    assert np.linalg.cond(clean) < 100.0
    found = np.linalg.lstsq(clean.T, crossed.T, rcond=None)[0].T
    assert found == pytest.approx(matrix, abs=1e-12)
    assert before == after


def test_an_offset_of_the_lateral_signal_is_added_and_moves_nothing():
    clean, _, before = moved({})
    off, _, after = moved({"detector.lateral_offset": -0.4})
    assert (off[0] == clean[0]).all() and off[1] == pytest.approx(clean[1] - 0.4, abs=1e-12)
    assert before == after


def test_low_pass_filters_the_signal_as_an_analog_one():
    corner, T = 5e3, 1e-6
    clean, _, _ = moved({})
    filtered, _, _ = moved({"detector.bandwidth": corner})
    # Bilinear transform of 1 / (1 + s / w): far below the rate of the samples it is the analog low-pass.
    w = 2.0 * np.pi * corner
    b, a = np.array([w * T, w * T]) / (2.0 + w * T), np.array([1.0, (w * T - 2.0) / (2.0 + w * T)])
    for given, out in zip(clean, filtered, strict=True):
        expected = given[0] + lfilter(b, a, given - given[0])
        assert out == pytest.approx(expected, abs=1e-3 * np.ptp(given))
        assert np.abs(out - given).max() > 1e-2 * np.ptp(given)


@pytest.mark.parametrize("rate_bandwidth", [0.0, 2e3])
def test_rate_of_the_deflection_is_the_difference_of_what_is_read_as_soon_as_that_is_not_exact(rate_bandwidth):
    for values in ({"detector.noise": 1e-3}, {"detector.adc_bits": 12}, {"detector.bandwidth": 1e5}):
        volts, y, _ = moved(values | {"detector.rate_bandwidth": rate_bandwidth})
        raw = 10e-9 * np.diff(volts[0]) / 1e-6
        keep = np.exp(-2.0 * np.pi * rate_bandwidth * 1e-6) if rate_bandwidth else 0.0
        expected = lfilter([1.0 - keep], [1.0, -keep], raw)[19::20]
        assert y.deflection_rate[0] == 0.0
        assert y.deflection_rate[1:] == pytest.approx(expected, rel=1e-9, abs=1e-6 * np.abs(expected).max())
    _, y, _ = moved({})
    assert np.abs(y.deflection_rate[1:] - np.diff(y.deflection) / 2e-5).max() > 1e-9


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"detector.noise": 1e-3, "detector.noise_density": 1e-6}, "are not allowed together: give one"),
        ({"detector.lateral_in_deflection": 1.0}, "it must be a finite number > -1 and < 1"),
        ({"detector.deflection_gain": 0.0}, "it must be a finite number >= 1e-12"),
    ],
)
def test_what_cannot_be_is_refused(values, told):
    with pytest.raises(ParameterError, match=told):
        build(InstrumentParameters, values)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"detector.deflection_noise_density": 1e-9}, "noise density"),
        ({"detector.bandwidth": 1e6, "detector.noise": 1e-3}, "folded"),
        ({"detector.deflection_gain": 3.0}, "deflection_gain"),
        ({"detector.deflection_in_lateral": 0.5}, "crosstalk"),
    ],
)
def test_what_is_implausible_is_told(values, told):
    (sentence,) = PHOTODIODE.warnings(build(InstrumentParameters, values))
    assert told in sentence


def test_what_is_plausible_is_not_remarked():
    usual = {
        "detector.deflection_noise_density": 1e-13,
        "detector.bandwidth": 2e5,
        "detector.lateral_in_deflection": 0.03,
    }
    assert PHOTODIODE.warnings(build(InstrumentParameters, usual)) == []
