"""A record gives back what was published: every number, at its exact time, in SI units."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recorded
from afm_msgs.msg import Event, InstrumentStatus, Score
from geometry_msgs.msg import Vector3
from hypothesis import given
from hypothesis import strategies as st
from recorded import HEIGHT, Run, Topic, event, parameters, status, waveform

from afm_recorder_node.layout import instants
from afm_recorder_node.reader import read_recording, read_signals
from afm_recorder_node.recording import IncompleteRecording, ParameterChange, Recording, RecordingError


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Run, Recording]:
    run = Run(6000)
    path = recorded.record(tmp_path_factory.mktemp("whole") / "run.mcap", run.messages())
    return path, run, read_recording(path)


def test_every_number_comes_back_at_its_exact_time(whole: tuple[Path, Run, Recording]) -> None:
    _, run, recording = whole
    assert np.array_equal(recording.time_ticks, np.arange(run.ticks) * 2_000 / 1e9)
    assert np.array_equal(recording.time_samples, np.arange(2 * run.ticks) * 1_000 / 1e9)
    for name in ("position", "reference", "drive", "round_trip"):
        assert np.array_equal(getattr(recording, name), getattr(run, name))
    names = ("deflection", "lateral_force", "lateral_force_y", "normal_force")
    for name, samples, scale in zip(names, run.samples, run.scales, strict=True):
        assert np.array_equal(getattr(recording, name), samples * scale)
    assert (recording.deflection_scale, recording.lateral_scale) == run.scales[:2]
    assert recording.complete and not recording.missing and recording.score is None


def test_error_is_of_the_scanner_along_x_y_and_of_the_tip_along_z(whole: tuple[Path, Run, Recording]) -> None:
    _, run, recording = whole
    assert np.array_equal(recording.error[:, :2], (run.position - run.reference)[:, :2])
    assert np.array_equal(recording.error[:, 2], HEIGHT + run.deflection - run.reference[:, 2])


def test_height_of_the_cantilever_that_comes_after_the_first_blocks_counts_from_the_start(tmp_path: Path) -> None:
    first, *blocks = Run(1000).messages()
    recording = read_recording(recorded.record(tmp_path / "run.mcap", [*blocks, first]))
    assert np.isfinite(recording.error).all()


def test_thinned_recording_holds_one_in_so_many_of_everything(whole: tuple[Path, Run, Recording]) -> None:
    path, run, recording = whole
    thin = read_recording(path, every=7)
    assert np.array_equal(thin.position, run.position[::7])
    assert np.array_equal(thin.normal_force, run.samples[3][::7])
    assert np.array_equal(thin.time_samples, recording.time_samples[::7])


def test_part_of_a_signal_is_read_alone_and_an_unknown_one_is_answered_with_its_neighbours(
    whole: tuple[Path, Run, Recording],
) -> None:
    path, run, _ = whole
    found = read_signals(path, ["drive", "truth/normal_force"], 3e-3, 4e-3)
    assert np.array_equal(found["drive"].values, run.drive[1500:2001])
    assert np.array_equal(found["truth/normal_force"].values, run.samples[3][3000:4001])
    with pytest.raises(RecordingError, match="did you mean drive"):
        read_signals(path, ["drives"])


@given(cuts=st.lists(st.integers(1, 299), max_size=6, unique=True))
def test_recording_does_not_depend_on_the_blocks(tmp_path_factory: pytest.TempPathFactory, cuts: list[int]) -> None:
    run, edges = Run(300), sorted([0, *cuts, 300])
    blocks = [list(run.block(*pair)) for pair in pairwise(edges)]
    if len(cuts) % 2:
        blocks.reverse()  # what is put in any order comes out sorted
    path = tmp_path_factory.mktemp("blocks") / "run.mcap"
    recording = read_recording(recorded.record(path, [topic for block in blocks for topic in block]))
    assert np.array_equal(recording.time_samples, np.arange(600) * 1_000 / 1e9)
    assert np.array_equal(recording.position, run.position)
    assert np.array_equal(recording.normal_force, run.samples[3])


def test_a_missing_block_of_one_channel_reads_as_nan(tmp_path: Path) -> None:
    messages = [("deflection", waveform(0, np.ones(30)))]
    messages += [("truth/normal_force", waveform(first, np.ones(10), "N")) for first in (0, 20)]
    recording = read_recording(recorded.record(tmp_path / "run.mcap", messages))
    assert len(recording.time_samples) == 30
    assert np.array_equal(np.isnan(recording.normal_force), np.arange(30) // 10 == 1)
    assert np.isnan(recording.lateral_force).all()
    assert recording.position.shape == (0, 3)


def test_round_trip_without_an_answer_stays_nan(tmp_path: Path) -> None:
    run = Run(10)
    run.round_trip[4] = np.nan
    recording = read_recording(recorded.record(tmp_path / "run.mcap", run.messages()))
    assert np.flatnonzero(np.isnan(recording.round_trip)).tolist() == [4]


@given(
    first=st.integers(0, 10**10), cut=st.integers(0, 50), period=st.sampled_from([1e-6, 2e-6, 1e-3, 1 / 3e6, 12.5e-9])
)
def test_times_of_two_blocks_are_those_of_one(first: int, cut: int, period: float) -> None:
    whole = instants(first, 50, period)
    assert np.array_equal(
        whole, np.concatenate([instants(first, cut, period), instants(first + cut, 50 - cut, period)])
    )
    # Half a nanosecond from rounding; the rest is what a float64 holds of the product.
    assert abs(whole[0] - first * period * 1e9) <= 0.5 + 1e-15 * first * period * 1e9
    assert (np.diff(whole) > 0).all()


def test_times_of_whole_nanoseconds_never_drift() -> None:
    # 2e-6 * 1e9 is 2000.0000000000002; after 10^15 ticks that would be 200 ns.
    assert instants(10**15, 1, 2e-6)[0] == 2_000 * 10**15


def score(**values: Any) -> Topic:
    return "score", Score(run_id=1, **values)


def test_states_events_parameters_their_changes_and_the_score_come_back(tmp_path: Path) -> None:
    messages = [
        parameters("afm_sim_node", {"plant.kind": "compliant", "plant.dt": 1e-6, "own": [1.0, 2.0]}),
        parameters("afm_controller_node", {"law.alpha": 20.0, "law.kind": "tanh"}),
        status(0.0, InstrumentStatus.RUNNING),
        *Run(100).block(0, 100),
        status(1e-6, InstrumentStatus.STALLED, "no answer"),
        event(8e-5, "noise has begun", Event.WARN),
        parameters("afm_controller_node", {"law.alpha": 5.0, "law.kind": "tanh"}, changed_at=6e-5),
        status(1e-4, InstrumentStatus.RUNNING),
        score(ticks=100, rms=Vector3(x=1e-9, y=2e-9, z=float("nan")), valid=True, faults=["noise"]),
    ]
    recording = read_recording(recorded.record(tmp_path / "run.mcap", messages))
    assert recording.parameters == {
        "afm_sim_node": {"plant.kind": "compliant", "plant.dt": 1e-6, "own": [1.0, 2.0]},
        "afm_controller_node": {"law.alpha": 20.0, "law.kind": "tanh"},
    }
    assert recording.parameter_changes == [ParameterChange(6e-5, "afm_controller_node", "law.alpha", 20.0, 5.0)]
    assert list(zip(recording.events, recording.event_levels, strict=True)) == [
        ((0.0, "RUNNING"), "INFO"),
        ((1e-6, "STALLED: no answer"), "WARN"),
        ((6e-5, "afm_controller_node: law.alpha changed from 20.0 to 5.0"), "INFO"),
        ((8e-5, "noise has begun"), "WARN"),
        ((1e-4, "RUNNING"), "INFO"),
    ]
    assert recording.score is not None and recording.score["ticks"] == 100 and recording.score["valid"] is True
    assert recording.score["faults"] == ["noise"]
    np.testing.assert_equal(recording.score["rms"], {"x": 1e-9, "y": 2e-9, "z": float("nan")})


def test_record_that_lacks_something_says_what(tmp_path: Path) -> None:
    path = recorded.record(tmp_path / "run.mcap", Run(10).messages(), {"missing": "7 ticks are missing"})
    with pytest.warns(IncompleteRecording, match=r"run\.mcap is not complete: 7 ticks are missing"):
        recording = read_recording(path)
    assert not recording.complete and recording.missing == "7 ticks are missing"


def test_folder_view_and_record_are_the_same_recording(tmp_path: Path) -> None:
    path = recorded.record(tmp_path / "out" / "run.mcap", Run(10).messages())
    (tmp_path / "other.rrd").write_bytes(b"for the viewer")
    with pytest.raises(RecordingError, match=r"its record other\.mcap is not next to it"):
        read_recording(tmp_path / "other.rrd")
    path.with_suffix(".rrd").write_bytes(b"for the viewer")
    for place in (path, path.with_suffix(".rrd"), path.parent, tmp_path):
        assert len(read_recording(place).time_ticks) == 10
    recorded.record(tmp_path / "out" / "run-2.mcap", Run(10).messages())
    with pytest.raises(RecordingError, match=r"holds 2 recordings: give one of run-2\.mcap, run\.mcap"):
        read_recording(tmp_path / "out")
