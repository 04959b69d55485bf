"""The recorder node over real topics: what the instrument publishes stands in the record of the run that it names."""

import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from afm_msgs.msg import InstrumentStatus
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from recorder_bench import BLOCK, HEIGHT, NAMESPACE, Bench, RecorderProcess
from support import Graph

from afm_model.core.errors import ParameterError
from afm_recorder_node.node import RecorderNode
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import IncompleteRecording, ParameterChange, Recording


@pytest.fixture
def bench(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Bench]:
    with Graph() as graph:
        yield Bench(graph, tmp_path / "run.mcap", answering=getattr(request, "param", True))


def incomplete(path: Path, why: str) -> Recording:
    with pytest.warns(IncompleteRecording, match=why):
        recording = read_recording(path)
    assert not recording.complete
    return recording


def test_everything_published_stands_in_the_file(bench: Bench) -> None:
    instrument = bench.instrument
    instrument.publish_status(InstrumentStatus.RUNNING, 0)
    for first in range(0, 10 * BLOCK, BLOCK):
        instrument.publish_block(first)
    instrument.end_run(10 * BLOCK, "the duration is over")
    # Nothing has been taken yet: `finish` has to.
    bench.finish()
    recording = read_recording(bench.path)
    assert recording.complete and recording.score is not None and recording.score["ticks"] == 10 * BLOCK
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
    bench.instrument.end_run(BLOCK)
    bench.finish()
    told = [text for _, text in read_recording(bench.path).events]
    assert [text for text in told if "change" in text] == [f"STALLED: {detail}" for detail in changes]


def test_blocks_that_the_last_status_counts_are_waited_for(bench: Bench) -> None:
    bench.instrument.publish_block(0)
    bench.instrument.end_run(2 * BLOCK)
    bench.spin_until(lambda: bench.told.ticks == BLOCK)
    # As if it had been lost on the way and were repeated: later than one waits for blocks that nothing is known of.
    late = [time.monotonic() + 1.0]

    def spin() -> None:
        if late and time.monotonic() > late[0]:
            late.clear()
            bench.instrument.publish_block(BLOCK)

    bench.finish(spin)
    assert len(read_recording(bench.path).time_ticks) == 2 * BLOCK


def test_record_of_a_run_that_did_not_end_says_so(bench: Bench) -> None:
    bench.instrument.publish_block(0)
    bench.instrument.publish_status(InstrumentStatus.RUNNING, 9 * BLOCK)
    bench.spin_until(lambda: bench.told.ticks == BLOCK)
    bench.finish()
    assert len(incomplete(bench.path, "it has not come to an end").time_ticks) == BLOCK


def test_change_of_a_parameter_is_recorded_at_its_simulated_time(bench: Bench) -> None:
    bench.instrument.publish_block(0)
    bench.instrument.publish_status(InstrumentStatus.RUNNING, BLOCK)
    # The status, too: ticks come on another topic, and the time of the change is that of what was heard last.
    bench.spin_until(lambda: bench.told.ticks == BLOCK and bench.recorder.recorder.present.time_ns == BLOCK * 2_000)
    bench.controller.set_parameters([Parameter("law.alpha", value=5.0)])
    bench.spin_until(lambda: bench.recorder._watch.values[f"/{NAMESPACE}/afm_controller_node"]["law.alpha"] == 5.0)
    bench.instrument.end_run(BLOCK)
    bench.finish()
    recording = read_recording(bench.path)
    assert recording.parameters["afm_controller_node"]["law.alpha"] == 20.0
    assert recording.parameter_changes == [ParameterChange(1e-3, "afm_controller_node", "law.alpha", 20.0, 5.0)]


@pytest.mark.parametrize("bench", [False], indirect=True)
def test_controller_without_parameter_services_is_recorded_too(bench: Bench) -> None:
    bench.instrument.publish_block(0)
    bench.instrument.end_run(BLOCK)
    bench.finish()
    recording = read_recording(bench.path)
    assert len(recording.time_ticks) == BLOCK
    assert set(recording.parameters) == {"afm_sim_node"}


def of(entry: DiagnosticStatus) -> dict[str, str]:
    return {value.key: value.value for value in entry.values}


def test_lost_blocks_are_counted_named_in_the_record_and_reported_in_the_diagnostics(bench: Bench) -> None:
    heard: list[DiagnosticStatus] = []
    bench.controller.create_subscription(DiagnosticArray, "/diagnostics", lambda array: heard.extend(array.status), 10)
    bench.instrument.publish_block(0)
    bench.spin_until(lambda: any(of(entry)["ticks"] == str(BLOCK) for entry in heard))
    assert heard[-1].level == DiagnosticStatus.OK
    assert heard[-1].name == f"/{NAMESPACE}/afm_recorder_node: recorder"
    bench.instrument.publish_block(2 * BLOCK)
    bench.spin_until(lambda: of(heard[-1])["ticks lost"] == str(BLOCK))
    assert heard[-1].level == DiagnosticStatus.WARN
    bench.spin_until(lambda: bench.told.ticks == 2 * BLOCK and bench.told.samples == 4 * BLOCK)
    assert (bench.told.ticks_lost, bench.told.samples_lost) == (BLOCK, 2 * BLOCK)
    assert bench.told.path == str(bench.path)
    bench.instrument.end_run(3 * BLOCK)
    bench.finish()
    recording = incomplete(bench.path, f"{BLOCK} ticks and {2 * BLOCK} samples a channel are missing between others")
    assert (2e-3, f"{BLOCK} values of control_trace are missing before this") in recording.events


def test_reset_begins_a_second_record_and_what_comes_late_goes_into_the_first(bench: Bench) -> None:
    for first in (0, BLOCK):
        bench.instrument.publish_block(first)
    bench.spin_until(lambda: bench.told.ticks == 2 * BLOCK)
    bench.instrument.reset(3 * BLOCK)
    bench.instrument.publish_event(0, "Approach has begun")  # before any block of its run
    bench.instrument.publish_block(0)
    second = bench.path.with_name("run-2.mcap")
    bench.spin_until(lambda: bench.told.path == str(second) and bench.told.ticks == BLOCK)
    bench.instrument.run_id -= 1
    bench.instrument.publish_block(2 * BLOCK)
    bench.instrument.run_id += 1
    bench.instrument.end_run(BLOCK)
    bench.finish()
    one, two = read_recording(bench.path), read_recording(second)
    assert (len(one.time_ticks), len(two.time_ticks)) == (3 * BLOCK, BLOCK)
    assert two.events == [(0.0, "WAITING"), (0.0, "Approach has begun"), (1e-3, "FINISHED")]
    assert one.parameters == two.parameters and one.parameters["afm_controller_node"]["law.alpha"] == 20.0


def test_recorder_that_comes_when_a_run_is_over_records_the_next_one_only(tmp_path: Path) -> None:
    with Graph() as graph:
        before = Bench(graph, tmp_path / "before.mcap")
        before.instrument.publish_block(0)
        before.instrument.publish_event(0, "of the run before")
        before.instrument.end_run(BLOCK)
        before.finish()
        graph.remove(before.recorder)
        late = RecorderNode(namespace=NAMESPACE, parameter_overrides=[Parameter("path", value=str(tmp_path / "late"))])
        graph.add(late)
        graph.spin_until(lambda: late._ready and before.instrument.trace.get_subscription_count() == 1)
        before.instrument.reset(BLOCK)
        before.instrument.publish_block(0)
        before.instrument.end_run(BLOCK)
        graph.spin_until(lambda: late.recorder.counts().ticks == BLOCK)
        before.recorder = late
        before.finish()
    (path,) = tmp_path.glob("late*.mcap")
    recording = read_recording(path)
    assert recording.complete and recording.events == [(0.0, "WAITING"), (1e-3, "FINISHED")]
    assert path.with_suffix(".rrd").exists()  # the view


def test_run_without_samples_leaves_no_file(bench: Bench) -> None:
    bench.finish()
    assert list(bench.path.parent.iterdir()) == []


@pytest.mark.parametrize("name", ["file/run.mcap", ""], ids=["below a file", "a folder"])
def test_path_that_cannot_be_written_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "file.mcap").mkdir()
    path = Parameter("path", value=str(tmp_path / (name or "file.mcap")))
    with Graph(), pytest.raises(ParameterError, match="cannot record to"):
        RecorderNode(namespace=NAMESPACE, parameter_overrides=[path])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_process_closes_its_recording_on_a_signal(tmp_path: Path, number: signal.Signals) -> None:
    path = tmp_path / "run.mcap"
    with RecorderProcess(path) as recorder:
        recorder.wait_until_subscribed()
        for first in range(0, 20 * BLOCK, BLOCK):
            recorder.instrument.publish_block(first)
        recorder.instrument.end_run(20 * BLOCK)
        # Delivered, though perhaps not taken: lost packets are repeated only at a heartbeat, up to 3 s later.
        assert all(publisher.wait_for_all_acked(Duration(seconds=20)) for publisher in recorder.instrument.all)
        assert recorder.end(number) == 0, recorder.text
    recording = read_recording(path)
    assert recording.complete and len(recording.time_ticks) == 20 * BLOCK
