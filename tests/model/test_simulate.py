"""Claims about a run in process."""

import contextlib
import json
import os
import pty
import re
import subprocess
import sys

import numpy as np
import pytest

from afm_model import (
    Controller,
    ControllerParameters,
    DriveError,
    ParameterError,
    SimParameters,
    build,
    flatten,
    simulate,
)
from afm_model.parts.signals import Measurement

from . import session
from .tables import numbers

VALUES = {"plant.control_period": 4e-6, "detector.sample_period": 2e-6, "score.start": 0.0}


def simulator(duration: float) -> SimParameters:
    """Parameters of a run of `duration` seconds."""
    return build(SimParameters, VALUES | {"run.duration": duration})


def test_simulation_is_the_instrument_and_the_law_tick_by_tick():
    done = simulate(simulator(2e-3), ControllerParameters())
    scope = session.instrument(VALUES, 100)
    measurements, drives, samples = session.joined(session.run(scope, session.controller({}), 2e-3))
    np.testing.assert_array_equal(numbers(done.measurements), numbers(measurements))
    np.testing.assert_array_equal(done.drive, drives)
    np.testing.assert_array_equal(done.samples, samples)
    assert done.trajectory_sha256 == scope.trajectory_sha256()
    np.testing.assert_array_equal(done.score.rms, scope.score().rms)


def test_simulation_names_its_columns():
    done = simulate(simulator(1e-3), ControllerParameters())
    assert done.time == pytest.approx(np.arange(250) * 4e-6, rel=1e-15)
    assert done.time_samples == pytest.approx(np.arange(500) * 2e-6, rel=1e-15)
    for values, name in (
        (done.deflection, "deflection"),
        (done.lateral_force, "lateral_force"),
        (done.position, "position"),
        (done.velocity, "velocity"),
        (done.reference, "reference_position"),
    ):
        np.testing.assert_array_equal(values, done.measurements[name])


def test_simulation_tells_the_true_motion_behind_noisy_sensors():
    noisy = build(SimParameters, VALUES | {"run.duration": 1e-3, "detector.position_noise": 1e-11})
    done = simulate(noisy, build(ControllerParameters, {"law.kind": "open_loop"}))
    plain = simulate(simulator(1e-3), build(ControllerParameters, {"law.kind": "open_loop"}))
    # In open loop the noise of the sensors moves nothing.
    np.testing.assert_array_equal(done.truth.position, plain.position)
    np.testing.assert_array_equal(numbers(done.truth), numbers(plain.truth))
    # By way of a voltage.
    assert done.truth.tip_height == pytest.approx(plain.deflection, rel=1e-15)
    assert (done.position != done.truth.position).any(axis=0).all()


def test_channel_is_its_samples_in_SI_units_and_an_unknown_one_names_those_there_are():
    more = build(SimParameters, VALUES | {"run.duration": 1e-3, "detector.channels": "truth/position_x"})
    done = simulate(more, ControllerParameters())
    # Two samples a tick; that at the tick is the measurement's.
    assert done.channel("deflection")[::2] == pytest.approx(done.deflection, rel=1e-15)
    np.testing.assert_array_equal(done.channel("truth/position_x")[::2], done.position[:, 0])
    with pytest.raises(KeyError, match=r"no channel truth/position_y was sampled; there are deflection, .*position_x"):
        done.channel("truth/position_y")


def test_any_object_that_answers_can_close_the_loop():
    class Hold:
        def answer(self, measurement: np.ndarray) -> np.ndarray:
            return measurement.view(Measurement)[0].drive.copy()

    done = simulate(simulator(1e-4), Hold())
    assert (done.drive == done.drive[0]).all()
    own = simulate(simulator(1e-4), Controller(ControllerParameters()))
    assert own.trajectory_sha256 == simulate(simulator(1e-4), ControllerParameters()).trajectory_sha256


def test_law_that_answers_with_nan_ends_the_run():
    class Broken:
        def answer(self, measurement: np.ndarray) -> np.ndarray:
            return np.full(3, np.nan)

    with pytest.raises(DriveError, match="x = nan V"):
        simulate(simulator(1e-4), Broken())


def test_endless_run_is_refused():
    with pytest.raises(ParameterError, match=r"run\.duration = 0 s"):
        simulate(SimParameters(), ControllerParameters())


@pytest.mark.parametrize(("duration", "ticks"), [(4e-6, 1), (4.1e-6, 2), (0.3, 75_000), (0.0, 0)])
def test_run_covers_its_duration_with_no_tick_too_many(duration, ticks):
    assert simulator(duration).total_ticks == ticks


def test_progress_ends_at_the_last_tick():
    calls: list[tuple[int, int]] = []
    simulate(simulator(1e-3), ControllerParameters(), progress=lambda done, total: calls.append((done, total)))
    assert calls[-1] == (250, 250)


def test_parameters_of_the_run_keep_those_of_the_instrument():
    flat = flatten(SimParameters())
    assert {"run.duration", "run.mode", "plant.dt"} <= set(flat)


LONG = """
/**/afm_sim_node:
  ros__parameters: {run: {duration: 0.2}, plant: {control_period: 1.0e-6}, score: {start: 0.0}}
"""


@pytest.mark.parametrize("terminal", [True, False])
def test_command_line_shows_the_progress_of_a_long_run_on_a_terminal_and_only_there(tmp_path, terminal):
    scenario = tmp_path / "long.yaml"
    scenario.write_text(LONG)  # long enough in both cases, as the case of the terminal shows
    ours, theirs = pty.openpty() if terminal else os.pipe()
    try:
        done = subprocess.Popen(
            [sys.executable, "-m", "afm_model", scenario],
            stdout=subprocess.PIPE,
            stderr=theirs,
            env=os.environ | {"TERM": "xterm", "COLUMNS": "80"},
        )
        os.close(theirs)
        shown = b""
        # A terminal whose other end is closed answers with an error.
        with contextlib.suppress(OSError):
            while part := os.read(ours, 4096):
                shown += part
        answer, _ = done.communicate(timeout=400)
    finally:
        os.close(ours)
    assert done.returncode == 0
    assert len(json.loads(answer)["trajectory_sha256"]) == 64
    shares = {int(n) for n in re.findall(rb"(\d+)%", shown)}
    if terminal:
        assert b"simulating" in shown
        assert any(0 < share < 100 for share in shares)
    else:
        assert shown.strip() == b""
