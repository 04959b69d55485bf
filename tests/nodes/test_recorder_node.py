"""The recorder node over real topics: what the instrument publishes stands in the file."""

import signal
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rclpy
from afm_msgs.msg import InstrumentStatus, Score
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from recorder_bench import BLOCK, HEIGHT, NAMESPACE, Bench, RecorderProcess, stamp

from afm_model.core.errors import ParameterError
from afm_recorder_node import node
from afm_recorder_node.node import RecorderNode
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import ParameterChange


@pytest.fixture
def bench(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Bench]:
    bench = Bench(tmp_path / "run.rrd", answering=getattr(request, "param", True))
    try:
        bench.start()
        yield bench
    finally:
        bench.destroy()


def test_everything_published_stands_in_the_file(bench: Bench) -> None:
    instrument = bench.instrument
    instrument.publish_status(InstrumentStatus.RUNNING, 0)
    for first in range(0, 10 * BLOCK, BLOCK):
        instrument.publish_block(first)
    instrument.publish_status(InstrumentStatus.FINISHED, 10 * BLOCK, "the duration is over")
    # Nothing has been taken yet: `finish` has to.
    bench.recorder.finish(bench.spin_once)
    recording = read_recording(bench.path)
    ticks, samples = np.arange(10.0 * BLOCK), np.arange(20.0 * BLOCK)
    close = {"rtol": 1e-15, "atol": 0.0}
    assert np.array_equal(recording.time_ticks, ticks * 2_000 / 1e9)
    assert np.array_equal(recording.time_samples, samples * 1_000 / 1e9)
    np.testing.assert_allclose(recording.position, np.outer(ticks, [1.0, 2.0, 3.0]) * 1e-9, **close)
    np.testing.assert_allclose(recording.deflection, samples * 10e-9, **close)
    np.testing.assert_allclose(recording.lateral_force, samples * 50e-9, **close)
    np.testing.assert_allclose(recording.lateral_force_y, samples, **close)
    np.testing.assert_allclose(recording.normal_force, samples, **close)
    # The tip's height counts from the instrument's own cantilever.a, which the recorder has asked for.
    np.testing.assert_allclose(recording.error[:, 2], HEIGHT + ticks * 1e-12, **close)
    assert recording.parameters["afm_sim_node"]["cantilever.a"] == HEIGHT
    assert (0.01, "FINISHED: the duration is over") in recording.events


def test_states_that_follow_one_another_at_once_are_all_events(bench: Bench) -> None:
    bench.instrument.publish_block(0)
    changes = [f"change {k}" for k in range(20)]
    for detail in changes:
        bench.instrument.publish_status(InstrumentStatus.STALLED, BLOCK, detail)
    bench.instrument.publish_status(InstrumentStatus.FINISHED, BLOCK)
    bench.recorder.finish(bench.spin_once)
    told = [text for _, text in read_recording(bench.path).events]
    assert [text for text in told if "change" in text] == [f"STALLED: {detail}" for detail in changes]


def test_blocks_that_the_status_tells_of_are_waited_for(bench: Bench) -> None:
    bench.instrument.publish_block(0)
    bench.instrument.publish_status(InstrumentStatus.FINISHED, 2 * BLOCK)
    bench.spin_until(lambda: bench.told.ticks == BLOCK)
    # As if it had been lost on the way and were repeated: later than one waits for blocks that nothing is known of.
    at = time.monotonic() + 1.0

    def spin_once(timeout: float) -> None:
        nonlocal at
        if time.monotonic() > at:
            bench.instrument.publish_block(BLOCK)
            at = float("inf")
        bench.spin_once(timeout)

    bench.recorder.finish(spin_once)
    assert len(read_recording(bench.path).time_ticks) == 2 * BLOCK


def test_blocks_of_a_killed_instrument_are_waited_for_until_nothing_has_come_for_a_while(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.instrument.publish_block(0)
    bench.instrument.publish_status(InstrumentStatus.RUNNING, 9 * BLOCK)
    bench.spin_until(lambda: bench.told.ticks == BLOCK)
    clock, later = 0.0, [2.0, 5.0]  # when the last blocks come [s]
    monkeypatch.setattr(node, "time", SimpleNamespace(monotonic=lambda: clock))

    def spin_once(timeout: float) -> None:
        nonlocal clock
        clock += timeout
        if later and clock > later[0]:
            later.pop(0)
            bench.instrument.publish_block((2 - len(later)) * BLOCK)
            bench.spin_until(lambda: bench.recorder.recorder.counts().ticks == (3 - len(later)) * BLOCK)

    bench.recorder.finish(spin_once)
    assert 5.0 + node._SILENCE <= clock < node._DRAIN_LIMIT
    assert len(read_recording(bench.path).time_ticks) == 3 * BLOCK


def test_change_of_a_parameter_is_recorded_at_its_simulated_time(bench: Bench) -> None:
    bench.instrument.publish_block(0)
    bench.instrument.publish_status(InstrumentStatus.RUNNING, BLOCK)
    # The status, too: ticks come on another topic, and the time of the change is that of what was heard last.
    bench.spin_until(lambda: bench.told.ticks == BLOCK and bench.recorder.recorder.time_ns == BLOCK * 2_000)
    known = bench.recorder.recorder.known
    bench.controller.set_parameters([Parameter("law.alpha", value=5.0)])
    bench.spin_until(lambda: known["afm_controller_node"]["law.alpha"] == 5.0)
    bench.recorder.finish(bench.spin_once)
    recording = read_recording(bench.path)
    assert recording.parameters["afm_controller_node"]["law.alpha"] == 20.0
    assert recording.parameter_changes == [ParameterChange(1e-3, "afm_controller_node", "law.alpha", 20.0, 5.0)]


@pytest.mark.parametrize("bench", [False], indirect=True)
def test_controller_without_parameter_services_is_recorded_too(bench: Bench) -> None:
    bench.instrument.publish_block(0)
    bench.instrument.publish_status(InstrumentStatus.FINISHED, BLOCK)
    bench.recorder.finish(bench.spin_once)
    recording = read_recording(bench.path)
    assert len(recording.time_ticks) == BLOCK
    assert set(recording.parameters) == {"afm_sim_node"}


def test_score_of_the_run_is_recorded(bench: Bench) -> None:
    bench.instrument.publish_block(0)
    bench.instrument.publish_status(InstrumentStatus.RUNNING, BLOCK)
    bench.spin_until(lambda: bench.told.ticks == BLOCK)
    bench.instrument.publish_block(BLOCK)
    bench.instrument.publish_status(InstrumentStatus.FINISHED, 2 * BLOCK)
    score = Score(ticks=2 * BLOCK)
    score.header.stamp = stamp(2 * BLOCK)
    bench.instrument.score.publish(score)
    bench.spin_until(lambda: bench.told.ticks == 2 * BLOCK)
    bench.recorder.finish(bench.spin_once)
    kept = read_recording(bench.path).score
    assert kept is not None and kept["ticks"] == 2 * BLOCK


def test_score_of_an_older_run_is_not_recorded(bench: Bench) -> None:
    score = Score(ticks=7)
    score.header.stamp = stamp(7 * BLOCK)
    bench.instrument.score.publish(score)
    bench.instrument.publish_block(0)
    bench.instrument.publish_status(InstrumentStatus.FINISHED, BLOCK)
    bench.spin_until(lambda: bench.told.ticks == BLOCK)
    bench.recorder.finish(bench.spin_once)
    assert read_recording(bench.path).score is None


def of(entry: DiagnosticStatus) -> dict[str, str]:
    return {value.key: value.value for value in entry.values}


def test_diagnostics_tell_that_all_is_well_and_that_ticks_are_missing(bench: Bench) -> None:
    heard: list[DiagnosticStatus] = []
    bench.controller.create_subscription(DiagnosticArray, "/diagnostics", lambda array: heard.extend(array.status), 10)
    bench.instrument.publish_block(0)
    bench.spin_until(lambda: any(of(entry)["ticks"] == str(BLOCK) for entry in heard))
    assert heard[-1].level == DiagnosticStatus.OK
    assert heard[-1].name == f"/{NAMESPACE}/afm_recorder_node: recorder"
    bench.instrument.publish_block(2 * BLOCK)
    bench.spin_until(lambda: of(heard[-1])["ticks lost"] == str(BLOCK))
    assert heard[-1].level == DiagnosticStatus.WARN


def test_lost_blocks_are_counted(bench: Bench) -> None:
    for first in (0, BLOCK, 4 * BLOCK):
        bench.instrument.publish_block(first)
    bench.spin_until(lambda: bench.told.ticks == 3 * BLOCK and bench.told.samples == 6 * BLOCK)
    assert (bench.told.ticks_lost, bench.told.samples_lost) == (2 * BLOCK, 4 * BLOCK)
    assert bench.told.path == str(bench.path)


def test_reset_begins_a_second_recording(bench: Bench) -> None:
    for first in (0, BLOCK, 2 * BLOCK):
        bench.instrument.publish_block(first)
    bench.instrument.publish_status(InstrumentStatus.RUNNING, 3 * BLOCK)
    bench.spin_until(lambda: bench.told.ticks == 3 * BLOCK)
    bench.instrument.publish_status(InstrumentStatus.WAITING, 0)
    bench.instrument.publish_block(0)
    second = bench.path.with_name("run-2.rrd")
    bench.spin_until(lambda: bench.told.path == str(second) and bench.told.ticks == BLOCK)
    assert len(read_recording(bench.path).time_ticks) == 3 * BLOCK
    bench.recorder.finish(bench.spin_once)
    recording = read_recording(second)
    assert np.array_equal(recording.time_ticks, np.arange(BLOCK) * 2_000 / 1e9)
    assert recording.events == [(0.0, "WAITING")]
    assert recording.parameters["afm_controller_node"] == read_recording(bench.path).parameters["afm_controller_node"]


def test_recorder_that_came_when_a_run_was_over_has_all_of_the_next(bench: Bench) -> None:
    bench.instrument.publish_status(InstrumentStatus.FINISHED, 10 * BLOCK)
    bench.spin_until(lambda: bench.recorder.recorder.time_ns > 0)
    bench.instrument.publish_status(InstrumentStatus.WAITING, 0)
    bench.instrument.publish_status(InstrumentStatus.RUNNING, 0)
    bench.instrument.publish_block(0)
    bench.spin_until(lambda: bench.told.ticks == BLOCK)
    known = bench.recorder.recorder.known["afm_controller_node"]
    bench.controller.set_parameters([Parameter("law.alpha", value=5.0)])
    bench.spin_until(lambda: known["law.alpha"] == 5.0)
    bench.instrument.publish_status(InstrumentStatus.FINISHED, BLOCK)
    bench.recorder.finish(bench.spin_once)
    recording = read_recording(bench.path)
    assert len(recording.time_ticks) == BLOCK
    # The topic of the status keeps the last message only: those before it may be passed over.
    assert {"RUNNING", "FINISHED"} <= {
        text for time, text in recording.events if time <= recording.time_ticks[-1] + 1e-5
    }
    assert [(change.old, change.new) for change in recording.parameter_changes] == [(20.0, 5.0)]


def test_run_without_samples_leaves_no_file(bench: Bench) -> None:
    bench.recorder.finish(bench.spin_once)
    assert list(bench.path.parent.iterdir()) == []


@pytest.mark.parametrize("name", ["file/run.rrd", ""], ids=["below a file", "a folder"])
def test_path_that_cannot_be_written_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("")
    context = Context()
    rclpy.init(context=context)
    try:
        path = Parameter("path", value=str(tmp_path / name))
        with pytest.raises(ParameterError, match="cannot record to"):
            RecorderNode(namespace=NAMESPACE, context=context, parameter_overrides=[path])
    finally:
        rclpy.try_shutdown(context=context)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_process_closes_its_recording_on_a_signal(tmp_path: Path, number: signal.Signals) -> None:
    path = tmp_path / "run.rrd"
    with RecorderProcess(path) as recorder:
        recorder.wait_until_subscribed()
        for first in range(0, 20 * BLOCK, BLOCK):
            recorder.instrument.publish_block(first)
        recorder.instrument.publish_status(InstrumentStatus.FINISHED, 20 * BLOCK)
        # Delivered, though perhaps not taken: lost packets are repeated only at a heartbeat, up to 3 s later.
        assert all(publisher.wait_for_all_acked(Duration(seconds=20)) for publisher in recorder.instrument.all)
        assert recorder.end(number) == 0, recorder.text
    assert len(read_recording(path).time_ticks) == 20 * BLOCK
