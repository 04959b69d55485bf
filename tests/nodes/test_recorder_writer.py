"""A recording holds what was put in: every number, at its exact time, in SI units again when it is read."""

import itertools
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import CONTROL_PERIOD, PERIOD, Run

from afm_bringup.replay_command import main as replay
from afm_recorder_node import layout
from afm_recorder_node.layout import instants
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import ParameterChange, Recording, RecordingError
from afm_recorder_node.writer import RecordingWriter

SIGNALS = {
    "ticks": ("position", "reference", "error", "drive", "round_trip"),
    "samples": ("deflection", "lateral_force", "lateral_force_y", "normal_force"),
}
# One multiplication and one division lie between what goes in and what comes out.
ROUND_OFF = 4 * np.finfo(np.float64).eps


def close_enough(got: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(got, expected, rtol=ROUND_OFF, atol=0.0, equal_nan=True)


def record(path: Path, run: Run, edges: list[int]) -> Recording:
    with closing(RecordingWriter(path)) as writer:
        for start, stop in itertools.pairwise(edges):
            run.write(writer, start, stop)
    return read_recording(path)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Run, Recording]:
    """As many numbers as a period of the demo has."""
    path = tmp_path_factory.mktemp("demo") / "demo.rrd"
    run = Run(62_832)
    return path, run, record(path, run, [*range(0, run.ticks, 500), run.ticks])


def test_every_number_comes_back(demo: tuple[Path, Run, Recording]) -> None:
    _, run, recording = demo
    close_enough(recording.position, run.position)
    close_enough(recording.reference, run.reference)
    close_enough(recording.deflection, run.samples[0] * 10e-9)
    close_enough(recording.lateral_force, run.samples[1] * 50e-9)
    close_enough(recording.lateral_force_y, run.samples[2])
    close_enough(recording.normal_force, run.samples[3])
    close_enough(recording.round_trip, run.round_trip.astype(np.float64))
    assert np.array_equal(recording.drive, run.drive)


def test_photodetector_voltages_can_be_recovered(demo: tuple[Path, Run, Recording]) -> None:
    _, run, recording = demo
    close_enough(recording.deflection / recording.deflection_scale, run.samples[0])
    close_enough(recording.lateral_force / recording.lateral_scale, run.samples[1])


def test_error_is_of_the_scanner_along_x_y_and_of_the_tip_along_z(demo: tuple[Path, Run, Recording]) -> None:
    _, run, recording = demo
    close_enough(recording.error[:, :2], (run.position - run.reference)[:, :2])
    close_enough(recording.error[:, 2], 3e-9 + run.deflection - run.reference[:, 2])


def test_thinned_recording_holds_one_in_so_many_of_everything(demo: tuple[Path, Run, Recording]) -> None:
    path, _, whole = demo
    thin = read_recording(path, every=10)
    for name in ("ticks", "samples"):
        times, all_times = (getattr(recording, f"time_{name}") for recording in (thin, whole))
        assert 0.1 <= len(times) / len(all_times) < 0.11
        kept = np.isin(all_times, times)
        for signal in SIGNALS[name]:
            np.testing.assert_array_equal(getattr(thin, signal), getattr(whole, signal)[kept])
    assert thin.events == whole.events
    assert thin.parameters == whole.parameters


def test_times_are_exact_multiples_of_the_period(demo: tuple[Path, Run, Recording]) -> None:
    _, run, recording = demo
    assert np.array_equal(recording.time_ticks, np.arange(run.ticks) * 2_000 / 1e9)
    assert np.array_equal(recording.time_samples, np.arange(2 * run.ticks) * 1_000 / 1e9)


def test_demo_recording_is_valid_and_small(demo: tuple[Path, Run, Recording]) -> None:
    path, _, _ = demo
    # The numbers themselves are 11 MB, and noise does not compress.
    assert path.stat().st_size < 25e6
    program = Path(sys.executable).with_name("rerun")
    result = subprocess.run([program, "rrd", "verify", path], capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr


@settings(max_examples=10, deadline=None)
@given(cuts=st.lists(st.integers(0, 300), max_size=6), flushed=st.booleans())
def test_recording_does_not_depend_on_the_blocks(
    tmp_path_factory: pytest.TempPathFactory, cuts: list[int], flushed: bool
) -> None:
    path, run = tmp_path_factory.mktemp("blocks") / "run.rrd", Run(300)
    with closing(RecordingWriter(path)) as writer:
        edges = sorted([0, *cuts, run.ticks])
        for start, stop in itertools.pairwise(edges):
            run.write(writer, start, stop)
            if flushed:
                writer.flush()
    recording = read_recording(path)
    assert np.array_equal(recording.time_samples, np.arange(600) * 1_000 / 1e9)
    close_enough(recording.position, run.position)
    close_enough(recording.normal_force, run.samples[3])


def test_blocks_in_any_order_come_out_sorted(tmp_path: Path) -> None:
    run = Run(300)
    with closing(RecordingWriter(tmp_path / "run.rrd")) as writer:
        for start in (200, 0, 100):
            run.write(writer, start, start + 100)
    recording = read_recording(tmp_path / "run.rrd")
    assert np.array_equal(recording.time_ticks, np.arange(300) * 2_000 / 1e9)
    close_enough(recording.position, run.position)


def test_score_comes_back(tmp_path: Path) -> None:
    values = {"ticks": 10, "rms": [1e-9, 2e-9, float("nan")], "trajectory_sha256": "ab"}
    with closing(RecordingWriter(tmp_path / "run.rrd")) as writer:
        Run(10).write(writer, 0, 10)
        writer.score(20_000, values)
    score = read_recording(tmp_path / "run.rrd").score
    assert score is not None
    np.testing.assert_equal(score, values)
    assert record(tmp_path / "other.rrd", Run(10), [0, 10]).score is None


def test_a_missing_block_of_one_channel_reads_as_nan(tmp_path: Path) -> None:
    with closing(RecordingWriter(tmp_path / "run.rrd")) as writer:
        writer.channel(layout.DEFLECTION, 0, PERIOD, np.ones(30))
        writer.channel(layout.NORMAL_FORCE, 0, PERIOD, np.ones(10))
        writer.channel(layout.NORMAL_FORCE, 20, PERIOD, np.ones(10))
    recording = read_recording(tmp_path / "run.rrd")
    assert len(recording.time_samples) == 30
    assert np.array_equal(np.isnan(recording.normal_force), np.arange(30) // 10 == 1)
    assert np.isnan(recording.lateral_force).all()
    assert recording.position.shape == (0, 3)


def test_round_trip_without_an_answer_stays_nan(tmp_path: Path) -> None:
    run = Run(10)
    run.round_trip[4] = np.nan
    recording = record(tmp_path / "run.rrd", run, [0, 10])
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


def test_nothing_stands_under_the_name_before_close(tmp_path: Path) -> None:
    path = tmp_path / "new" / "run.rrd"
    writer = RecordingWriter(path)
    Run(10).write(writer, 0, 10)
    assert not path.exists()
    assert writer.partial.exists()
    assert writer.close() == path
    assert path.exists()
    assert not writer.partial.exists()
    assert writer.close() is None


def test_older_recording_stands_and_the_new_one_gets_the_next_name(tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    record(path, Run(10, seed=1), [0, 10])
    writer = RecordingWriter(path)
    Run(20).write(writer, 0, 20)
    assert len(read_recording(path).time_ticks) == 10
    assert writer.close() == tmp_path / "run-2.rrd"
    assert len(read_recording(path).time_ticks) == 10
    assert len(read_recording(tmp_path / "run-2.rrd").time_ticks) == 20


def test_recording_without_samples_leaves_no_file_and_no_older_one_is_lost(tmp_path: Path) -> None:
    record(tmp_path / "run.rrd", Run(10), [0, 10])
    with closing(RecordingWriter(tmp_path / "run.rrd")) as writer:
        writer.event(0, "WAITING")
    assert [file.name for file in tmp_path.iterdir()] == ["run.rrd"]
    assert len(read_recording(tmp_path / "run.rrd").time_ticks) == 10


def test_parameters_and_their_changes_come_back(tmp_path: Path) -> None:
    path = tmp_path / "run.rrd"
    with closing(RecordingWriter(path)) as writer:
        writer.parameters("afm_sim_node", {"plant.kind": "compliant", "plant.dt": 1e-6})
        writer.parameters("afm_controller_node", {"law.alpha": 20.0, "law.kind": "tanh"})
        Run(100).write(writer, 0, 100)
        writer.event(1_000, "STALLED: no answer", "WARN")
        writer.parameter_change(60_000, "afm_controller_node", "law.alpha", 20.0, 5.0)
        writer.parameter_change(80_000, "afm_controller_node", "law.kind", "tanh", "sgn")
    recording = read_recording(path)
    assert recording.parameters == {
        "afm_sim_node": {"plant.kind": "compliant", "plant.dt": 1e-6},
        "afm_controller_node": {"law.alpha": 20.0, "law.kind": "tanh"},
    }
    assert recording.parameter_changes == [
        ParameterChange(6e-5, "afm_controller_node", "law.alpha", 20.0, 5.0),
        ParameterChange(8e-5, "afm_controller_node", "law.kind", "tanh", "sgn"),
    ]
    assert recording.events == [
        (1e-6, "STALLED: no answer"),
        (6e-5, "afm_controller_node: law.alpha changed from 20.0 to 5.0"),
        (8e-5, "afm_controller_node: law.kind changed from tanh to sgn"),
    ]


@pytest.mark.parametrize(
    ("name", "content"), [("absent.rrd", None), ("empty.rrd", b""), ("text.rrd", b"hello"), ("head.rrd", b"RRF2")]
)
def test_file_that_is_no_recording_is_named(tmp_path: Path, name: str, content: bytes | None) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RecordingError, match=name):
        read_recording(path)


def test_wrong_shape_is_refused(tmp_path: Path) -> None:
    with closing(RecordingWriter(tmp_path / "run.rrd")) as writer:
        run = Run(10)
        run.position = run.position[:9]
        with pytest.raises(ValueError, match="shape"):
            run.write(writer, 0, 10)


def test_path_that_cannot_be_used_is_refused_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        RecordingWriter(tmp_path / "file" / "run.rrd")


WRITE_BEYOND_A_LIMIT = """
import resource, signal, sys
import numpy as np
from afm_recorder_node import layout
from afm_recorder_node import writer as module
module._FLUSH_LIMIT = 2.0
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
writer = module.RecordingWriter(sys.argv[1])
writer.channel(layout.DEFLECTION, 0, 1e-6, np.random.default_rng(0).random(100_000))
try:
    writer.close()
except OSError as error:
    print(error)
"""


def test_recording_that_could_not_be_written_completely_gets_no_name_and_the_process_ends(tmp_path: Path) -> None:
    command = [sys.executable, "-c", WRITE_BEYOND_A_LIMIT, str(tmp_path / "run.rrd")]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert "incomplete" in result.stdout, result.stderr
    assert not (tmp_path / "run.rrd").exists()


def test_of_every_so_many_rows_one_is_kept_by_its_number_and_the_rest_is_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, every = Run(3000), 7
    paths = []
    for name, options in (("all", {}), ("few", {"every": every})):
        writer = RecordingWriter(tmp_path / f"{name}.rrd", **options)
        writer.parameters("afm_sim_node", {"plant.control_period": CONTROL_PERIOD})
        for start in range(500, 3000, 500):  # blocks that no multiple of 7 begins
            run.write(writer, start, start + 500)
        writer.score(0, {"trajectory_sha256": "of the whole run"})
        paths.append(writer.close())
    whole, few = (read_recording(path) for path in paths)
    ticks, samples = np.arange(500, 3000), np.arange(1000, 6000)
    for name in ("position", "reference", "error", "drive", "round_trip", "time_ticks"):
        assert np.array_equal(getattr(few, name), getattr(whole, name)[ticks % every == 0])
    for name, channel in whole.channels.items():
        assert np.array_equal(few.channels[name].values, channel.values[samples % every == 0])
        assert np.array_equal(few.channels[name].time, channel.time[samples % every == 0])
    assert few.score == whole.score
    assert (0.0, "one tick and one sample of each channel in 7 are recorded") in few.events
    assert replay([str(paths[1])]) == 1
    assert "not every tick was recorded" in capsys.readouterr().err
