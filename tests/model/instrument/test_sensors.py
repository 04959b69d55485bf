"""Claims about the position sensors: density, bandwidth, resolution, and velocities no better than the positions."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter, welch

from afm_model import InstrumentParameters, ParameterError, build

from .. import session

DENSITY = 1e-12
"""[m/sqrt(Hz)]"""
DRIFT = "truth/drift_x, truth/drift_y, truth/drift_z"


def read(
    values: dict[str, object], ticks: int = 1000, period: float = 1e-4
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions as read and true, and velocities (ticks, 3), of a scanner that is driven in open loop."""
    # Friction that lets the scanner move.
    given = {"sample.beta": 0.0, "contact.tau": 1e6, "plant.control_period": period, "detector.sample_period": period}
    scope = session.instrument(given | values, ticks)
    start = scope.drive
    for k in range(ticks):
        scope.tick(start + np.array([0.5 * np.sin(3e3 * k * period), 0.0, 0.0]))
    block = scope.take_block()
    y = block.measurements
    return y.position, scope.truth_of(block.states).position, y.velocity


@pytest.mark.parametrize(("period", "dt"), [(1e-4, 1e-6), (1e-5, 1e-6), (1e-5, 5e-7)])
def test_density_of_the_position_noise_is_as_given_whatever_step_and_rate(period, dt):
    position, true, _ = read({"detector.position_noise_density": DENSITY, "plant.dt": dt}, 3000, period)
    for noise in (position - true).T:
        _, power = welch(noise, 1.0 / period, nperseg=256, noverlap=0, window="boxcar")
        assert np.sqrt(power[1:-1].mean()) == pytest.approx(DENSITY, rel=5.0 / np.sqrt(2.0 * 2816))


def test_sensor_with_a_bandwidth_lags_behind_as_a_first_order_low_pass():
    corner, T = 500.0, 1e-4
    position, true, _ = read({"detector.position_bandwidth": corner})
    w = 2.0 * np.pi * corner
    b, a, _ = cont2discrete(([w], [1.0, w]), T, method="foh")
    start = true[0]
    assert position == pytest.approx(start + lfilter(b.ravel(), a, true - start, axis=0), abs=1e-18)
    assert np.abs(position - true).max() > 0.1 * np.ptp(true[:, 0])


def test_noise_of_a_sensor_with_a_bandwidth_is_that_of_its_equivalent_bandwidth():
    corner, T = 500.0, 1e-4
    both = {"detector.position_bandwidth": corner}
    position, _, _ = read(both | {"detector.position_noise_density": DENSITY}, 8000)
    quiet, _, _ = read(both, 8000)
    noise = position - quiet
    independent = 8000 * T * 2.0 * np.pi * corner
    assert noise.std(axis=0) == pytest.approx(DENSITY * np.sqrt(0.5 * np.pi * corner), rel=5.0 / np.sqrt(independent))
    for axis in noise.T:
        assert np.corrcoef(axis[1:], axis[:-1])[0, 1] == pytest.approx(np.exp(-2.0 * np.pi * corner * T), abs=0.05)


def test_resolution_gives_whole_levels_and_ends_at_the_range():
    position, true, _ = read({"detector.position_bits": 8, "detector.position_limit": 4e-9})
    lsb = 8e-9 / 2**8
    assert position / lsb == pytest.approx(np.round(position / lsb), abs=1e-9)
    inside = np.abs(true) < 4e-9 - lsb
    assert not inside.all()
    assert np.abs(position - true)[inside].max() <= 0.5 * lsb * (1.0 + 1e-9)
    assert position.max() == pytest.approx(4e-9 - lsb)
    assert position.min() == pytest.approx(-4e-9)


@pytest.mark.parametrize("rate_bandwidth", [0.0, 300.0])
@pytest.mark.parametrize(
    "values",
    [
        {"detector.position_noise": 5e-11},
        {"detector.position_noise_density": DENSITY},
        {"detector.position_bandwidth": 1e3},
        {"detector.position_bits": 12, "detector.position_limit": 1e-7},
    ],
)
def test_velocity_is_the_difference_of_what_is_read_as_soon_as_that_is_not_exact(values, rate_bandwidth):
    position, _, velocity = read(values | {"detector.rate_bandwidth": rate_bandwidth}, 300)
    keep = np.exp(-2.0 * np.pi * rate_bandwidth * 1e-4) if rate_bandwidth else 0.0
    expected = lfilter([1.0 - keep], [1.0, -keep], np.diff(position, axis=0) / 1e-4, axis=0)
    assert not velocity[0].any()
    assert velocity[1:] == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_sensors_are_read_at_the_rate_of_the_adc_and_rates_are_filtered_there():
    # Eight samples in a tick: what the measurements tell is that of an instrument that is asked at each of them.
    fine = {"detector.position_bandwidth": 3e3, "detector.position_bits": 16, "detector.position_limit": 1e-6}
    given = {"sample.beta": 0.0, "contact.tau": 1e6, "plant.dt": 1e-6, "detector.sample_period": 1e-5}

    def asked(period: float) -> np.ndarray:
        scope = session.instrument(given | fine | {"plant.control_period": period}, 800)
        push = scope.drive + np.array([0.5, 0.0, 0.0])
        for _ in range(round(8e-3 / period)):
            scope.tick(push)
        y = scope.take_block().measurements
        return np.column_stack([y.position, y.velocity])

    coarse, every = asked(8e-5), asked(1e-5)
    assert np.ptp(coarse[:, 0]) > 1e-9
    np.testing.assert_allclose(coarse[1:], every[8::8], rtol=1e-12, atol=0.0)


def test_ideal_sensors_tell_the_true_velocity():
    position, true, velocity = read({}, 300)
    np.testing.assert_array_equal(position, true)
    # A difference is the mean of both ends', but for (w T)^2 / 12 = 0.75 % of it; it comes half a period late.
    difference, largest = np.diff(position[:, 0]) / 1e-4, np.abs(velocity[:, 0]).max()
    assert difference == pytest.approx(0.5 * (velocity[1:, 0] + velocity[:-1, 0]), abs=0.02 * largest)
    assert np.abs(difference - velocity[1:, 0]).max() > 0.1 * largest


def test_one_source_of_noise_leaves_the_numbers_of_the_others_alone():
    def noise(values: dict[str, object]) -> np.ndarray:
        given = {"plant.control_period": 1e-4, "detector.sample_period": 1e-4, "detector.position_noise": 5e-11}
        scope = session.instrument(given | {"detector.channels": DRIFT} | values, 300)
        drive = scope.drive
        for _ in range(300):
            scope.tick(drive)
        block = scope.take_block()
        drift = np.array([block.samples[session.column(scope, name)] for name in DRIFT.split(", ")])
        assert drift.any() == ("drift.wander" in values)
        return block.measurements.position - scope.truth_of(block.states).position + drift.T

    alone = noise({})
    for values in ({"detector.noise": 1e-3}, {"drift.wander": 1e-9}, {"plant.kind": "paper", "plant.z": "uniform"}):
        assert noise(values) == pytest.approx(alone, abs=1e-20)


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"detector.position_bits": 16}, r"detector.position_limit must be > 0 m"),
        (
            {"detector.position_noise": 1e-10, "detector.position_noise_density": 1e-12},
            "are not allowed together: give one",
        ),
    ],
)
def test_what_cannot_be_is_refused(values, told):
    with pytest.raises(ParameterError, match=told):
        build(InstrumentParameters, values)


def test_noise_of_a_velocity_is_what_the_page_gives_for_the_default_low_pass():
    given = {"sample.beta": 0.0, "plant.control_period": 1e-4, "detector.position_noise": 5e-11}
    scope = session.instrument(given, 1500)
    drive = scope.drive
    for _ in range(1500):
        scope.tick(drive)
    velocity = scope.take_block().measurements.velocity[1:]
    # A tick is 12 time constants of the low-pass: the velocities are independent.
    assert velocity.std() == pytest.approx(6.087e-6, rel=5.0 / np.sqrt(2.0 * velocity.size))
