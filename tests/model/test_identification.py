"""Claims about the identification of the scanner, against scipy's integrator and against the instrument itself."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp

from afm_model import (
    ControllerParameters,
    ParameterError,
    SimParameters,
    Simulation,
    build,
    changed,
    load_scenario,
    simulate,
)
from afm_model.analysis.identification import AXES, fit_resonator, identify, response, write_parameters

WITHDRAWN = {
    "plant.gap": 200e-9,
    "plant.control_period": 5e-5,
    "detector.sample_period": 1e-5,
    "run.duration": 0.25,
    "score.start": 0.0,
}
TRUE = {"f_x": 612.3, "f_y": 431.9, "f_z": 745.0, "xi_x": 0.021, "xi_y": 0.05, "xi_z": 0.033}
SENSITIVITY = {"x": 21e-9, "y": 18e-9, "z": 23e-9}


def shaken(law: str = "chirp", **values: object) -> Simulation:
    """A run of a scanner that is not the one of the controller's parameters."""
    true = {f"scanner.{name}": value for name, value in TRUE.items()}
    true |= {f"piezo.sensitivity_{axis}": value for axis, value in SENSITIVITY.items()}
    given = {name.replace("__", "."): value for name, value in values.items()}
    return simulate(
        build(SimParameters, WITHDRAWN | true | given),
        build(ControllerParameters, {"law.kind": law}),
    )


@pytest.fixture(scope="module")
def quiet() -> Simulation:
    return shaken()


def test_response_is_that_of_the_equation_of_motion():
    period, f, xi, sensitivity = 5e-5, 650.0, 0.04, 20e-9
    drive = np.random.default_rng(1).normal(size=40)
    w = 2.0 * np.pi * f
    state, expected = np.zeros(2), [0.0]
    for u in drive[:-1]:
        force = w * w * sensitivity * u
        solved = solve_ivp(
            lambda t, s, force=force: [s[1], force - 2.0 * xi * w * s[1] - w * w * s[0]],
            (0.0, period),
            state,
            rtol=1e-11,
            atol=[1e-20, 1e-16],
        )
        state = solved.y[:, -1]
        expected.append(state[0])
    np.testing.assert_allclose(response(drive, period, f, xi, sensitivity), expected, rtol=1e-8, atol=1e-16)


def test_tip_stays_off_the_sample_while_the_scanner_is_shaken(quiet):
    assert not quiet.truth["contact"].any()


def test_scanner_is_found_without_noise_within_a_few_millionths(quiet):
    found = identify(quiet.drive, quiet.position, 5e-5).parameters()
    for name, value in TRUE.items():
        assert found[f"scanner.{name}"].value == pytest.approx(value, rel=1e-5)
    for axis, value in SENSITIVITY.items():
        assert found[f"piezo.sensitivity_{axis}"].value == pytest.approx(value, rel=1e-5)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_with_noise_resonances_are_right_within_a_thousandth_and_within_their_errors(seed):
    run = shaken(detector__position_noise=5e-11, piezo__dac_bits=16, piezo__limit=10.0, plant__seed=seed)
    found = identify(run.drive, run.position, 5e-5)
    for axis in AXES:
        resonator = getattr(found, axis)
        for name, true in (("f", TRUE[f"f_{axis}"]), ("xi", TRUE[f"xi_{axis}"]), ("sensitivity", SENSITIVITY[axis])):
            each = getattr(resonator, name)
            # Five standard errors, and the step of the plant.
            assert abs(each.value - true) < 5.0 * each.uncertainty + 1e-5 * true, (axis, name)
        assert resonator.f.value == pytest.approx(TRUE[f"f_{axis}"], rel=1e-3)


def test_law_told_resonances_one_or_two_percent_wrong_is_healed_by_the_file_of_an_identification(tmp_path):
    # A law that takes what it is told for the truth: by itself it would find out in a period what is wrong.
    believes = {f"law.{name}": "nominal" for name in ("lateral_gain", "slow_force", "stiffness")}
    nominal = load_scenario("closed_loop_predictive")
    wrong = {"f_x": 1.02, "f_y": 0.99, "f_z": 1.01}
    true = {f"scanner.{name}": factor * getattr(nominal.sim.scanner, name) for name, factor in wrong.items()}
    off = WITHDRAWN | true | {"detector.position_noise": 5e-11, "piezo.dac_bits": 16, "piezo.limit": 12.0}
    run = simulate(build(SimParameters, off), build(ControllerParameters, {"law.kind": "chirp"}))
    write_parameters(identify(run.drive, run.position, 5e-5), tmp_path / "scanner.yaml")
    identified = load_scenario("closed_loop_predictive", overrides=tmp_path / "scanner.yaml")
    # Nothing known of surface and friction either; the second half of a period is scored.
    score = {"score.start": 0.5 * nominal.sim.run.duration}
    sim = changed(nominal.sim, true | score)
    before, after = (
        max(simulate(sim, changed(each.controller, believes)).score.max_percent[:2]) for each in (nominal, identified)
    )
    assert before > 10.0 * after
    # It is .02 with the resonances known to the last digit.
    assert after < 0.1


@pytest.mark.parametrize(
    ("gap", "reason"),
    [(0.0, "along x: an axis that .* does not move"), (2e-8, "along x: .* not that of a resonator.*is the tip off")],
)
def test_motion_in_contact_is_refused_with_the_axis_named(gap, reason):
    run = shaken(plant__gap=gap)
    with pytest.raises(ParameterError, match=reason):
        identify(run.drive, run.position, 5e-5)


@pytest.mark.parametrize(
    ("drive", "position", "reason"),
    [
        (np.zeros(50), np.zeros(50), "not enough"),
        (np.zeros(200), np.zeros(199), "not enough"),
        (np.zeros(200), np.ones(200), "not driven"),
        (np.r_[0.0, np.ones(199)], np.full(200, np.nan), "gaps"),
    ],
)
def test_record_that_tells_nothing_is_refused(drive, position, reason):
    with pytest.raises(ParameterError, match=reason):
        fit_resonator(drive, position, 5e-5)


@pytest.mark.parametrize(
    "position",
    [lambda k: np.exp(-k / 3.0) * (k > 0), lambda k: -k, lambda k: k**2],
    ids=["a decay", "a ramp", "a free mass"],
)
def test_record_of_a_fraction_of_a_period_is_refused_in_a_sentence_and_soon(position):
    # Of 150 ticks of 2 us; the first one overflowed, the second one took thousands of steps.
    drive = np.r_[0.0, 1.0, np.zeros(148)] if position(np.array([1.0]))[0] < 1.0 else np.r_[0.0, np.ones(149)]
    with pytest.raises(ParameterError, match=r"150 ticks in 0\.0003 s do not determine|not that of a resonator"):
        fit_resonator(drive, position(np.arange(150.0)), 2e-6)


def test_parameter_file_gives_the_controller_what_was_found(quiet, tmp_path: Path):
    found = identify(quiet.drive, quiet.position, 5e-5)
    path = tmp_path / "scanner.yaml"
    write_parameters(found, path, {"identified from": "a test"})
    assert path.read_text().startswith("# identified from: a test\n")
    content = yaml.safe_load(path.read_text())
    read = {
        f"{group}.{name}": value
        for group, values in content["/**/afm_controller_node"]["ros__parameters"].items()
        for name, value in values.items()
    }
    assert read == {name: each.value for name, each in found.parameters().items()}
    build(ControllerParameters, read)
