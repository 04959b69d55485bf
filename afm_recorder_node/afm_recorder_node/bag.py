"""Bags of `ros2 bag record`, read as recordings. Needs the messages of ROS, and the package rosbags."""

import os
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

from afm_msgs.msg import ControlTrace, Event, InstrumentStatus, ScanLine, Score, Waveform
from ament_index_python.packages import get_package_share_directory
from builtin_interfaces.msg import Time
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import parameter_value_to_python
from rclpy.serialization import deserialize_message
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from afm_model.core.errors import reason
from afm_node_common.stamps import nanoseconds
from afm_node_common.subscriptions import InvalidMessage

from . import checks, messages
from .layout import signal
from .readable import no_room
from .recording import RecordingError
from .writer import RecordingWriter

PARAMETER_EVENTS = "/parameter_events"
_EVENT = "afm_msgs/msg/Event"
_LATEST_NS = 10**17
"""Latest simulated time [ns], three years: a stamp behind it is one of the system's clock."""


@cache
def typestore() -> Typestore:
    """The types of ROS 2, and ours as they are installed."""
    store = get_typestore(Stores.ROS2_JAZZY)
    found: dict[str, Any] = {}
    for file in sorted((Path(get_package_share_directory("afm_msgs")) / "msg").glob("*.msg")):
        found |= get_types_from_msg(file.read_text(), f"afm_msgs/msg/{file.stem}")
    store.register(found)
    return store


def kind_of(message: Any) -> str:
    """Name of the type of a message, afm_msgs/msg/Waveform for example."""
    return f"{type(message).__module__.partition('.')[0]}/msg/{type(message).__name__}"


def recording_of(path: Path) -> Path:
    """A recording with what a bag holds, in a temporary file that lives as long as the process.

    Parameters
    ----------
    path : Path
        File or folder of the bag.

    Raises
    ------
    RecordingError
        If it is no bag, holds nothing of an instrument, several instruments or runs, or messages of another version.
    """
    try:
        changed = path.stat().st_mtime_ns
    except OSError as error:
        raise RecordingError(f"{path} is no readable bag: {reason(error)}") from error
    try:
        return _recording_of(path.absolute(), changed)
    except OSError as error:
        raise no_room(str(path), error) from error


@cache
def _recording_of(path: Path, changed: int) -> Path:
    folder = Path(_folder().name)
    writer = RecordingWriter(folder / f"{len(os.listdir(folder))}.rrd")
    try:
        with AnyReader([path]) as bag:
            _Copy(path, bag, writer).run()
    except RecordingError:
        raise
    # What its reader makes of a damaged or foreign file.
    except Exception as error:
        raise RecordingError(f"{path} is no readable bag: {error}") from error
    finally:
        made = writer.close()
    if made is None:
        raise RecordingError(f"{path} holds neither control_trace nor a waveform of an instrument")
    return made


@cache
def _folder() -> "tempfile.TemporaryDirectory[str]":
    return tempfile.TemporaryDirectory(prefix="afm_bag_")


class _Copy:
    """Copies what an instrument has published from an open bag into a recording; `path` is for messages."""

    def __init__(self, path: Path, bag: AnyReader, writer: RecordingWriter) -> None:
        self._path, self._bag, self._writer = path, bag, writer
        self._known: dict[str, dict[str, Any]] = {}
        self._next: dict[str, int] = {}
        self._state: messages.Told | None = None
        self._time_ns = 0
        self._space = self._namespace()

    def run(self) -> None:
        """Copy everything; RecordingError if there are messages of another version or of another run."""
        put = {
            Waveform: self._waveform,
            ControlTrace: self._trace,
            InstrumentStatus: self._status,
            Score: self._score,
            Event: self._event,
            ScanLine: self._line,
            ParameterEvent: self._changed,
        }
        kinds = {kind_of(kind()): kind for kind in put}
        for connection in self._bag.connections:
            name = connection.msgtype
            # Another version would be read as other numbers.
            if (
                name in kinds
                and name != _EVENT
                and self._bag.typestore.hash_rihs01(name) != typestore().hash_rihs01(name)
            ):
                raise RecordingError(f"{self._path} holds {name} of another version: read it with that one")
        for _, raw in self._messages(lambda connection: connection.topic == PARAMETER_EVENTS):
            event = deserialize_message(raw, ParameterEvent)
            values = self._known.setdefault(self._short(event.node), {})
            values |= {
                each.name: value
                for each in event.new_parameters
                if (value := parameter_value_to_python(each.value)) is not None
            }
        for node, values in self._known.items():
            self._writer.parameters(node, values)
        for connection, raw in self._messages(lambda connection: self._is_ours(connection, kinds)):
            message = (
                self._event_of(raw)
                if connection.msgtype == _EVENT
                else deserialize_message(raw, kinds[connection.msgtype])
            )
            if hasattr(message, "header"):
                self._time_ns = max(self._time_ns, nanoseconds(message.header.stamp))
            try:
                put[kinds[connection.msgtype]](self._short(connection.topic), message)
            except InvalidMessage as error:
                raise RecordingError(f"{self._path}: a message of {connection.topic} is not valid: {error}") from None

    def _messages(self, wanted: Callable[[Connection], bool]) -> Iterator[tuple[Connection, bytes]]:
        chosen = [connection for connection in self._bag.connections if wanted(connection)]
        if chosen:  # of none its reader gives all
            yield from ((connection, raw) for connection, _, raw in self._bag.messages(chosen))

    def _namespace(self) -> str:
        """Where the instrument is."""
        for kinds in (("ControlTrace", "InstrumentStatus"), ("Waveform",)):
            topics = [c.topic for c in self._bag.connections if c.msgtype.removeprefix("afm_msgs/msg/") in kinds]
            spaces = {topic.removesuffix("/truth").rpartition("/")[0] for topic in topics}
            if len(spaces) > 1:
                raise RecordingError(f"{self._path} holds the topics of several instruments: {sorted(spaces)}")
            if spaces:
                return spaces.pop()
        return ""

    def _is_ours(self, connection: Connection, kinds: dict[str, Any]) -> bool:
        here = connection.topic.startswith(f"{self._space}/") or connection.topic == PARAMETER_EVENTS
        return here and connection.msgtype in kinds

    def _short(self, name: str) -> str:
        return name.removeprefix(f"{self._space}/")

    def _waveform(self, name: str, message: Waveform) -> None:
        known = signal(name, message.unit)
        checks.waveform(message, known.si_unit)
        self._follow(name, message.first_sample, len(message.samples))
        self._writer.channel(known, message.first_sample, message.sample_period, message.samples, message.scale)

    def _trace(self, name: str, message: ControlTrace) -> None:
        checks.control_trace(message)
        self._follow(name, message.first_sequence, len(message.deflection))
        self._writer.control(
            message.first_sequence,
            message.control_period,
            **messages.columns(message),
            cantilever_height=self._known.get("afm_sim_node", {}).get("cantilever.a", float("nan")),
        )

    def _status(self, name: str, message: InstrumentStatus) -> None:
        told = messages.state(message)
        if told != self._state:
            self._state = told
            self._writer.event(nanoseconds(message.header.stamp), told.text, told.level)

    def _score(self, name: str, message: Score) -> None:
        self._writer.score(nanoseconds(message.header.stamp), messages.plain(message))

    def _event(self, name: str, message: Event) -> None:
        self._writer.event(nanoseconds(message.header.stamp), message.text, messages.level(message))

    def _event_of(self, raw: bytes) -> Event:
        """Read by the definition in the bag: those of earlier versions have no level."""
        found: Any = self._bag.deserialize(raw, _EVENT)
        event = Event(tick=found.tick, text=found.text, level=getattr(found, "level", Event.INFO))
        event.header.stamp = Time(sec=found.header.stamp.sec, nanosec=found.header.stamp.nanosec)
        return event

    def _line(self, name: str, message: ScanLine) -> None:
        self._writer.line(checks.scan_line(message))

    def _changed(self, name: str, message: ParameterEvent) -> None:
        node, stamp = self._short(message.node), nanoseconds(message.stamp)
        values = self._known.setdefault(node, {})
        for each in message.changed_parameters:
            value = parameter_value_to_python(each.value)
            if values.get(each.name) != value:
                time_ns = stamp if stamp < _LATEST_NS else self._time_ns
                self._writer.parameter_change(time_ns, node, each.name, values.get(each.name), value)
                values[each.name] = value

    def _follow(self, name: str, first: int, count: int) -> None:
        if first < self._next.get(name, 0):
            raise RecordingError(f"{self._path} holds several runs: {name} begins again at number {first}")
        self._next[name] = first + count
