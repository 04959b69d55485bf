"""Bags of `ros2 bag record`, read as recordings. Needs no ROS: the definitions stand in the bag.

Definitions that an old bag has not are those of the installed messages, if there are any.
"""

from collections import Counter
from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from afm_model.core.errors import reason
from afm_node_common.decoding import nanoseconds

from .names import CHANNELS
from .record import RecordEntry
from .recording import RecordingError

PARAMETER_EVENTS = "/parameter_events"
_OURS = "afm_msgs/msg/"
_BLOCKS = (f"{_OURS}ControlTrace", f"{_OURS}Waveform")
_LATEST_NS = 10**17
"""Latest simulated time [ns], three years: a later stamp is one of the system's clock."""


@dataclass
class Bag:
    """The messages of one run in a bag; see `open_bag`."""

    path: Path
    about: dict[str, str]
    run_id: int
    missing: str = ""
    _types: Typestore = field(default_factory=Typestore)

    def messages(
        self, topics: Collection[str] | None = None, begin_ns: int = 0, end_ns: int = 2**63
    ) -> Iterator[RecordEntry]:
        """Yield the messages in the order in which they came; see `Record.messages`."""
        space = f"{self.about['namespace']}/"
        time_ns = 0
        with _reading(self.path), AnyReader([self.path], default_typestore=self._types) as bag:
            kept = [
                each
                for each in bag.connections
                if each.topic == PARAMETER_EVENTS or (each.topic.startswith(space) and each.msgtype.startswith(_OURS))
            ]
            published = any(each.msgtype == f"{_OURS}Parameters" for each in kept)
            message: Any
            for connection, _, raw in bag.messages(kept) if kept else ():
                topic = connection.topic.removeprefix(space)
                if connection.topic == PARAMETER_EVENTS:
                    if not published and (topics is None or "parameters" in topics):
                        message = bag.deserialize(raw, connection.msgtype)
                        stamp = nanoseconds(message.stamp)
                        at = stamp if stamp < _LATEST_NS else time_ns
                        yield from _parameters(message, at)
                    continue
                if topics is not None and topic not in topics:
                    continue
                message = bag.deserialize(raw, connection.msgtype)
                if getattr(message, "run_id", 0) not in (0, self.run_id):
                    continue
                if hasattr(message, "header"):
                    time_ns = nanoseconds(message.header.stamp)
                yield RecordEntry(topic, connection.msgtype, time_ns, message)


def open_bag(path: Path) -> Bag:
    """Find the run in a bag.

    Parameters
    ----------
    path : Path
        File or folder of the bag.

    Raises
    ------
    RecordingError
        If it is no bag, holds nothing of an instrument, several instruments or runs.
    """
    try:
        path.stat()
    except OSError as error:
        raise RecordingError(f"{path} is no readable recording: {reason(error)}") from error
    types = get_typestore(Stores.ROS2_JAZZY)
    _add_installed(types)
    spaces: set[str] = set()
    runs: Counter[int] = Counter()
    starts: dict[tuple[str, int], int] = {}
    with _reading(path), AnyReader([path], default_typestore=types) as bag:
        blocks = [each for each in bag.connections if each.msgtype in _BLOCKS]
        for connection, _, raw in bag.messages(blocks) if blocks else ():
            message: Any = bag.deserialize(raw, connection.msgtype)
            names = ("control_trace", *CHANNELS)
            spaces |= {
                connection.topic.removesuffix(f"/{name}") for name in names if connection.topic.endswith(f"/{name}")
            }
            run_id = int(getattr(message, "run_id", 0))
            runs[run_id] += 1
            first = int(getattr(message, "first_sample", getattr(message, "first_sequence", 0)))
            if first <= starts.get((connection.topic, run_id), -1):
                raise RecordingError(f"{path} holds several runs: {connection.topic} begins again at number {first}")
            starts[connection.topic, run_id] = first
    if not runs:
        raise RecordingError(f"{path} holds no control_trace and no waveform of an instrument")
    if len(spaces) > 1:
        raise RecordingError(f"{path} holds the topics of several instruments: {sorted(spaces)}")
    if len(runs) > 1:
        raise RecordingError(f"{path} holds several runs, {len(runs)} of them: record a bag for each")
    return Bag(path, {"namespace": spaces.pop(), "title": ""}, next(iter(runs)), _types=types)


class _reading:
    """Names the bag in whatever its reader makes of a damaged or foreign file."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __enter__(self) -> None: ...

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if isinstance(error, Exception) and not isinstance(error, RecordingError):
            raise RecordingError(f"{self._path} is no readable recording: {error}") from error


def _add_installed(types: Typestore) -> None:
    """Our messages as they are installed, where ROS is."""
    with suppress(ImportError, LookupError, OSError):
        from ament_index_python.packages import get_package_share_directory

        found: dict[str, Any] = {}
        for file in sorted((Path(get_package_share_directory("afm_msgs")) / "msg").glob("*.msg")):
            found |= get_types_from_msg(file.read_text(), f"{_OURS}{file.stem}")
        types.register(found)


def _parameters(event: Any, time_ns: int) -> Iterator[RecordEntry]:
    """An rcl_interfaces/ParameterEvent as the messages of parameters that a recorder keeps."""
    for parameters, changes in ((event.new_parameters, False), (event.changed_parameters, True)):
        if len(parameters):
            message = SimpleNamespace(node=event.node, changes=changes, parameters=parameters)
            yield RecordEntry("parameters", f"{_OURS}Parameters", time_ns, message)
