"""A view shows the messages of a record: every number, at its exact time, in the units of the plots."""

import itertools
import os
import resource
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recorded import HEIGHT, Run, begin, event, parameters, record, status, waveform
from support import TIMEOUT, processes, wait_until
from viewed import chunks, column, events, series, view

from afm_model.run import RunState
from afm_recorder_node import layout
from afm_recorder_node.layout import instants
from afm_recorder_node.recording import DamagedRecording, RecordingError
from afm_recorder_node.views import make_view
from afm_recorder_node.views_worker import News, Worker

# Two multiplications lie between what is recorded and what is plotted.
ROUND_OFF = 4 * np.finfo(np.float64).eps


def close_enough(got: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(got, expected, rtol=ROUND_OFF, atol=0.0, equal_nan=True)


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Run]:
    """As many numbers as a period of the demo has; one answer has not come."""
    run = Run(62_832)
    run.round_trip[4] = np.nan
    return view(tmp_path_factory.mktemp("demo") / "demo.rrd", run.messages()), run


def test_every_number_is_plotted_at_its_time_in_nm_nn_and_us(demo: tuple[Path, Run]) -> None:
    path, run = demo
    close_enough(series(path, "/position")[1], 1e9 * run.position)
    close_enough(series(path, "/reference")[1], 1e9 * run.reference)
    close_enough(series(path, "/deflection")[1], 1e9 * (run.samples[0] * 10e-9))
    close_enough(series(path, "/lateral_force")[1], 1e9 * (run.samples[1] * 50e-9))
    close_enough(series(path, "/truth/lateral_force_y")[1], 1e9 * run.samples[2])
    close_enough(series(path, "/truth/normal_force")[1], 1e9 * run.samples[3])
    close_enough(series(path, "/round_trip")[1], 1e6 * run.round_trip.astype(np.float64))
    assert np.array_equal(series(path, "/drive")[1], run.drive)
    assert np.array_equal(series(path, "/drive")[0], np.arange(run.ticks) * 2_000)
    assert np.array_equal(series(path, "/deflection")[0], np.arange(2 * run.ticks) * 1_000)


def test_error_is_of_the_scanner_along_x_y_and_of_the_tip_along_z(demo: tuple[Path, Run]) -> None:
    path, run = demo
    error = series(path, "/error")[1]
    close_enough(error[:, :2], 1e9 * (run.position - run.reference)[:, :2])
    close_enough(error[:, 2], 1e9 * (HEIGHT + run.deflection - run.reference[:, 2]))


def test_view_of_the_demo_is_valid_small_and_in_large_chunks(demo: tuple[Path, Run]) -> None:
    path, run = demo
    # The numbers themselves are 11 MB, and noise does not compress.
    assert path.stat().st_size < 25e6
    assert len(list(chunks(path, "/deflection"))) <= 2 + 2 * run.ticks // 32_768
    command = [Path(sys.executable).with_name("rerun"), "rrd", "verify", path]
    result = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT)
    assert result.returncode == 0, result.stderr


@settings(max_examples=5, deadline=None)
@given(cuts=st.lists(st.integers(0, 300), max_size=6))
def test_view_does_not_depend_on_the_blocks(tmp_path_factory: pytest.TempPathFactory, cuts: list[int]) -> None:
    run = Run(300)
    blocks = (run.block(*edges) for edges in itertools.pairwise(sorted([*{0, *cuts, run.ticks}])))
    path = view(tmp_path_factory.mktemp("blocks") / "run.rrd", itertools.chain(*blocks))
    assert np.array_equal(series(path, "/deflection")[0], np.arange(600) * 1_000)
    close_enough(series(path, "/position")[1], 1e9 * run.position)


def test_height_of_the_cantilever_may_come_after_the_first_blocks_and_is_nan_if_it_does_not(tmp_path: Path) -> None:
    run = Run(1000)
    first, *blocks = run.messages()
    late = series(view(tmp_path / "late.rrd", [*blocks, first]), "/error")[1]
    close_enough(late[:, 2], 1e9 * (HEIGHT + run.deflection - run.reference[:, 2]))
    never = series(view(tmp_path / "never.rrd", blocks), "/error")[1]
    assert np.isnan(never[:, 2]).all() and np.isfinite(never[:, :2]).all()


def test_missing_block_is_a_gap_and_further_channels_are_drawn_in_their_unit(tmp_path: Path) -> None:
    blocks = [("truth/creep", waveform(first, np.ones(10), "m")) for first in (0, 20)]
    path = view(tmp_path / "run.rrd", [*blocks, ("truth/temperature", waveform(0, np.ones(10), "K"))])
    times, values = series(path, "/truth/creep")
    assert times.tolist() == [*range(0, 10_000, 1000), *range(20_000, 30_000, 1000)] and (values == 1e9).all()
    assert (series(path, "/truth/temperature")[1] == 1.0).all()


def test_message_that_cannot_be_drawn_is_left_out_and_counted(tmp_path: Path) -> None:
    run = Run(20)
    bad = [("deflection", waveform(0, np.ones(10), "V")), ("events", waveform(0, np.ones(10)))]
    path = view(tmp_path / "run.rrd", [*run.block(0, 20), *bad])
    assert len(series(path, "/deflection")[0]) == 40
    assert [text for _, text in events(path)] == [
        "2 messages are not shown, the last one: events: something else is shown under this name"
    ]


def test_states_events_and_changed_parameters_are_shown_at_their_times(tmp_path: Path) -> None:
    messages = [
        parameters("afm_sim_node", {"plant.kind": "compliant", "plant.dt": 1e-6}),
        parameters("afm_controller_node", {"law.alpha": 20.0, "law.kind": "tanh"}),
        status(0.0, RunState.RUNNING),
        *Run(100).block(0, 100),
        status(1e-6, RunState.STALLED, "no answer"),
        status(2e-6, RunState.STALLED, "no answer"),
        event(3e-6, "drift begins", 30),
        parameters("afm_controller_node", {"law.alpha": 5.0}, 60e-6),
        parameters("afm_controller_node", {"law.kind": "sgn"}, 80e-6),
    ]
    path = view(tmp_path / "run.rrd", messages)
    assert events(path) == [
        (0, "RUNNING"),
        (1_000, "STALLED: no answer"),
        (3_000, "drift begins"),
        (60_000, "afm_controller_node: law.alpha changed from 20.0 to 5.0"),
        (80_000, "afm_controller_node: law.kind changed from tanh to sgn"),
    ]
    times, steps = series(path, "/parameters/afm_controller_node/law.alpha")
    assert (times.tolist(), steps.tolist()) == ([0, 60_000, 199_000], [20.0, 5.0, 5.0])
    (text,) = column(path, layout.PARAMETERS, "TextDocument:text")[-1]
    assert '"law.alpha": 20.0' in text and '"plant.kind": "compliant"' in text


def test_what_is_missing_of_a_run_is_the_last_event_of_its_view(tmp_path: Path) -> None:
    path = view(tmp_path / "run.rrd", Run(100).messages(), end={"missing": "12 ticks are missing"})
    assert events(path)[-1] == (199_000, "This recording is not complete: 12 ticks are missing")


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


# The file.


def test_view_replaces_nothing_and_what_a_killed_process_left_does_no_harm(tmp_path: Path) -> None:
    source, target = record(tmp_path / "run.mcap", Run(10).messages()), tmp_path / "run.rrd"
    (tmp_path / ".run.rrd.part").write_bytes(1000 * b"left")
    make_view(source, target)
    made = target.read_bytes()
    assert {each.name for each in tmp_path.iterdir()} == {"run.mcap", "run.rrd"}
    with pytest.raises(OSError, match=r"run\.rrd cannot be written: there is something"):
        make_view(source, target)
    assert target.read_bytes() == made


def test_record_that_cannot_be_read_leaves_no_view(tmp_path: Path) -> None:
    source = record(tmp_path / "run.mcap", Run(1000).messages())
    spoiled = bytearray(source.read_bytes())
    spoiled[len(spoiled) // 2] ^= 1
    source.write_bytes(spoiled)
    with pytest.raises(DamagedRecording):
        make_view(source, tmp_path / "run.rrd")
    with pytest.raises(RecordingError, match="absent"):
        make_view(tmp_path / "absent.mcap", tmp_path / "run.rrd")
    assert [each.name for each in tmp_path.iterdir()] == ["run.mcap"]


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """No file can become larger: as on a disk without room."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.parametrize("size", [1_000, 200_000])
def test_full_disk_and_closed_folder_are_reported_and_leave_nothing(tmp_path: Path, size: int) -> None:
    source = record(tmp_path / "run.mcap", Run(20_000).messages())
    with largest_file(size), pytest.raises(OSError, match=r"run\.rrd cannot be written: File too large"):
        make_view(source, tmp_path / "run.rrd")
    with pytest.raises(OSError, match=r"run\.rrd cannot be written: No such file or directory"):
        make_view(source, tmp_path / "none" / "run.rrd")
    assert [each.name for each in tmp_path.iterdir()] == ["run.mcap"]
    make_view(source, tmp_path / "run.rrd")
    assert stat.S_IMODE((tmp_path / "run.rrd").stat().st_mode) == 0o666 & ~_umask()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


# The process apart.


def all_news(worker: Worker, count: int) -> dict[str, str]:
    found: list[News] = []

    def enough() -> bool:
        found.extend(worker.news())
        return len(found) >= count

    wait_until(enough, lambda: found, lambda: time.sleep(0.01))
    return {target.name: error for target, error in found}


def test_worker_makes_one_view_after_the_other_and_reports_what_it_cannot(tmp_path: Path) -> None:
    worker = Worker()
    for number in range(3):
        worker.make(record(tmp_path / f"{number}.mcap", Run(100).messages()), tmp_path / f"{number}.rrd")
    worker.make(tmp_path / "absent.mcap", tmp_path / "absent.rrd")
    found = all_news(worker, 4)
    assert [found[f"{number}.rrd"] for number in range(3)] == ["", "", ""] and "absent.mcap" in found["absent.rrd"]
    assert len(series(tmp_path / "2.rrd", "/drive")[0]) == 100
    # One that is killed is reported, and the next view is made by another.
    assert worker._process is not None
    worker._process.kill()
    worker.make(tmp_path / "0.mcap", tmp_path / "lost.rrd")
    assert "has ended" in all_news(worker, 1)["lost.rrd"]
    worker.make(tmp_path / "0.mcap", tmp_path / "again.rrd")
    assert [(target.name, error) for target, error in worker.finish()] == [("again.rrd", "")]
    assert worker._process is None


def test_worker_ends_with_its_recorder_and_not_with_a_ctrl_c(tmp_path: Path) -> None:
    code = (
        "import time; from afm_recorder_node.views_worker import Worker\n"
        "worker = Worker(); worker.start(); print(worker._process.pid, flush=True)\n"
        "time.sleep(600)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as recorder:
        assert recorder.stdout is not None
        worker = int(recorder.stdout.readline())
        # What a terminal interrupts is the group of the recorder.
        assert os.getpgid(worker) == worker != os.getpgid(recorder.pid)
        # While Python begins there it is not yet known as ours.
        wait_until(lambda: worker in processes(), processes, lambda: time.sleep(0.05))
        recorder.kill()
    wait_until(lambda: worker not in processes(), processes, lambda: time.sleep(0.05))


def test_growing_record_has_a_view_of_what_is_there(tmp_path: Path) -> None:
    run = Run(1000)
    begin(tmp_path / "run.mcap", run.messages())
    make_view(tmp_path / "run.mcap", tmp_path / "run.rrd")
    assert len(series(tmp_path / "run.rrd", "/drive")[0]) == 1000
    assert "it has no end" in events(tmp_path / "run.rrd")[-1][1]
