"""Claims about gains of one's own of law pid: the numbers of control_toolbox, and a drive that does not jump."""

import math

import numpy as np
import pytest

from afm_model import Controller, ControllerParameters, Instrument, ParameterError, SimParameters, build
from afm_model.compiled.records import record_at, size
from afm_model.law.pid import simc
from afm_model.law.scanner import free_axes
from afm_model.parts.signals import Measurement

PERIOD = 2e-5
GAINS = {
    "kp_x": 1e9, "ki_x": 5e12, "kd_x": 2e4,
    "kp_y": 5e8, "ki_y": 9e12,
    "kp_z": 8e8, "kd_z": 1e4,
}  # fmt: skip
PID = {"law.kind": "pid", "law.period": PERIOD}


def law(**given: object) -> Controller:
    return Controller(build(ControllerParameters, PID | {f"law.{name}": value for name, value in given.items()}))


class Toolbox:
    """The formulas of control_toolbox::Pid, back calculation: forward Euler, output clamped, then the integral."""

    def __init__(self, kp: float, ki: float, kd: float, output: float, integral: float) -> None:
        self.kp, self.ki, self.kd, self.output, self.most = kp, ki, kd, output, integral
        self.tracking = math.sqrt(kd / ki) if kd and ki else kp / ki if ki else 0.0
        self.last = self.sum = 0.0

    def answer(self, error: float) -> float:
        wanted = self.kp * error + self.sum + self.kd * (error - self.last) / PERIOD
        sent = min(max(wanted, -self.output), self.output)
        if self.ki:
            self.sum += PERIOD * (self.ki * error + (sent - wanted) / self.tracking)
        self.sum, self.last = min(max(self.sum, -self.most), self.most), error
        return sent


def test_drive_is_that_of_the_formulas_of_control_toolbox_over_a_hundred_thousand_random_steps():
    mine = law(**GAINS, z="pid", feedforward=False, drive_limit=2.0, integral_limit=1.5)
    others = [Toolbox(*(GAINS.get(f"k{part}_{axis}", 0.0) for part in "pid"), 2.0, 1.5) for axis in "xyz"]
    random = np.random.default_rng(1)
    errors = (
        1e-9 * random.standard_normal((100_000, 3)) + 4e-10 * np.cumsum(random.choice([-1, 1], (100_000, 3)), 0) % 9e-10
    )
    errors[0] = 0.0
    numbers = np.zeros(size(Measurement))
    y, a = record_at(numbers, 0, Measurement), mine.parameters.cantilever.a
    y.drive_sequence = -1
    drives, expected = np.empty((2, *errors.shape))
    for k, error in enumerate(errors):
        y.reference_position[:], y.position[:2], y.deflection = (2e-9, -1e-9, a), (2e-9, -1e-9) - error[:2], -error[2]
        drives[k] = mine.answer(numbers)
        expected[k] = [other.answer(float(each)) for other, each in zip(others, error, strict=True)]
    assert 0.05 < np.mean(np.abs(expected) == 2.0) < 0.95
    np.testing.assert_allclose(drives, expected, rtol=0.0, atol=1e-12)


def test_derivative_is_filtered_and_a_step_of_a_reference_without_weight_moves_the_integral_alone():
    numbers = np.zeros(size(Measurement))
    y = record_at(numbers, 0, Measurement)
    y.drive_sequence = -1
    gains = {name: gain for name, gain in GAINS.items() if name.endswith("x")}
    mine = law(**gains | {"ki_x": 0.0}, feedforward=False, derivative_time=3 * PERIOD)
    # A measured ramp, 1 nm a period: the filtered rate comes to it by 3/4 a period.
    for n in range(9):
        y.position[0] = -n * 1e-9
        assert mine.answer(numbers)[0] == pytest.approx(n * 1.0 + 2e4 * 1e-9 / PERIOD * (1.0 - 0.75**n), abs=1e-12)
    y.position[:] = 0.0
    mine = law(**gains, feedforward=False, proportional_weight=0.0, derivative_weight=0.0)
    mine.answer(numbers)
    y.reference_position[0] = 1e-9
    assert [mine.answer(numbers)[0] for _ in range(3)] == pytest.approx([0.0, 0.1, 0.2])


def tuned(slowness: float, integral: float = 1.0) -> dict[str, float]:
    """Gains (2) of docs/tuning.md."""
    parameters = law().parameters
    gains, tau = {"derivative_time": 0.5 * PERIOD}, (1.0 + slowness) * PERIOD
    for name, f, metres in zip("xyz", parameters.scanner.frequencies, parameters.piezo.sensitivities, strict=True):
        g = (2.0 * math.pi * f) ** 2 * metres
        gains |= {
            f"kp_{name}": 0.5 / tau**2 / g,
            f"ki_{name}": integral / 16.0 / tau**3 / g,
            f"kd_{name}": 1.0 / tau / g,
        }
    return gains


def test_gains_of_the_page_are_those_of_the_rule():
    parameters, gains = law().parameters, tuned(1.0)
    axis, metres = free_axes(parameters)[0], parameters.piezo.sensitivity_x
    rule = simc(axis.eta, axis.xi, axis.hold, 0.0)
    volts, time = 1.0 / (axis.eta**2 * metres), PERIOD / rule.reset
    # K (1 + s T) (1 + 1 / (s T)) as a sum.
    assert gains["kp_x"] == pytest.approx(2.0 * rule.gain * volts)
    assert gains["ki_x"] == pytest.approx(rule.gain * volts / time)
    assert gains["kd_x"] == pytest.approx(rule.gain * volts * time)


# A slow integral leaves an error under load.
TUNED = tuned(3.0, 0.02)
OWN = {**PID, "law.z": "pid", "law.feedforward": False, **{f"law.{name}": value for name, value in TUNED.items()}}
CHANGES = {
    **{name: {f"law.{name}": 0.5 * TUNED[name]} for name in TUNED},
    "weights": {"law.proportional_weight": 0.3, "law.derivative_weight": 0.0},
    "feedforward": {"law.feedforward": True},
    "to the rule": {f"law.{name}": 0.0 for name in TUNED} | {"law.slowness": 5.0},
}


def drives(first: dict[str, object], then: dict[str, object] | None) -> np.ndarray:
    """Drives of a run with friction and noise in which the parameters of the law change at tick 1000."""
    values = {
        "plant.control_period": PERIOD, "plant.dt": 1e-6, "detector.sample_period": 2e-5,
        "detector.position_noise": 5e-12, "detector.noise": 1e-4,
    }  # fmt: skip
    scope = Instrument(build(SimParameters, values), 1200, hashed=False)
    controller = Controller(build(ControllerParameters, first))
    scope.close_loop(controller, 1000)
    if then is not None:
        controller.parameters = build(ControllerParameters, then)
    scope.close_loop(controller, 200)
    return np.asarray(scope.take_block().drives)


@pytest.fixture(scope="module")
def undisturbed() -> np.ndarray:
    return drives(OWN, None)


def jump(changed: np.ndarray, undisturbed: np.ndarray) -> np.ndarray:
    """Step of the drive of each axis at the change, over the noise of its steps before."""
    steps = np.diff(undisturbed[800:1000], axis=0)
    return np.abs(changed[1000] - changed[999] - steps.mean(axis=0)) / steps.std(axis=0)


@pytest.mark.parametrize("change", CHANGES)
def test_change_of_a_gain_under_load_makes_no_bump_in_the_drive(change, undisturbed):
    changed = drives(OWN, OWN | CHANGES[change])
    np.testing.assert_array_equal(changed[:1000], undisturbed[:1000])
    assert not np.array_equal(changed[1000:], undisturbed[1000:])
    assert np.all(jump(changed, undisturbed) < 4.0)


@pytest.mark.parametrize("then", [PID, OWN], ids=["rule", "own"])
def test_pid_takes_over_from_another_law_without_a_bump(then):
    load = {"law.kind": "load", "law.period": PERIOD, "law.position_noise": 5e-12}
    assert np.all(jump(drives(load, then), drives(load, None)) < 4.0)


def test_gains_along_z_are_refused_where_no_pid_drives_z():
    with pytest.raises(ParameterError, match=r"law.ki_z = 1e\+09 is not allowed with law.z = tracking"):
        law(ki_z=1e9)
