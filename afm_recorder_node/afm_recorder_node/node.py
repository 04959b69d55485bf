"""The recorder as a ROS node: it takes the messages of an instrument as bytes and gives them to `Recorder`."""

import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from afm_msgs.msg import (
    ControlTrace,
    Event,
    InstrumentStatus,
    Measurement,
    NamedArray,
    Parameters,
    PiezoDrive,
    ScanLine,
    Score,
    Waveform,
)
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile

from afm_model import __version__
from afm_model.microscope.image import RETRACE
from afm_node_common import topics
from afm_node_common.decoding import InvalidMessage, nanoseconds
from afm_node_common.direct import Inbox
from afm_node_common.parameters import declare
from afm_node_common.presence import Presence
from afm_node_common.runner import run
from afm_node_common.stamps import stamp
from afm_node_common.subscriptions import Subscriptions

from . import checks, heads
from .definitions import decoded, definition, kind_of, serialized
from .health import Health, HealthPublisher
from .names import CHANNELS, RECORD, VIEW, is_channel
from .parameters import RecorderParameters
from .recorder import Message, Recorder
from .views_worker import News, Worker
from .watch import ParameterWatch, full_name

_TAKE_PERIOD, _LOOK_PERIOD = 0.02, 0.2
"""Wall time between two turns in which messages are taken; between two looks at the other nodes, status messages and
chances to flush [s]."""
_AT_ONCE = 2000
"""Messages of one topic that are taken in one turn, at most."""
_SETTLE, _DRAIN_LIMIT = 0.5, 10.0
"""At the end, wall time to wait for the last blocks of an instrument that ends too, and at all [s]."""
_TYPE = "afm_msgs/msg/Waveform"


class RecorderNode(Node):
    """Records what an instrument publishes, and the parameters of the nodes in its namespace.

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
        asked = declare(self, RecorderParameters)
        self._worker = Worker() if asked.view else None
        self.recorder = Recorder(
            Path(asked.path).absolute().with_suffix(RECORD),
            self.get_logger(),
            definition,
            trace=topics.CONTROL_TRACE,
            channels=list(CHANNELS),
            about={"namespace": self.get_namespace(), "title": asked.title, "version": __version__},
            event=self._event,
            opened=self._on_opened,
            done=self._on_done,
        )
        self._status = InstrumentStatus()
        self._ready = False
        self._take_at = self._look_at = 0.0
        subscriptions = Subscriptions(self)
        self._drops = subscriptions.drops
        self._health = HealthPublisher(self)
        self._presence = Presence(self, subscribe=False)
        self._published: dict[str, int] = {}  # nodes that publish their parameters, and the run of the last ones
        self._watch = ParameterWatch(self, subscriptions, self._on_known, self._on_changed)
        self._units: dict[str, str] = {}
        self._refused: set[str] = set()
        self._inboxes: dict[str, tuple[Inbox, Callable[[str, bytes], None]]] = {}
        for name, self._units[name] in CHANNELS.items():
            self._listen(Waveform, name, self._on_waveform, topics.STREAM_QOS)
        self._listen(ControlTrace, topics.CONTROL_TRACE, self._on_trace, topics.STREAM_QOS)
        for kind, name, qos in (
            (InstrumentStatus, topics.STATUS, topics.EVERY_STATE_QOS),
            (Event, topics.EVENTS, topics.EVENTS_QOS),
            (ScanLine, topics.SCAN_LINE, topics.SCAN_LINE_QOS),
            (NamedArray, topics.RESULTS, topics.RESULTS_QOS),
            (Parameters, topics.PARAMETERS, topics.EVENTS_QOS),
            (Score, topics.SCORE, topics.LATCHED_QOS),
        ):
            self._listen(kind, name, self._taker(kind_of(kind)), qos)
        if asked.exchanges:
            for kind, name in ((Measurement, topics.MEASUREMENT), (PiezoDrive, topics.PIEZO_DRIVE)):
                self._listen(kind, name, self._exchange(kind_of(kind)), topics.MEASUREMENT_QOS)

    # The loop of the node; see `afm_node_common.runner`.

    def step(self) -> bool:
        """Take what has come since the last turn."""
        now = time.monotonic()
        if now < self._take_at:
            return False
        self._take_at = now + _TAKE_PERIOD
        for name, (inbox, take) in list(self._inboxes.items()):
            for _ in range(_AT_ONCE):
                if (taken := inbox.take()) is None:
                    break
                try:
                    take(name, taken[0])
                except InvalidMessage as error:
                    self._drops.add(name, str(error))
        return False

    def wait(self, timeout: float) -> None:
        """Sleep until the next turn, or for `timeout` [s]."""
        time.sleep(max(min(timeout, self._take_at - time.monotonic()), 0.0))

    def serve_periodic(self) -> None:
        """Look at the other nodes, and write."""
        now = time.monotonic()
        if now >= self._look_at:
            self._look_at = now + _LOOK_PERIOD
            self._look()

    def finish(self, spin_once: Callable[[float], None]) -> None:
        """Receive the last messages, close the records, and wait for what is made from them."""
        begin = time.monotonic()
        while (now := time.monotonic()) < begin + _DRAIN_LIMIT:
            self.step()
            # A run that still goes on is not waited for.
            if now >= begin + _SETTLE and not (self.recorder.present.over and self.recorder.waits()):
                break
            if self.recorder.present.over and not self.recorder.waits():
                break
            spin_once(0.0)
            self.wait(_TAKE_PERIOD)
        try:
            self.recorder.close()
            self._publish()
        except OSError as error:
            raise SystemExit(f"error: {error}") from None
        finally:
            if self._worker is not None:
                self._log_views(self._worker.finish())

    def destroy_node(self) -> None:
        """Let the inboxes go first."""
        for inbox, _ in self._inboxes.values():
            inbox.close()
        self._inboxes.clear()
        super().destroy_node()

    # What comes.

    def _listen(self, kind: Any, name: str, take: Callable[[str, bytes], None], qos: QoSProfile) -> None:
        self._inboxes[name] = Inbox(self, kind, name, qos), take

    def _on_waveform(self, name: str, data: bytes) -> None:
        block = heads.waveform(data)
        if block.unit != self._units.setdefault(name, block.unit):
            raise InvalidMessage(f"unit {block.unit!r}: this channel is in {self._units[name]!r}")
        self.recorder.block(Message(name, _TYPE, block.time_ns, time.time_ns(), data), block)

    def _on_trace(self, name: str, data: bytes) -> None:
        block = heads.control_trace(data)
        self.recorder.block(Message(name, "afm_msgs/msg/ControlTrace", block.time_ns, time.time_ns(), data), block)

    def _exchange(self, kind: str) -> Callable[[str, bytes], None]:
        def take(name: str, data: bytes) -> None:
            head, _ = heads.head(data)
            _, length = decoded(kind, data)
            message = Message(name, kind, head.time_ns, time.time_ns(), data[:length])
            self.recorder.put(message, head.run_id, once=False)

        return take

    def _taker(self, kind: str) -> Callable[[str, bytes], None]:
        """What takes messages of a type that are few: they are read and checked before they are kept."""

        def take(name: str, data: bytes) -> None:
            message, length = decoded(kind, data)
            time_ns = self._checked(kind, message)
            if not message.run_id:
                raise InvalidMessage("run_id 0: it must be that of a run")
            kept = Message(name, kind, time_ns, time.time_ns(), data[:length])
            self._note(kind, message, self.recorder.put(kept, message.run_id))

        return take

    def _checked(self, kind: str, message: Any) -> int:
        """Check a message; its time [ns]."""
        if kind == kind_of(NamedArray):
            return checks.result_part(message).time_ns
        if kind == kind_of(ScanLine):
            checks.scan_line(message)
        checks.stamp(message)
        return nanoseconds(message.header.stamp)

    def _note(self, kind: str, message: Any, progress: Any) -> None:
        """Learn what a message says of its run; `progress` of that, None: its record is closed, or it came twice."""
        if kind == kind_of(InstrumentStatus):
            self._presence.heard()
            self._status = message
        elif kind == kind_of(Parameters):
            self._published[message.node] = message.run_id
        if progress is None:
            return
        if kind == kind_of(InstrumentStatus):
            progress.ticks, progress.samples = int(message.ticks), int(message.samples)
            progress.over |= message.over
            if message.over and self._worker is not None:
                self._worker.start()
            progress.finished |= message.state == InstrumentStatus.FINISHED
        elif kind == kind_of(Score):
            progress.scored = True
        elif kind == kind_of(ScanLine):
            progress.lines.put(int(message.scan), 2 * int(message.index) + (message.direction == RETRACE))

    # What the recorder adds: parameters of nodes that do not publish them, and events about gaps.

    def _on_known(self, node: str, values: dict[str, Any]) -> None:
        if present := self.recorder.present.run_id:
            self._put_parameters(present, self.recorder.present.time_ns, node, values, changes=False)

    def _on_changed(self, node: str, name: str, old: object, new: object) -> None:
        if present := self.recorder.present.run_id:
            self._put_parameters(present, self.recorder.present.time_ns, node, {name: new}, changes=old is not None)

    def _on_opened(self, run_id: int, time_ns: int) -> None:
        for node, values in self._watch.values.items():
            if node not in self._published:
                self._put_parameters(run_id, time_ns, node, values, changes=False)

    def _put_parameters(
        self, run_id: int, time_ns: int, node: str, values: Mapping[str, Any], *, changes: bool
    ) -> None:
        message = Parameters(run_id=run_id, node=node, changes=changes)
        message.header.frame_id, message.header.stamp = topics.FRAME, stamp(time_ns)
        for name, value in values.items():
            with suppress(TypeError, ValueError, AttributeError):  # lists that are empty, or of bytes
                message.parameters.append(Parameter(name, value=value).to_parameter_msg())
        self.recorder.put(_kept(topics.PARAMETERS, message, time_ns), run_id)

    def _event(self, run_id: int, time_ns: int, text: str) -> Message:
        message = Event(run_id=run_id, text=text, level=Event.WARN)
        message.header.frame_id, message.header.stamp = topics.FRAME, stamp(time_ns)
        return _kept(topics.EVENTS, message, time_ns)

    def _on_done(self, path: Path) -> None:
        if self._worker is not None:
            self._worker.make(path, path.with_suffix(VIEW))

    # Now and then.

    def _look(self) -> None:
        infos = self.get_publishers_info_by_topic(self.resolve_topic_name(topics.CONTROL_TRACE))
        instruments = {full_name(info.node_name, info.node_namespace) for info in infos}
        parties = {*instruments, *(name for name in self._status.controllers if name.startswith("/"))}
        others = parties - self._published.keys()
        self._presence.look()
        self._watch.look(others, self._published)
        self._look_for_channels()
        streams = [self._inboxes[name][0] for name in (topics.CONTROL_TRACE, *CHANNELS)]
        heard = all(stream.publishers > 0 for stream in streams)
        known = all(self._published[name] == self._status.run_id for name in parties & self._published.keys())
        self._ready = heard and bool(self._status.controllers) and known and self._watch.settled(others)
        self.recorder.update()
        self._log_views(self._worker.news() if self._worker is not None else [])
        self._publish()

    def _look_for_channels(self) -> None:
        """Listen to every topic of type Waveform in the namespace."""
        namespace = f"{self.get_namespace().rstrip('/')}/"
        for topic, types in self.get_topic_names_and_types():
            name = topic.removeprefix(namespace)
            if _TYPE not in types or name == topic or name in self._inboxes or name in self._refused:
                continue
            if is_channel(name):
                self._listen(Waveform, name, self._on_waveform, topics.STREAM_QOS)
            else:
                self._refused.add(name)
                self.get_logger().warning(f"{topic} is not recorded: a recording holds something else there")

    def _log_views(self, views: Iterable[News]) -> None:
        for each in views:
            if each.error:
                self.get_logger().error(each.error)
            else:
                self.get_logger().info(f"drawn for the viewer: {each.target}")

    def _publish(self) -> None:
        problem = self.recorder.problem
        health = Health(
            ready=self._ready,
            messages_dropped=self._drops.count,
            writing=not problem,
            detail=problem
            or "; ".join(filter(None, (self.recorder.present.problem, self._presence.problem, self._drops.last))),
            **asdict(self.recorder.counts()),
        )
        self._health.publish(health, self.recorder.present.time_ns)


def _kept(topic: str, message: Any, time_ns: int) -> Message:
    """A message of the recorder itself."""
    return Message(topic, kind_of(message), time_ns, time.time_ns(), serialized(message))


def main() -> int:
    """Entry point."""
    return run(RecorderNode, RecorderParameters)
