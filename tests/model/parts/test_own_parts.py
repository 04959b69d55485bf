"""Claims about parts of somebody else's: from a package outside this tree, by name, with parameters and state."""

import dataclasses
import importlib
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from afm_model import (
    Controller,
    ControllerParameters,
    Instrument,
    ParameterError,
    PartError,
    SimParameters,
    Simulation,
    build,
    simulate,
    specifications,
)
from afm_model.instrument.validity import valid_forces
from afm_model.law import ContactWarning
from afm_model.studies.linear import at_timing, linearise
from afm_model.studies.linear_model import plant_matrices
from afm_model.studies.start_checks import start_warnings

EXAMPLES = Path(__file__).resolve().parents[3] / "examples" / "parts"
LIMIT = 60
"""Lines that an own part may take."""
SHORT = {"run.duration": 2e-3, "score.start": 0.0}

SWEEP = """
from pathlib import Path
from afm_model import ControllerParameters, Scenario, SimParameters, build, sweep

if __name__ == "__main__":
    sim = {"run.duration": 2e-4, "score.start": 0.0, "sample.kind": "own_parts.patches:PATCHES"}
    law = {"law.kind": "own_parts.kalman:KALMAN"}
    parameters = {"sim": build(SimParameters, sim), "controller": build(ControllerParameters, law)}
    scenario = Scenario("own", Path("own.yaml"), **parameters)
    grid = {"afm_controller_node.law.bandwidth": [5e3, 1e4], "afm_sim_node.sample.ratio": [0.3]}
    table = sweep(scenario, grid, workers=1, fingerprint=True, progress=False)
    assert table["error"].isna().all(), table["error"]
    print(table["trajectory_sha256"][0])
"""


def run(sim: dict[str, object], law: dict[str, object] | None = None) -> Simulation:
    """A short run."""
    return simulate(build(SimParameters, SHORT | sim), build(ControllerParameters, law or {}))


@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("*.py")), ids=lambda file: file.stem)
def test_an_own_part_takes_no_more_than_a_page(file):
    assert len(file.read_text().splitlines()) <= LIMIT


@pytest.mark.parametrize("kind", ["own_parts.kalman:KALMAN", "kalman"])
def test_a_law_with_a_filter_knows_the_position_better_than_its_sensor(own, kind):
    controller = Controller(build(ControllerParameters, {"law.kind": kind}))
    scope = Instrument(build(SimParameters, SHORT | {"detector.position_noise": 5e-11}), 1000)
    estimated = []
    for _ in range(900):
        true = scope.truth.position[:2]
        scope.tick(controller.answer(scope.measurement))
        estimated.append(controller.state.position[:2] - true)
    seen = scope.take_block()
    sensor = seen.measurements["position"][:, :2] - scope.truth_of(seen.states).position[:, :2]
    assert np.std(sensor) == pytest.approx(5e-11, rel=0.1)
    assert np.std(estimated[300:]) < 0.5 * np.std(sensor)


def test_the_parameters_of_an_own_law_are_checked_and_described_as_ours(own):
    model = type(build(ControllerParameters, {"law.kind": "kalman"}))
    described = {spec.name: spec for spec in specifications(model)}
    assert described["law.bandwidth"].unit == "rad/s"
    assert "law.alpha" not in described
    with pytest.raises(
        ParameterError, match=r"law.bandwidth = -1.0 rad/s is not allowed: it must be a finite number >= 1e-06"
    ):
        build(ControllerParameters, {"law.kind": "kalman", "law.bandwidth": -1.0})
    with pytest.raises(ParameterError, match=r"unknown parameter law.bandwith: did you mean law.bandwidth"):
        build(ControllerParameters, {"law.kind": "kalman", "law.bandwith": 1.0})
    with pytest.raises(ParameterError, match=r"unknown parameter law.alpha"):
        build(ControllerParameters, {"law.kind": "kalman", "law.alpha": 1.0})


def test_reset_starts_the_state_of_a_law_and_a_change_of_gains_does_not(own):
    controller = Controller(build(ControllerParameters, {"law.kind": "kalman"}))
    scope = Instrument(build(SimParameters, SHORT | {"detector.position_noise": 5e-11}))
    scope.close_loop(controller, 100)
    state = controller.state.copy()
    assert state.started == 1.0
    assert state.velocity[0] != 0.0
    controller.parameters = build(ControllerParameters, {"law.kind": "kalman", "law.bandwidth": 5e3})
    assert controller.state == state
    controller.reset()
    assert controller.state.started == 0.0
    assert not controller.state.velocity.any()


@pytest.mark.parametrize(
    ("sim", "law", "name"),
    [
        ({"detector.position_noise": 5e-11}, {"law.kind": "own_parts.{}:KALMAN"}, "kalman"),
        ({"sample.kind": "own_parts.{}:PATCHES"}, {}, "patches"),
        ({"piezo.kind": "own_parts.{}:CREEP"}, {}, "creep"),
        ({"fault.kind": "own_parts.{}:BURSTS"}, {}, "bursts"),
    ],
    ids=["law", "sample", "piezo", "fault"],
)
def test_a_part_in_plain_python_gives_the_bytes_of_the_compiled_one(own, sim, law, name):
    both = [
        run(
            {"run.duration": 2e-4}
            | {key: value.format(each) if key.endswith("kind") else value for key, value in sim.items()},
            {key: value.format(each) for key, value in law.items()},
        )
        for each in (name, "in_python")
    ]
    assert both[0].trajectory_sha256 == both[1].trajectory_sha256
    np.testing.assert_array_equal(both[0].measurements, both[1].measurements)


def test_a_sample_of_two_materials_has_friction_in_their_ratio(own):
    flat = {
        "sample.kind": "own_parts.patches:PATCHES",
        "sample.ratio": 0.25,
        "sample.width": 2e-9,
        "run.duration": 0.02,
    }
    result = run(flat)
    x = result.truth.position[:, 0]
    bound = result.truth.friction_bound
    # Well inside a stripe, where the step before was on the same one.
    inside = np.abs((x / 2e-9) % 1.0 - 0.5) < 0.4
    second = inside & ((x / 2e-9) % 2.0 > 1.0)
    first = inside & ((x / 2e-9) % 2.0 < 1.0)
    assert first.sum() > 100
    assert second.sum() > 100
    assert np.median(bound[second]) / np.median(bound[first]) == pytest.approx(0.25, rel=0.01)


def test_a_map_of_the_papers_sample_is_the_papers_sample(own, tmp_path):
    n, beta, k = 128, 12.5e-9, 2e9
    phase = 2.0 * np.pi * np.arange(n) / n
    np.save(tmp_path / "map.npy", beta * np.outer(np.sin(phase), np.sin(phase)))
    mapped = {
        "sample.kind": "own_parts.height_map:HEIGHT_MAP",
        "sample.file": str(tmp_path / "map.npy"),
        "sample.size": 2.0 * np.pi / k,
    }
    a, b = run(mapped | {"run.duration": 0.02}), run({"run.duration": 0.02})
    # A cubic spline of 128 points a period is right to its fourth order, 1e-7 of the height, its curvature to 1e-3.
    assert np.abs(a.truth.tip_height - b.truth.tip_height).max() < 1e-3 * beta
    assert np.abs(a.truth.position[:, :2] - b.truth.position[:, :2]).max() < 1e-3 * 5e-9
    # Without a map there is nothing to see.
    assert (
        np.abs(run({"sample.beta": 0.0, "run.duration": 0.02}).truth.tip_height - b.truth.tip_height).max()
        > 0.05 * beta
    )


def test_a_piezo_creeps_by_the_log_law(own):
    creep = 0.015
    parameters = build(
        SimParameters,
        {
            "piezo.kind": "own_parts.creep:CREEP",
            "piezo.creep": creep,
            "plant.control_period": 1e-3,
            "detector.sample_period": 1e-3,
            "plant.dt": 2e-6,
            "detector.channels": "truth/piezo_x",
            "run.duration": 10.0,
        },
    )
    scope = Instrument(parameters, 10_000)
    drive = scope.drive
    drive[0] = 1e-3  # far below what friction holds: the piezo alone moves
    while not scope.block_full:
        scope.tick(drive)
    volts = scope.take_block().samples[[channel.name for channel in scope.channels].index("truth/piezo_x")] / 1e-3
    # From 0.1 s on, by `creep` a decade.
    expected = [volts[100] + creep * decades for decades in (1.0, 1.9)]
    assert [volts[1000], volts[int(100 * 10**1.9)]] == pytest.approx(expected, abs=0.1 * creep)


def test_a_plant_in_a_viscous_film_answers_a_step_by_the_closed_form(own):
    film = 3e3
    scope = Instrument(
        build(
            SimParameters,
            {
                "plant.kind": "own_parts.viscous:VISCOUS",
                "plant.film": film,
                "plant.dt": 1e-7,
                "detector.sample_period": 1e-6,
                "plant.control_period": 2e-6,
            },
        ),
        1000,
    )
    while not scope.block_full:
        scope.tick(np.array([0.1, 0.0, 0.0]))
    block = scope.take_block()
    scanner = scope.parameters.scanner
    w = 2.0 * np.pi * scanner.f_x
    decay = scanner.xi_x * w + 0.5 * film
    t = 2e-6 * np.arange(1000)
    damped = np.sqrt(w**2 - decay**2)
    expected = 2e-9 * (1.0 - np.exp(-decay * t) * (np.cos(damped * t) + decay / damped * np.sin(damped * t)))
    # Semi-implicit Euler is of first order: half a step of 0.1 us at the top speed.
    assert block.measurements["position"][:, 0] == pytest.approx(expected, abs=1e-3 * 2e-9)
    truth = scope.truth_of(block.states)
    mass = scanner.mass_ratio * scope.parameters.cantilever.m_c
    assert truth.friction[:, 0] == pytest.approx(-film * mass * truth.velocity[:, 0], rel=1e-12)
    # The tip is on the sample.
    sample = scope.parameters.sample
    height = sample.beta * np.sin(sample.k_x * truth.position[:, 0]) * np.sin(sample.k_y * truth.position[:, 1])
    assert truth.tip_height == pytest.approx(height + truth.position[:, 2], abs=1e-15)


def test_a_plant_holds_still_up_to_its_static_friction_and_slides_with_less_the_faster(own):
    static, kinetic, speed = 2e-7, 1e-7, 1e-7
    values = {"plant.kind": "own_parts.stribeck:STRIBECK", "plant.dt": 1e-5, "detector.sample_period": 1e-5}
    scope = Instrument(build(SimParameters, values | {"plant.control_period": 1e-5}), 4000)
    scanner, metres = scope.parameters.scanner, scope.parameters.piezo.sensitivity_x
    mass = scanner.mass_ratio * scope.parameters.cantilever.m_c
    holds = static / (mass * (2.0 * np.pi * scanner.f_x) ** 2 * metres)
    for k in range(4000):
        scope.tick(np.array([holds * 2.0 * (k + 1) / 4000, 0.0, 0.0]))
    truth = scope.truth_of(scope.take_block().states)
    moving = np.abs(truth.velocity[:, 0]) > 0.0
    assert abs(int(np.flatnonzero(moving)[0]) - 2000) <= 1
    # Friction of a step is that of the speed at its begin.
    formula = kinetic + (static - kinetic) * np.exp(-np.square(np.roll(truth.velocity[:, 0], 1) / speed))
    assert np.abs(truth.friction[moving, 0]) == pytest.approx(formula[moving], rel=1e-9)
    assert formula[moving].min() < 0.6 * static


def test_a_plant_whose_scanner_couples_x_and_y_answers_a_step_along_x_along_both(own):
    values = {"plant.kind": "own_parts.coupled:COUPLED", "plant.dt": 1e-7, "detector.sample_period": 1e-6}
    scope = Instrument(build(SimParameters, values | {"plant.control_period": 2e-6, "plant.y_by_x": 0.04}), 1000)
    while not scope.block_full:
        scope.tick(np.array([0.1, 0.0, 0.0]))
    position, t = scope.take_block().measurements["position"], 2e-6 * np.arange(1000)
    scanner, metres = scope.parameters.scanner, scope.parameters.piezo.sensitivity_x
    for axis, f, xi, share in ((0, scanner.f_x, scanner.xi_x, 1.0), (1, scanner.f_y, scanner.xi_y, 0.04)):
        w, end = 2.0 * np.pi * f, 0.1 * metres * share
        step = signal.step(([w * w], [1.0, 2.0 * xi * w, w * w]), T=t)[1]
        assert position[:, axis] == pytest.approx(end * step, abs=1e-3 * end)


@pytest.mark.parametrize("plant", ["stribeck:STRIBECK", "coupled:COUPLED"])
def test_laws_track_on_plants_of_ones_own(own, plant):
    sim = build(SimParameters, AT_50_US | {"plant.kind": f"own_parts.{plant}", "run.duration": 0.12})
    for law, percent in (("pid", 50.0), ("observer", 10.0)):
        timed = at_timing(sim, build(ControllerParameters, {"law.kind": law}), 5e-5, 0)
        assert np.nanmax(simulate(*timed).score.max_percent[:2]) < percent


def test_a_fault_is_the_same_by_its_seed_and_another_by_another(own):
    fault = {"fault.kind": "own_parts.bursts:BURSTS", "fault.rate": 2000.0}
    once, again, other = (run(fault | {"plant.seed": seed}) for seed in (1, 1, 2))
    assert once.trajectory_sha256 == again.trajectory_sha256
    assert once.trajectory_sha256 != other.trajectory_sha256
    # The burst is in what is measured, not in what is there.
    noise = once.deflection - once.truth.tip_height
    assert 0.0 < (noise != 0.0).mean() < 1.0
    # A drive that got lost: the one before holds.
    held = (np.diff(once.drive[:, 0]) == 0.0).mean()
    assert held == pytest.approx(0.1, abs=0.04)


def test_a_program_approaches_until_the_tip_touches_and_hands_z_to_the_loop(own):
    values = {
        "plant.kind": "lever",
        "plant.gap": 15e-9,
        "plant.scanner": "stack_13um",
        "sample.kind": "flat",
        "onboard.kind": "pi",
        "onboard.setpoint_voltage": 1.0,
        "reference.kind": "own_parts.approach:APPROACH",
        "reference.rate": 10e-6,
        "reference.touch": 0.5,  # above what the tip rings by when it snaps in
        "detector.channels": "arrived, z_loop, truth/contact",
        "run.duration": 8e-3,
    }
    done = simulate(build(SimParameters, values), build(ControllerParameters, {"law.kind": "open_loop"}))
    arrived = done.channel("arrived")
    at = int(np.flatnonzero(arrived)[0])
    # On its way z goes by the rate; it jumps nowhere, neither when the loop takes over.
    assert np.diff(done.channel("z_loop")[1:at]) == pytest.approx(10e-12, rel=1e-6)
    assert np.abs(np.diff(done.channel("z_loop"))).max() < 20e-12
    assert done.channel("truth/contact")[at]
    assert done.deflection[-1] == pytest.approx(10e-9, rel=0.03)


def test_a_lock_in_detector_reads_amplitude_and_phase_of_the_deflection(own):
    values = {
        "detector.kind": "own_parts.lock_in:LOCK_IN",
        "detector.frequency": 1e3,
        "detector.time_constant": 5e-4,
        "detector.channels": "lock_in_amplitude, lock_in_phase",
        "detector.sample_period": 1e-5,
        "plant.control_period": 1e-5,
        "sample.kind": "flat",
    }
    scope = Instrument(build(SimParameters, values), 2000)
    rest, angle = scope.drive.copy(), 2.0 * np.pi * 1e3 * 1e-5 * np.arange(2000)
    for each in angle:
        scope.tick(np.add(rest, (0.0, 0.0, 0.5 * np.cos(each))))
    samples = dict(zip((channel.name for channel in scope.channels), scope.take_block().samples, strict=True))
    # Ten whole periods, after ten time constants: the Fourier component of the recorded deflection.
    settled = slice(1000, 2000)
    deflection = samples["deflection"][settled] * scope.parameters.detector.deflection_sensitivity
    expected = 2.0 * np.mean(deflection * np.exp(-1j * angle[settled]))
    found = np.mean(samples["lock_in_amplitude"] * np.exp(1j * samples["lock_in_phase"]), where=np.arange(2000) >= 1000)
    assert abs(expected) == pytest.approx(0.5 * 20e-9, rel=0.1)
    assert abs(found / expected - 1.0) < 0.02


def test_a_channel_of_an_own_part_is_sampled_by_name(own):
    result = run({"piezo.kind": "own_parts.creep:CREEP", "detector.channels": "truth/creep_x, truth/position_x"})
    assert [channel.name for channel in result.channels[4:]] == ["truth/creep_x", "truth/position_x"]
    assert result.channel("truth/creep_x").any()
    every = round(result.parameters.plant.control_period / result.parameters.detector.sample_period)
    np.testing.assert_array_equal(result.channel("truth/position_x")[::every], result.truth.position[:, 0])
    with pytest.raises(
        ParameterError, match=r"detector.channels = truth/nowhere is not allowed: .* there are .*truth/pos"
    ):
        Instrument(build(SimParameters, {"detector.channels": "truth/nowhere"}))


def test_a_broken_part_is_reported_by_its_name(own):
    def law(name: str) -> dict[str, object]:
        return {"law.kind": f"own_parts.broken:{name}"}

    with pytest.raises(PartError, match=r"^law own_parts.broken:RAISES: control: LookupError: .*no such gain"):
        run({}, law("RAISES"))
    with pytest.raises(
        PartError,
        match=r"^law own_parts.broken:MISSPELT: control: there is no field nothing_of_that_name: "
        r"u.voltage\[0\] = y.nothing_of_that_name \(line 12 of .*broken.py\)$",
    ):
        run({}, law("MISSPELT"))
    with pytest.raises(PartError, match=r"^law: state = NoRecord is not allowed: it must be a class with the"):
        dataclasses.replace(importlib.import_module("own_parts.kalman").KALMAN, state=type("NoRecord", (), {}))
    with pytest.raises(PartError, match=r"^law own_parts.broken:WRONG_CONSTANTS: the values of its constants"):
        run({}, law("WRONG_CONSTANTS"))
    # A constant of the name of a parameter has its value in the same unit only.
    with pytest.raises(PartError, match=r"^law own_parts.broken:WRONG_UNIT: .* the fields of the record differ: jerk$"):
        run({}, law("WRONG_UNIT"))
    with pytest.raises(
        ParameterError, match=r"law.kind = own_parts.broken:NO_PART is not allowed: .* is no law but a int"
    ):
        run({}, law("NO_PART"))
    with pytest.raises(ParameterError, match=r"law.kind = nowhere:LAW is not allowed: .* ModuleNotFoundError"):
        run({}, {"law.kind": "nowhere:LAW"})
    with pytest.raises(ParameterError, match=r"it must be one of open_loop, .*, kalman, predictive, or module:NAME"):
        run({}, {"law.kind": "kalmann"})


def test_own_parts_run_in_a_sweep(own, tmp_path):
    script = tmp_path / "many.py"
    script.write_text(SWEEP)
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, [str(own), os.environ.get("PYTHONPATH")]))}
    done = subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, check=True)
    inside = run(
        {"run.duration": 2e-4, "sample.kind": "own_parts.patches:PATCHES", "sample.ratio": 0.3},
        {"law.kind": "own_parts.kalman:KALMAN", "law.bandwidth": 5e3},
    )
    assert done.stdout.split() == [inside.trajectory_sha256]


def test_a_scenario_file_chooses_own_parts_and_gives_their_parameters(own, tmp_path):
    scenario = tmp_path / "own.yaml"
    scenario.write_text(
        """
/**/afm_sim_node:
  ros__parameters:
    run: {duration: 1.0e-3}
    score: {start: 0.0}
    sample: {kind: own_parts.patches:PATCHES, ratio: 0.3}
/**/afm_controller_node:
  ros__parameters:
    law: {kind: kalman, bandwidth: 2.0e4}
"""
    )
    environment = os.environ | {"PYTHONPATH": str(own) + os.pathsep + os.environ.get("PYTHONPATH", "")}
    done = subprocess.run(
        [sys.executable, "-m", "afm_model", scenario, "--parts", "own_parts.patches:PATCHES"],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    inside = run(
        {"run.duration": 1e-3, "sample.kind": "own_parts.patches:PATCHES", "sample.ratio": 0.3},
        {"law.kind": "kalman", "law.bandwidth": 2e4},
    )
    assert json.loads(done.stdout)["trajectory_sha256"] == inside.trajectory_sha256


CONTACTS = """
from dataclasses import replace

from .viscous import VISCOUS

UNSAID = VISCOUS
SPRING, RIGID, OTHER = (replace(VISCOUS, contact=each) for each in ("spring", "rigid", "other"))
"""
AT_50_US = {"plant.dt": 1e-7, "detector.sample_period": 5e-5, "plant.control_period": 5e-5, "run.duration": 1e-2}


@pytest.fixture
def touching(own):
    """An instrument whose plant, of somebody else's, declares this contact."""
    (own / "own_parts" / "contacts.py").write_text(CONTACTS)
    return lambda contact: build(SimParameters, SHORT | AT_50_US | {"plant.kind": f"own_parts.contacts:{contact}"})


def test_a_law_with_a_model_of_friction_runs_on_any_plant_of_ones_own_and_warns_where_its_contact_is_another(touching):
    law = build(ControllerParameters, {"law.kind": "predictive", "law.period": 5e-5})
    with pytest.warns(ContactWarning, match="this plant does not declare its contact"):
        simulate(touching("UNSAID"), law)
    for contact in ("SPRING", "RIGID"):
        simulate(touching(contact), law)
    with pytest.warns(ContactWarning, match="its model of friction is .* and this plant has another contact"):
        simulate(touching("OTHER"), law)


def test_a_linear_model_has_the_contact_that_a_plant_of_ones_own_declares(touching):
    def motion(sim):
        return plant_matrices(sim, 5e-5)[0]

    alike, paper = (build(SimParameters, SHORT | AT_50_US | {"plant.kind": kind}) for kind in ("compliant", "paper"))
    assert np.array_equal(motion(touching("SPRING")), motion(alike))
    assert np.array_equal(motion(touching("RIGID")), motion(paper))
    assert not np.array_equal(motion(alike), motion(paper))
    with pytest.warns(ContactWarning, match="the linear model holds the tip on the sample"):
        linearise(touching("UNSAID"), build(ControllerParameters, {"law.kind": "pid", "law.period": 5e-5}))


def test_of_a_plant_that_does_not_declare_its_contact_a_start_says_nothing_about_the_loop(touching):
    law = build(ControllerParameters, {"law.kind": "super_twisting"})
    told = {each: " ".join(start_warnings(*at_timing(touching(each), law, 1e-3, 1))) for each in ("RIGID", "UNSAID")}
    assert "the loop cannot be stable" in told["RIGID"] and "the loop" not in told["UNSAID"]


def test_a_step_must_resolve_the_contact_of_a_plant_of_ones_own_that_declares_a_spring(touching):
    assert np.isfinite(valid_forces(touching("SPRING"))[1])
    assert valid_forces(touching("UNSAID"))[1] == np.inf
