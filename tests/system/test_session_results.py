"""A session leaves the same complete results every time: score, recording, picture."""

import json
import struct
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.image import imread
from support import assert_nothing_left, executable, session, write_scenario

from afm_model import ControllerParameters, SimParameters, Simulation, build, simulate
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import Recording

TICKS, CONTROL_PERIOD, SAMPLE_PERIOD = 2000, 2e-6, 1e-6
SIMULATOR = {
    "run.duration": TICKS * CONTROL_PERIOD,
    "plant.control_period": CONTROL_PERIOD,
    "detector.sample_period": SAMPLE_PERIOD,
    "score.start": 0.001,
}
CONTROLLER = {"law.kind": "tanh", "law.alpha": 12.5}
NUMBERS = {
    "control_period_s",
    "simulated_s",
    "wall_s",
    "real_time_factor",
    "ticks",
    "drives_lost",
    "horizon_ticks",
    "tracking.x.rms_m",
    "tracking.x.max_m",
    "tracking.x.max_percent",
    "tracking.y.rms_m",
    "tracking.y.max_m",
    "tracking.y.max_percent",
    "tracking.z.rms_m",
    "tracking.z.max_m",
    "tracking.z.max_percent",
    "drive_total_variation_per_s.x",
    "drive_total_variation_per_s.y",
    "drive_total_variation_per_s.z",
    "stick.phases",
    "stick.time_fraction",
    "round_trip_us.p50",
    "round_trip_us.p99",
    "round_trip_us.p99_9",
    "round_trip_us.max",
}
TEXTS = {"scenario", "controller", "plant", "mode", "trajectory_sha256"}


@dataclass
class Finished:
    code: int
    printed: str
    out: Path

    @property
    def card(self) -> dict[str, Any]:
        return dict(json.loads((self.out / "scorecard.json").read_text()))


def flat(tree: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for name, value in tree.items():
        found |= flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {prefix + name: value}
    return found


def run(folder: Path, *options: str) -> Finished:
    scenario = write_scenario(
        folder / "short.yaml",
        scenario={"title": "A short run, 2 [ms] [/b]"},
        afm_sim_node=SIMULATOR,
        afm_controller_node=CONTROLLER,
    )
    out = folder / "deep" / "out"
    with session(scenario, out, *options, folder=folder, picture=True) as command:
        code = command.wait()
    assert_nothing_left()
    return Finished(code, command.text, out)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """Three processes, into a folder where older results stand."""
    folder = tmp_path_factory.mktemp("first")
    (folder / "deep" / "out").mkdir(parents=True)
    for name in ("scorecard.json", "recording.rrd", "recording-2.rrd"):
        (folder / "deep" / "out" / name).write_text("of an older run")
    return run(folder)


@pytest.fixture(scope="module")
def second(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    """Simulator and controller in one process, into a folder that is not there yet."""
    return run(tmp_path_factory.mktemp("second"), "--composed")


@pytest.fixture(scope="module")
def recording(first: Finished) -> Recording:
    return read_recording(first.out / "recording.rrd")


@pytest.fixture(scope="module")
def expected() -> Simulation:
    """The same scenario without any topic."""
    return simulate(build(SimParameters, SIMULATOR), build(ControllerParameters, CONTROLLER))


def test_session_ends_with_code_0_its_results_and_nothing_else(first: Finished, second: Finished) -> None:
    for finished in (first, second):
        assert finished.code == 0, finished.printed
        assert {file.name for file in finished.out.iterdir()} == {
            "recording.mcap",
            "recording.rrd",
            "overview.png",
            "scorecard.json",
            "logs",
        }
        for name in ("recording.rrd", "overview.png", "scorecard.json"):
            assert str(finished.out / name) in finished.printed
        assert "Traceback" not in finished.printed
        for log in (finished.out / "logs").iterdir():
            assert "Traceback" not in log.read_text()
            assert "ERROR" not in log.read_text(), log.read_text()
            # All is as asked, also that the simulator ends; only another ROS than that of the lock may be slower.
            warned = [line for line in log.read_text().splitlines() if "WARN" in line and "it is slower" not in line]
            assert not warned


def test_two_sessions_and_the_loop_in_process_give_the_same_trajectory(
    first: Finished, second: Finished, expected: Simulation
) -> None:
    assert first.card["trajectory_sha256"] == expected.trajectory_sha256
    assert second.card["trajectory_sha256"] == expected.trajectory_sha256


def test_scorecard_is_complete_and_true(first: Finished, second: Finished, expected: Simulation) -> None:
    score = expected.score
    for finished in (first, second):
        card = flat(finished.card)
        assert set(card) >= NUMBERS | TEXTS
        assert {name for name in NUMBERS if not isinstance(card[name], int | float)} == set()
        assert (card["scenario"], card["controller"]) == ("short", "tanh")
        assert (card["plant"], card["mode"], card["control_period_s"]) == ("compliant", "lockstep", CONTROL_PERIOD)
        assert (card["ticks"], card["drives_lost"]) == (TICKS, 0)
        # Written with six digits.
        digits = {"rel": 1e-5, "abs": 0.0}
        assert card["simulated_s"] == pytest.approx(TICKS * CONTROL_PERIOD, **digits)
        # The wall time is written in milliseconds.
        assert card["wall_s"] == pytest.approx(card["simulated_s"] / card["real_time_factor"], abs=0.6e-3)
        for i, axis in enumerate("xyz"):
            assert card[f"tracking.{axis}.rms_m"] == pytest.approx(score.rms[i], **digits)
            assert card[f"tracking.{axis}.max_m"] == pytest.approx(score.max[i], **digits)
            assert card[f"tracking.{axis}.max_percent"] == pytest.approx(score.max_percent[i], **digits)
            assert card[f"drive_total_variation_per_s.{axis}"] == pytest.approx(
                score.drive_total_variation[i], **digits
            )
        assert card["stick.phases"] == score.stick_phases
        assert card["stick.time_fraction"] == pytest.approx(score.stick_fraction, **digits)
        assert 0.0 < card["round_trip_us.p50"] <= card["round_trip_us.p99"] <= card["round_trip_us.max"]
        assert card["round_trip_us.max"] < 1e6 * card["wall_s"]


def test_score_is_printed_as_a_table(first: Finished) -> None:
    card = first.card
    assert "A short run, 2 [ms] [/b]" in first.printed
    assert f"{card['tracking']['x']['rms_m'] * 1e9:.4g}" in first.printed
    lines = [line.split() for line in first.printed.splitlines()]
    assert ["control", "ticks", str(TICKS)] in lines
    assert ["drives", "lost,", "refused,", "outdated,", "ahead", "0,", "0,", "0,", "0"] in lines
    assert card["trajectory_sha256"][:16] in first.printed


def test_recording_is_accepted_by_rerun(first: Finished) -> None:
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(first.out / "recording.rrd")]
    verified = subprocess.run(command, capture_output=True, text=True, check=False)
    assert verified.returncode == 0, verified.stdout + verified.stderr


def test_recording_holds_the_detector_at_the_full_rate(recording: Recording, expected: Simulation) -> None:
    per_tick = round(CONTROL_PERIOD / SAMPLE_PERIOD)
    count = TICKS * per_tick
    # Times are whole nanoseconds in the file: exact.
    assert np.array_equal(recording.time_samples, np.arange(count) * 1000 / 1e9)
    for got, name in (
        (recording.deflection, "deflection"),
        (recording.lateral_force, "lateral_force"),
        (recording.lateral_force_y, "truth/lateral_force_y"),
        (recording.normal_force, "truth/normal_force"),
    ):
        assert got.shape == (count,)
        # nm and nN in the file: a multiplication and a division of round-off.
        np.testing.assert_allclose(got, expected.channel(name), rtol=1e-14, atol=0.0)


def test_recording_holds_every_tick(recording: Recording, expected: Simulation) -> None:
    assert np.array_equal(recording.time_ticks, np.arange(TICKS) * 2000 / 1e9)
    close = {"rtol": 1e-14, "atol": 0.0}
    np.testing.assert_allclose(recording.position, expected.position, **close)
    np.testing.assert_allclose(recording.reference, expected.reference, **close)
    np.testing.assert_allclose(recording.drive, expected.drive, **close)
    assert np.isfinite(recording.round_trip).all()


def test_recording_tells_what_the_run_was_made_with(recording: Recording) -> None:
    simulator, controller = (recording.parameters[name] for name in ("afm_sim_node", "afm_controller_node"))
    assert {name: simulator[name] for name in SIMULATOR} == SIMULATOR
    assert {name: controller[name] for name in CONTROLLER} == CONTROLLER
    assert recording.parameter_changes == []
    states = [text.split(":")[0] for _, text in recording.events if "score" not in text]
    assert states[-1] == "FINISHED"
    assert "RUNNING" in states


def test_inspect_tells_of_a_session_what_its_scorecard_tells(first: Finished) -> None:
    command = [executable("afm_recorder_node", "inspect"), first.out / "recording.rrd"]
    said = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert said.returncode == 0, said.stderr
    card = first.card
    row = next(line for line in said.stdout.splitlines() if line.startswith("tracking error, rms ["))
    unit, *rms = row.removeprefix("tracking error, rms ").split()
    assert [{"[pm]": 1e-12, "[nm]": 1e-9}[unit] * float(each) for each in rms] == pytest.approx(
        [card["tracking"][axis]["rms_m"] for axis in "xyz"], rel=1e-3, abs=0.0
    )
    assert f"{TICKS} ticks of 2 µs" in said.stdout and card["trajectory_sha256"] in said.stdout
    assert "law.alpha" in said.stdout and "12.5" in said.stdout and "FINISHED" in said.stdout


def test_overview_is_a_picture_of_sensible_size_with_something_in_it(first: Finished) -> None:
    data = (first.out / "overview.png").read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", data[16:24])
    assert 800 <= width <= 4000
    assert 500 <= height <= 3000
    picture = imread(first.out / "overview.png")[..., :3]
    # Each of the four plots holds ink beyond its frame.
    for rows in (slice(0, height // 2), slice(height // 2, None)):
        for columns in (slice(0, width // 2), slice(width // 2, None)):
            assert np.mean(np.any(picture[rows, columns] < 0.9, axis=-1)) > 0.01
