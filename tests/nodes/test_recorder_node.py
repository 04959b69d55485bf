"""The recorder node over real topics: what the instrument publishes stands in the file."""

import array
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import rclpy
from afm_msgs.msg import ControlTrace, InstrumentStatus, RecorderStatus, Waveform
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time

from afm_model.errors import ParameterError
from afm_node_common import topics
from afm_recorder_node.node import RecorderNode
from afm_recorder_node.reader import ParameterChange, read_recording

NAMESPACE = "recorder_test"
CONTROL_PERIOD, BLOCK = 2e-6, 500
HEIGHT = 3e-9
CONTROLLER = f"/{NAMESPACE}/afm_controller_node"
CHANNELS = {
    topics.DEFLECTION: ("m", 10e-9),
    topics.LATERAL_FORCE: ("N", 50e-9),
    topics.TRUTH_LATERAL_FORCE_Y: ("N", 1.0),
    topics.TRUTH_NORMAL_FORCE: ("N", 1.0),
}


def stamp(tick: int) -> object:
    return Time(nanoseconds=2_000 * tick).to_msg()


class FakeInstrument(Node):
    """Publishes what the simulator publishes; every value tells its own number."""

    def __init__(self, context: Context) -> None:
        super().__init__("afm_sim_node", namespace=NAMESPACE, context=context)
        self.declare_parameter("cantilever.a", HEIGHT)
        self.waveforms = {topic: self.create_publisher(Waveform, topic, topics.STREAM_QOS) for topic in CHANNELS}
        self.trace = self.create_publisher(ControlTrace, topics.CONTROL_TRACE, topics.STREAM_QOS)
        self.status = self.create_publisher(InstrumentStatus, topics.STATUS, topics.LATCHED_QOS)

    def publish_block(self, first: int) -> None:
        for topic, (unit, scale) in CHANNELS.items():
            message = Waveform(first_sample=2 * first, sample_period=1e-6, scale=scale, unit=unit)
            message.header.stamp = stamp(first)
            message.samples = array.array("d", np.arange(2.0 * first, 2.0 * (first + BLOCK)))
            self.waveforms[topic].publish(message)
        ticks = np.arange(first, first + BLOCK, dtype=np.float64)
        trace = ControlTrace(first_sequence=first, control_period=CONTROL_PERIOD)
        trace.header.stamp = stamp(first)
        trace.position = array.array("d", np.outer(ticks, [1.0, 2.0, 3.0]).ravel() * 1e-9)
        trace.reference_position = array.array("d", np.outer(ticks, [0.5, 1.0, 0.0]).ravel() * 1e-9)
        trace.deflection = array.array("d", ticks * 1e-12)
        trace.drive = array.array("d", np.outer(ticks, [1.0, 2.0, 3.0]).ravel())
        trace.round_trip = array.array("f", [1e-4] * BLOCK)
        self.trace.publish(trace)

    def publish_status(self, state: int, ticks: int, detail: str = "") -> None:
        message = InstrumentStatus(state=state, ticks=ticks, samples=2 * ticks, detail=detail, controller=CONTROLLER)
        message.header.stamp = stamp(ticks)
        self.status.publish(message)


class Bench:
    """A recorder, an instrument and its controller that have found one another."""

    def __init__(self, path: Path, *, answering: bool) -> None:
        self.path = path
        self._answering = answering
        self.context = Context()
        self.nodes: list[Node] = []
        rclpy.init(context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)

    def start(self) -> None:
        overrides = [Parameter("path", value=str(self.path))]
        self.instrument = FakeInstrument(self.context)
        self.controller = Node(
            "afm_controller_node",
            namespace=NAMESPACE,
            context=self.context,
            start_parameter_services=self._answering,
        )
        self.controller.declare_parameter("law.alpha", 20.0)
        self.told = RecorderStatus()
        self.recorder = RecorderNode(namespace=NAMESPACE, context=self.context, parameter_overrides=overrides)
        self.controller.create_subscription(RecorderStatus, topics.RECORDER_STATUS, self._on_told, topics.LATCHED_QOS)
        self.nodes = [self.instrument, self.controller, self.recorder]
        for node in self.nodes:
            self.executor.add_node(node)
        publishers = [*self.instrument.waveforms.values(), self.instrument.trace, self.instrument.status]
        self.spin_until(lambda: all(publisher.get_subscription_count() == 1 for publisher in publishers))
        self.spin_until(lambda: self.told.path != "")
        assert not self.told.ready
        self.instrument.publish_status(InstrumentStatus.WAITING, 0)
        self.spin_until(lambda: self.told.ready)

    def _on_told(self, message: RecorderStatus) -> None:
        self.told = message

    def spin_once(self, timeout: float) -> None:
        self.executor.spin_once(timeout_sec=timeout)

    def spin_until(self, predicate: Callable[[], bool], timeout: float = 20.0) -> None:
        end = time.monotonic() + timeout
        while not predicate():
            if time.monotonic() > end:
                raise TimeoutError(f"still waiting after {timeout} s; the recorder said last: {self.told}")
            self.spin_once(0.05)

    def destroy(self) -> None:
        self.executor.shutdown()
        for node in self.nodes:
            node.destroy_node()
        rclpy.try_shutdown(context=self.context)


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


def test_change_of_a_parameter_is_recorded_at_its_simulated_time(bench: Bench) -> None:
    bench.instrument.publish_block(0)
    bench.instrument.publish_status(InstrumentStatus.RUNNING, BLOCK)
    bench.spin_until(lambda: bench.told.ticks == BLOCK)
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
    context = Context()
    rclpy.init(context=context)
    instrument = FakeInstrument(context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(instrument)
    command = [sys.executable, "-c", "import sys; from afm_recorder_node.node import main; sys.exit(main())"]
    arguments = ["--ros-args", "-r", f"__ns:=/{NAMESPACE}", "-p", f"path:={path}"]
    process = subprocess.Popen([*command, *arguments], stderr=subprocess.PIPE, text=True)
    try:
        end = time.monotonic() + 30.0
        publishers = [*instrument.waveforms.values(), instrument.trace, instrument.status]
        while not all(publisher.get_subscription_count() for publisher in publishers):
            assert process.poll() is None, process.communicate()[1]
            assert time.monotonic() < end, "the recorder has not subscribed"
            executor.spin_once(timeout_sec=0.05)
        for first in range(0, 20 * BLOCK, BLOCK):
            instrument.publish_block(first)
        instrument.publish_status(InstrumentStatus.FINISHED, 20 * BLOCK)
        # Delivered, though perhaps not taken: lost packets are repeated only at a heartbeat, up to 3 s later.
        assert all(publisher.wait_for_all_acked(Duration(seconds=20)) for publisher in publishers)
        process.send_signal(number)
        while process.poll() is None:
            assert time.monotonic() < end, "the recorder has not ended"
            executor.spin_once(timeout_sec=0.05)
        assert process.returncode == 0, process.communicate()[1]
        assert len(read_recording(path).time_ticks) == 20 * BLOCK
    finally:
        process.kill()
        process.wait()
        executor.shutdown()
        instrument.destroy_node()
        rclpy.try_shutdown(context=context)
