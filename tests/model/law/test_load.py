"""Claims about the law load on a scanner that friction does not move; errors in percent of the amplitude."""

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from afm_model import Controller, ControllerParameters, build, load_scenario, simulate
from afm_model.law.load import LOAD, Constants, State, begin, carry, correct

from ..tables import record_of

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "tools"))
from laboratory import CERAMIC, IMPERFECT, SENSORS, scan

SENSITIVITY = 2e-8
"""Of the piezo along x and y [m/V]."""


def run(plant, amplitude=1e-6, period=5e-5, delay=1, kind="load", **given):
    law = {"law.kind": kind} | {name.replace("__", "."): value for name, value in given.items()}
    return simulate(*scan(law, plant, amplitude, period, delay))


def error(*of, **given):
    return max(run(*of, **given).score.max_percent[:2])


@pytest.mark.parametrize(("case", "period", "delay"), [(1, 5e-5, 1), (1, 2e-4, 1), (2, 5e-5, 1)])
def test_late_drives_behind_hysteresis_cost_less_than_with_pid_and_observer(case, period, delay):
    _, plant, given = IMPERFECT[case]
    others = [error(plant, 5e-9, period, delay, kind) for kind in ("pid", "observer")]
    names = {name.replace(".", "__"): value for name, value in given.items()}
    assert error(plant, 5e-9, period, delay, **names) < 0.75 * min(others)


def test_with_measured_rates_and_no_delay_observer_is_better_behind_hysteresis():
    assert error(CERAMIC, 5e-9, 5e-5, 0, "observer") < 0.5 * error(CERAMIC, 5e-9, 5e-5, 0)


@pytest.mark.parametrize(("period", "delay", "most"), [(5e-5, 1, 0.15), (2e-4, 1, 1.3)])
@pytest.mark.parametrize(
    "given",
    [
        {"scanner__f_x": 400.0, "scanner__f_y": 400.0},
        {"scanner__f_x": 625.0, "scanner__f_y": 625.0},
        {"piezo__sensitivity_x": 1.4 * SENSITIVITY, "piezo__sensitivity_y": 1.4 * SENSITIVITY},
    ],
)
def test_a_wrong_scanner_behind_much_hysteresis_is_tolerated(given, period, delay, most):
    assert error(CERAMIC, 1e-6, period, delay, **given) < most


def test_of_a_large_error_at_the_start_little_is_left_after_2_ms():
    plant = CERAMIC | SENSORS | {"run.duration": 0.01, "score.start": 0.0}
    done = run(plant, 20e-6, law__position_noise=5e-11)
    assert np.abs(done.position - done.reference)[40:80, :2].max() < 30e-9


def records(**law):
    _, controller = scan({"law.kind": "load"} | law, {}, 1e-6, 5e-5, 1)
    return controller, record_of(Constants, **LOAD.values(controller)), record_of(State)


def test_position_rate_and_load_are_estimated_by_the_equations_of_kalman():
    controller, p, s = records(**{"law.position_noise": 5e-11})
    h, eta = float(p.hold), 2.0 * np.pi * controller.scanner.f_x / float(p.w0)
    xi, fastest, noise = controller.scanner.xi_x, 25.0, 5e-11 / controller.scales.x0
    step = expm(np.array([[0.0, 1.0, 0.0], [-(eta**2), -2.0 * xi * eta, 1.0], [0.0, 0.0, 0.0]]) * h)
    F, of_drive = np.eye(4), step[:2, 2]
    F[:2, :2], F[:2, 2], F[:2, 3], F[2, 3] = step[:2, :2], -of_drive, -0.5 * h * of_drive, h
    rate = 0.1 * eta**2 * fastest
    Q = np.diag([0.0, (0.5 * eta**2 * fastest) ** 2 * h, 0.0, rate**2 * h / 100.0])
    bandwidth = 1.3 * min(eta, 1.0 / (1.5 * h))
    R = noise**2 + rate**2 / (100.0 * h * bandwidth**8)
    P = np.diag([0.0, fastest**2, (100.0 * rate) ** 2, rate**2])
    x = np.array([3.0, 0.0, 0.0, 0.0])
    begin(0, 3.0, p, s)
    for drive, measured in ((0.2, 3.3), (-0.1, 2.9), (0.4, 3.7)):
        carry(0, drive, p, s)
        correct(0, measured, fastest, p, s)
        x, P = F @ x + np.append(of_drive * drive, [0.0, 0.0]), F @ P @ F.T + Q
        gain = P[:, 0] / (P[0, 0] + R)
        x, P = x + gain * (measured - x[0]), P - np.outer(gain, P[0])
        assert np.allclose(s.estimate[0], x, rtol=1e-9)
        assert np.allclose(np.array(s.covariance[0]) * fastest**2, P, rtol=1e-7)


@pytest.mark.parametrize("wrong", [0.95, 1.1])
def test_the_estimated_load_is_the_one_of_a_wrong_sensitivity(wrong):
    # With a sensitivity that is too large the law sends too little: as if a spring held the scanner back.
    law = {"law.kind": "load"} | {f"piezo.sensitivity_{axis}": wrong * SENSITIVITY for axis in "xy"}
    sim, controller = scan(law, {}, 1e-6, 5e-5, 1)
    outside = Controller(controller)
    done = simulate(sim, outside)
    eta = 2.0 * np.pi * controller.scanner.f_x / controller.scales.w0
    load = (wrong - 1.0) * eta**2 * done.position[-1, 0] / controller.scales.x0
    size = abs(wrong - 1.0) * eta**2 * 1e-6 / controller.scales.x0
    assert float(outside.state.estimate[0, 2]) == pytest.approx(load, abs=0.02 * size)


def test_a_scanner_that_friction_moves_is_warned_of():
    _, controller = scan({"law.kind": "load"}, {}, 1e-6, 5e-5, 1)
    assert LOAD.warnings(controller, 5e-5) == []
    soft = build(ControllerParameters, {"law.kind": "load"})
    contact, scanner = soft.contact, soft.scanner
    spring = scanner.mass_ratio * soft.cantilever.m_c * (2.0 * np.pi * min(scanner.f_x, scanner.f_y)) ** 2
    (warning,) = LOAD.warnings(soft, 5e-5)
    assert f"moves the scanner by {1e9 * contact.friction_at_pull_off / spring:.3g} nm" in warning


def test_a_laboratory_microscope_needs_no_model_of_friction(tmp_path):
    path = tmp_path / "laboratory.yaml"
    path.write_text(
        "/**:\n  ros__parameters:\n    microscope: {lever: ppp_lfmr, scanner: flexure_90um, pair: si_sio2}\n"
        "/**/afm_sim_node:\n  ros__parameters: {sample: {kind: flat}, onboard: {kind: pi}, run: {duration: 0.01}}\n"
        "/**/afm_controller_node:\n  ros__parameters: {law: {kind: load}}\n"
    )
    scenario = load_scenario(path)
    assert scenario.sim.plant.kind == "lever"
    assert np.isfinite(simulate(scenario.sim, scenario.controller).drive).all()
