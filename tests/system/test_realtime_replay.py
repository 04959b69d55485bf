"""What happened in real time over topics, once and for all: played again in process it is the same to the last bit."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from afm_msgs.msg import Measurement, PiezoDrive
from geometry_msgs.msg import Vector3
from hand_controller import HandController, answer
from support import ROOT, Graph, assert_nothing_left, session

from afm_bringup import replay_command
from afm_model import simulate
from afm_model.run import Replay, recorded_parameters
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import Recording

DURATION = 0.01
UPDATE = 1e-6
"""Of the DAC [s], where there are several in a tick."""


def shortened(path: Path, **simulator: dict[str, Any]) -> Path:
    """The shipped realtime scenario, 2000 ticks of it, with other parameters for the simulator."""
    content = yaml.safe_load((ROOT / "afm_model" / "afm_model" / "scenarios" / "closed_loop_realtime.yaml").read_text())
    parameters = content["/**/afm_sim_node"]["ros__parameters"]
    parameters["score"] = {"start": 0.0}
    parameters["run"]["duration"] = DURATION
    for group, values in simulator.items():
        parameters[group] = parameters.get(group, {}) | values
    path.write_text(yaml.safe_dump(content))
    return path


def replayed(out: Path) -> tuple[dict[str, Any], Recording]:
    """Scorecard and recording of a session, after its replay has been compared with it."""
    card = json.loads((out / "scorecard.json").read_text())
    recording = read_recording(out / "recording.rrd")
    parameters = recorded_parameters(recording.parameters["afm_sim_node"])  # type: ignore[arg-type]
    assert parameters.run.mode == card["mode"] == "realtime"
    again = simulate(parameters, Replay.of(recording, parameters))
    assert again.trajectory_sha256 == card["trajectory_sha256"]
    assert np.array_equal(again.drive, recording.drive)
    assert len(recording.drive) == card["ticks"] == parameters.total_ticks
    return card, recording


def test_closed_loop_in_real_time_tracks_although_drives_come_late_and_is_replayed_to_the_last_bit(
    tmp_path: Path,
) -> None:
    """A sixth of the time of the scenario that is shipped."""
    # A machine that stands still must cost late drives here, not a retracted sample.
    scenario = shortened(
        tmp_path / "short.yaml", run={"duration": 0.02, "watchdog_timeout": 1000.0}, score={"start": 0.01}
    )
    out = tmp_path / "out"
    with session(scenario, out, folder=tmp_path) as command:
        assert command.wait() == 0, command.text
    card, _ = replayed(out)
    assert card["ticks"] == 4000
    # The clock may not run fast: 5 us of simulated time take a millisecond. Late, it may.
    assert 0.0 < card["real_time_factor"] < 0.0051
    assert card["realtime"]["ticks_retracted"] == 0
    assert card["contact_fraction"] == 1.0
    # Left alone, the scanner would stick while the reference goes to 4.2 nm.
    for axis in "xy":
        assert card["tracking"][axis]["rms_m"] == pytest.approx(0.0, abs=2e-9)
    assert_nothing_left()


def bad_run(tmp_path: Path, out: Path, factor: float) -> None:
    """A session whose drives come late, out of order and, for a while, not at all."""
    before: list[Measurement] = []
    away = False

    def bad(measurement: Measurement) -> list[PiezoDrive]:
        nonlocal away
        k = measurement.sequence
        # Silent until the sample is at the end of its way: how many ticks that takes is a matter of the machine.
        away = away or measurement.drive.z < -11.9
        if k > 500 and not away:
            return []
        stale = [answer(before[-1], 5.0, 5.0)] if k % 7 == 0 and before else []
        before.append(measurement)
        drive = answer(measurement, 0.3 * np.sin(0.01 * k), 2.0, 0.0)
        drive.horizon = [Vector3(x=0.01 * i, y=2.0) for i in range(k % 128)]
        drive.horizon_period = UPDATE
        return [drive, *stale]

    scenario = shortened(
        tmp_path / "short.yaml",
        plant={"delay_ticks": 1, "seed": 5},
        # Back within the run also where the first drives came so late that it began with a retraction.
        run={"watchdog_timeout": 0.05, "retract_time": 1e-4, "return_speed": 1e-3, "real_time_factor": factor},
        piezo={"dac_bits": 14, "limit": 15.0, "dac_period": UPDATE},
        detector={"noise": 1e-3, "channels": "drive_x,drive_y,drive_z"},
    )
    with Graph() as graph, session(scenario, out, "--controller", "external", folder=tmp_path) as command:
        graph.add(HandController(bad, "somebody"))
        assert command.wait(graph) == 0, command.text


def test_retracted_ticks_missed_periods_and_drives_out_of_order_are_replayed_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Everything that can go wrong without a fault, with a delay; a DAC that puts drives in force five times a tick."""
    # A horizon is over after 25 ticks: how slow a run must be for drives to come in time is a matter of the machine.
    for factor in (0.005, 0.0005):
        out = tmp_path / f"{factor}"
        bad_run(tmp_path, out, factor)
        card, recording = replayed(out)
        # Between two ticks the drive was another one, which only its channels tell.
        updates = recording.channels["drive_x"].values.reshape(len(recording.drive), -1)
        between = np.count_nonzero(np.ptp(updates, axis=1))
        if between > 0:
            break
    assert between > 0
    assert np.array_equal(updates[:, 0], recording.drive[:, 0])
    assert card["realtime"]["ticks_retracted"] > 0
    # The sample is at the end of its way while it is retracted.
    assert np.count_nonzero(recording.drive[:, 2] < -11.9) > 0
    assert_nothing_left()
    # What `ros2 run afm_bringup replay` says of it.
    assert replay_command.main([str(out / "recording.rrd")]) == 0
    assert f"the same trajectory in all 2000 ticks: {card['trajectory_sha256']}" in capsys.readouterr().out
    recording.channels["drive_x"].values[-1] += 1.0
    monkeypatch.setattr(replay_command, "read_recording", lambda path: recording)
    assert replay_command.main([str(out / "recording.rrd")]) == 1
    assert f"recorded is {card['trajectory_sha256']}" in capsys.readouterr().err


def test_replay_of_no_recording_is_told_in_a_sentence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert replay_command.main([str(tmp_path / "none.rrd")]) == 1
    told = f"error: {tmp_path / 'none.rrd'} is no readable recording: No such file or directory\n"
    assert capsys.readouterr().err == told
