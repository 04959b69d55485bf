"""The recorder as a ROS node: it subscribes to the topics of the instrument and passes the messages to `Recorder`."""

import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
from afm_msgs.msg import ControlTrace, Event, InstrumentStatus, NamedArray, ScanLine, Score, Waveform
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from afm_node_common import topics
from afm_node_common.parameters import declare
from afm_node_common.presence import Presence
from afm_node_common.runner import run
from afm_node_common.stamps import nanoseconds
from afm_node_common.subscriptions import Subscriptions

from . import checks, layout, messages
from .channels import Channels
from .health import Health, HealthPublisher
from .layout import Signal
from .parameters import RecorderParameters
from .recorder import Recorder
from .results import Gathering
from .watch import ParameterWatch, full_name

_PERIOD = 0.2
"""Wall time between two checks of the other nodes, status messages and chances to flush [s]."""
_SETTLE, _SILENCE, _DRAIN_LIMIT = 0.5, 4.0, 10.0
"""At the end, wall time to wait for the last blocks of an instrument that ends too; for published blocks that are
missing, while nothing comes (more than the middleware's heartbeat of 3 s, with which it repeats lost messages: a killed
instrument repeats none), and at all [s]."""

_ENDED = (InstrumentStatus.FINISHED, InstrumentStatus.FAULT)


class RecorderNode(Node):
    """Records waveforms, control trace, status, and the parameters of the nodes in its namespace.

    Parameters
    ----------
    kwargs : arguments of `rclpy.node.Node`

    Raises
    ------
    ParameterError
        If a parameter is refused, or there cannot be a file at the path.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__("afm_recorder_node", **({"namespace": topics.NAMESPACE} | kwargs))
        self.recorder = Recorder(declare(self, RecorderParameters), self.get_logger())
        self._status = InstrumentStatus()
        self._ready, self._run_id = False, 0
        self._inputs = Subscriptions(self)
        self._health = HealthPublisher(self)
        self._presence = Presence(self, subscribe=False)
        self._watch = ParameterWatch(self, self._inputs, self._on_known, self._on_changed)
        self._channels = Channels(self, self._inputs, self._on_waveform, self.recorder.further_channel)
        self._trace = self._inputs.subscribe(ControlTrace, topics.CONTROL_TRACE, self._on_trace, topics.STREAM_QOS)
        self._inputs.subscribe(InstrumentStatus, topics.STATUS, self._on_status, topics.EVERY_STATE_QOS)
        self._inputs.subscribe(ScanLine, topics.SCAN_LINE, self._on_line, topics.SCAN_LINE_QOS)
        self._inputs.subscribe(Event, topics.EVENTS, self._on_event, topics.EVENTS_QOS)
        self._inputs.subscribe(NamedArray, topics.RESULTS, self._on_array, topics.RESULTS_QOS)
        self._results = Gathering()
        self._score = self._inputs.subscribe(Score, topics.SCORE, self._on_score, topics.LATCHED_QOS)
        # A timer of the system's clock stops for as long as that is set back.
        self.create_timer(_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def finish(self, spin_once: Callable[[float], None]) -> None:
        """Receive the last messages, then close the recording."""
        begin = heard = now = time.monotonic()
        counts = self.recorder.counts()
        while now < min(begin + _DRAIN_LIMIT, heard + _SILENCE):
            ended = self._status.state in _ENDED or now >= begin + _SETTLE
            # The score comes on another topic, before or after the last status.
            scored = self.recorder.scored or not self._score.get_publisher_count() or now >= begin + _SETTLE
            if ended and scored and self.recorder.has(self._status.ticks, self._status.samples):
                break
            spin_once(0.05)
            before, counts, now = counts, self.recorder.counts(), time.monotonic()
            if counts != before:
                heard = now
        try:
            self.recorder.close()
        except OSError as error:
            raise SystemExit(f"error: {error}") from None
        self._publish()

    def _on_waveform(self, signal: Signal, message: Waveform) -> None:
        samples = np.frombuffer(message.samples)
        self.recorder.channel(signal, message.first_sample, message.sample_period, samples, message.scale)

    def _on_trace(self, message: ControlTrace) -> None:
        checks.control_trace(message)
        self._run_id = message.run_id
        time_ns = nanoseconds(message.header.stamp)
        self.recorder.control(message.first_sequence, message.control_period, time_ns, messages.columns(message))

    def _on_line(self, message: ScanLine) -> None:
        self.recorder.line(checks.scan_line(message))

    def _on_array(self, message: NamedArray) -> None:
        if (result := self._results.put(checks.result_part(message))) is not None:
            self.recorder.result(checks.result(result))

    def _on_status(self, message: InstrumentStatus) -> None:
        checks.stamp(message)
        self._presence.heard()
        self._status = message
        told = messages.state(message)
        self.recorder.state(nanoseconds(message.header.stamp), message.ticks, told.text, told.level)

    def _on_score(self, message: Score) -> None:
        checks.stamp(message)
        self.recorder.score(nanoseconds(message.header.stamp), messages.plain(message))

    def _on_event(self, message: Event) -> None:
        checks.stamp(message)
        self.recorder.event(nanoseconds(message.header.stamp), message.text, messages.level(message))

    def _on_known(self, node: str, values: dict[str, Any]) -> None:
        self.recorder.parameters(self._short(node), values)

    def _on_changed(self, node: str, name: str, old: object, new: object) -> None:
        self.recorder.parameter_change(self._short(node), name, old, new)

    def _look(self) -> None:
        instruments = [
            full_name(info.node_name, info.node_namespace)
            for info in self.get_publishers_info_by_topic(self.resolve_topic_name(topics.CONTROL_TRACE))
        ]
        parties = {*self._status.controllers, *instruments}
        self._presence.look()
        self._watch.look(parties)
        self._channels.look()
        streams = [self._trace, *(self._channels.subscriptions[signal.name] for signal in layout.CHANNELS)]
        heard = all(stream.get_publisher_count() > 0 for stream in streams)
        self._ready = heard and bool(self._status.controllers) and self._watch.settled(parties)
        for name in instruments:
            height = self._watch.values.get(name, {}).get("cantilever.a", 0.0)
            if name in self._watch.values and isinstance(height, int | float):
                self.recorder.cantilever_height(float(height))
        self.recorder.update()
        self._publish()

    def _publish(self) -> None:
        health = Health(
            run_id=self._run_id,
            ready=self._ready,
            messages_dropped=self._inputs.drops.count + self.recorder.strays,
            writing=not self.recorder.problem,
            detail=self.recorder.problem or "; ".join(filter(None, (self._presence.problem, self._inputs.drops.last))),
            **asdict(self.recorder.counts()),
        )
        self._health.publish(health, self.recorder.time_ns)

    def _short(self, node: str) -> str:
        """Name of a node within the namespace; nodes of other namespaces keep their full name."""
        return node.removeprefix(f"{self.get_namespace().rstrip('/')}/")


def main() -> int:
    """Entry point."""
    return run(RecorderNode, RecorderParameters)
