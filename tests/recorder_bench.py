"""An instrument, its controller and a recorder that have found one another, over real topics."""

import array
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from afm_msgs.msg import ControlTrace, Event, InstrumentStatus, RecorderStatus, ScanLine, Score, Waveform
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time
from support import TIMEOUT, Graph, note_shared_memory, remove_shared_memory_left

from afm_node_common import topics
from afm_recorder_node.node import RecorderNode

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

    def __init__(self, namespace: str = NAMESPACE, context: Context | None = None) -> None:
        super().__init__("afm_sim_node", namespace=namespace, context=context)
        self.declare_parameter("cantilever.a", HEIGHT)
        self.controller = CONTROLLER
        self.run_id = 7_000
        self.waveforms = {topic: self.create_publisher(Waveform, topic, topics.STREAM_QOS) for topic in CHANNELS}
        self.trace = self.create_publisher(ControlTrace, topics.CONTROL_TRACE, topics.STREAM_QOS)
        self.status = self.create_publisher(InstrumentStatus, topics.STATUS, topics.EVERY_STATE_QOS)
        self.events = self.create_publisher(Event, topics.EVENTS, topics.EVENTS_QOS)
        self.lines = self.create_publisher(ScanLine, topics.SCAN_LINE, topics.SCAN_LINE_QOS)
        self.score = self.create_publisher(Score, topics.SCORE, topics.LATCHED_QOS)
        self.all = [*self.waveforms.values(), self.trace, self.status, self.events, self.lines, self.score]

    def publish_block(self, first: int) -> None:
        for topic, (unit, scale) in CHANNELS.items():
            message = Waveform(first_sample=2 * first, sample_period=1e-6, scale=scale, unit=unit)
            message.samples = array.array("d", np.arange(2.0 * first, 2.0 * (first + BLOCK)))
            self.publish(self.waveforms[topic], message, first)
        ticks = np.arange(first, first + BLOCK, dtype=np.float64)
        trace = ControlTrace(first_sequence=first, control_period=CONTROL_PERIOD)
        trace.position = trace.velocity = array.array("d", np.outer(ticks, [1.0, 2.0, 3.0]).ravel() * 1e-9)
        trace.reference_position = array.array("d", np.outer(ticks, [0.5, 1.0, 0.0]).ravel() * 1e-9)
        trace.deflection = array.array("d", ticks * 1e-12)
        trace.drive = array.array("d", np.outer(ticks, [1.0, 2.0, 3.0]).ravel())
        trace.round_trip = array.array("f", [1e-4] * BLOCK)
        self.publish(self.trace, trace, first)

    def publish_status(self, state: int, ticks: int, detail: str = "", *, over: bool = False) -> None:
        message = InstrumentStatus(state=state, ticks=ticks, samples=2 * ticks, detail=detail, over=over)
        message.controllers = [self.controller]
        self.publish(self.status, message, ticks)

    def publish_event(self, tick: int, text: str) -> None:
        self.publish(self.events, Event(text=text), tick)

    def end_run(self, ticks: int, detail: str = "", **score: Any) -> None:
        """The duration is over: the last state, and the score."""
        self.publish_status(InstrumentStatus.FINISHED, ticks, detail, over=True)
        self.publish(self.score, Score(ticks=ticks, **score), ticks)

    def reset(self, ticks: int) -> None:
        """End a run after these ticks, and begin the next one."""
        self.publish_status(InstrumentStatus.RUNNING, ticks, over=True)
        self.run_id += 1
        self.publish_status(InstrumentStatus.WAITING, 0)

    def publish(self, publisher: Any, message: Any, tick: int) -> None:
        message.run_id, message.header.stamp = self.run_id, stamp(tick)
        publisher.publish(message)


class Bench:
    """A recorder, an instrument and its controller that have found one another."""

    def __init__(self, graph: Graph, path: Path, *, answering: bool = True, **parameters: object) -> None:
        self.path, self.graph = path, graph
        self.instrument = graph.add(FakeInstrument())
        self.controller = graph.add(
            Node("afm_controller_node", namespace=NAMESPACE, start_parameter_services=answering)
        )
        self.controller.declare_parameter("law.alpha", 20.0)
        self.told = RecorderStatus()
        self.controller.create_subscription(RecorderStatus, topics.RECORDER_STATUS, self._on_told, topics.LATCHED_QOS)
        given = {"path": str(path), "view": False} | parameters
        overrides = [Parameter(name, value=value) for name, value in given.items()]
        self.recorder = graph.add(RecorderNode(namespace=NAMESPACE, parameter_overrides=overrides))
        self.spin_until(lambda: all(publisher.get_subscription_count() == 1 for publisher in self.instrument.all))
        self.spin_until(lambda: self.told.path != "")
        assert not self.told.ready
        self.instrument.publish_status(InstrumentStatus.WAITING, 0)
        self.spin_until(lambda: self.told.ready)

    def _on_told(self, message: RecorderStatus) -> None:
        self.told = message

    def spin_until(self, predicate: Callable[[], object]) -> None:
        self.graph.spin_until(predicate)

    def finish(self, spin: Callable[[], object] = lambda: None) -> None:
        """End the recorder; `spin` is called while it waits for the last blocks."""

        def spin_once(timeout: float) -> None:
            spin()
            self.graph.executor.spin_once(timeout_sec=timeout)

        self.recorder.finish(spin_once)


class RecorderProcess:
    """A recorder in a process of its own, and an instrument in this one. Use as a context manager.

    Parameters
    ----------
    path : of the recording, absolute or below `folder`
    folder : working directory of the process
    namespace : of both
    first : Python that runs before the recorder
    environment : beside that of this process
    """

    def __init__(
        self, path: Path, *, folder: Path | None = None, namespace: str = NAMESPACE, first: str = "", **environment: str
    ) -> None:
        self.told = RecorderStatus()
        self.history: list[tuple[float, RecorderStatus]] = []
        """What the recorder said, and when: monotonic time."""
        self.diagnostics: list[DiagnosticStatus] = []
        code = f"import sys; from afm_recorder_node.node import main\n{first}\nsys.exit(main())"
        command = [sys.executable, "-c", code]
        arguments = ["--ros-args", "-r", f"__ns:=/{namespace}", "-p", f"path:={path}", "-p", "view:=false"]
        self._output = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen(
            [*command, *arguments], stdout=self._output, stderr=self._output, cwd=folder, env=os.environ | environment
        )
        self.context = Context()
        rclpy.init(context=self.context)
        self.instrument = FakeInstrument(namespace, self.context)
        # Nobody waits for the parameters of a controller that is not there.
        self.instrument.controller = self.instrument.get_fully_qualified_name()
        self.instrument.create_subscription(RecorderStatus, topics.RECORDER_STATUS, self._on_told, topics.LATCHED_QOS)
        self.instrument.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.instrument)

    def __enter__(self) -> "RecorderProcess":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            note_shared_memory()
            self.process.kill()
            self.process.wait()
        self.executor.shutdown()
        self.instrument.destroy_node()
        rclpy.try_shutdown(context=self.context)
        remove_shared_memory_left()

    @property
    def text(self) -> str:
        """What the process has printed."""
        self._output.seek(0)
        return self._output.read()

    def _on_told(self, message: RecorderStatus) -> None:
        self.told = message
        self.history.append((time.monotonic(), message))

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        self.diagnostics += message.status

    def spin_until(self, predicate: Callable[[], bool], timeout: float = TIMEOUT) -> None:
        end = time.monotonic() + timeout
        while not predicate():
            if self.process.poll() is not None:
                raise AssertionError(f"the recorder has ended: {self.text}")
            if time.monotonic() > end:
                raise TimeoutError(f"waited {timeout} s; the recorder said last: {self.told}; printed: {self.text}")
            self.executor.spin_once(timeout_sec=0.02)

    def wait_until_subscribed(self) -> None:
        self.spin_until(lambda: all(publisher.get_subscription_count() > 0 for publisher in self.instrument.all))
        self.instrument.publish_status(InstrumentStatus.RUNNING, 0)
        self.spin_until(lambda: self.told.ready)

    def kill(self) -> None:
        """What nobody can clean up after."""
        note_shared_memory()
        self.process.kill()
        self.process.wait()

    def end(self, number: signal.Signals = signal.SIGINT, timeout: float = TIMEOUT) -> int:
        """Send a signal; exit code."""
        self.process.send_signal(number)
        end = time.monotonic() + timeout
        while self.process.poll() is None:
            if time.monotonic() > end:
                raise TimeoutError(f"the recorder has not ended; printed: {self.text}")
            self.executor.spin_once(timeout_sec=0.02)
        return self.process.returncode
