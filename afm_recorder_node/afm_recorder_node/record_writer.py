"""One record: the messages of one run as they came, in one MCAP file. Needs no ROS."""

import json
import platform
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path

from mcap.writer import CompressionType, Writer

from .growing import GrowingFile

LIBRARY = "afm_recorder_node"
ABOUT, END = "afm", "afm_end"
"""Metadata of a record: at its begin, and at its end. A record without the second has broken off."""

CHECKSUM = "crc32"
"""Name of the checksum in the first."""


def checksum(about: Mapping[str, str]) -> str:
    """Checksum of what is known at the begin: as long as a record has no end, nothing else covers it."""
    return f"{zlib.crc32(json.dumps(sorted(about.items())).encode()):08x}"


class _Tail:
    """What the library writes, until it is in the file."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._before = 0

    def write(self, data: bytes) -> int:
        self._data += data
        return len(data)

    def tell(self) -> int:
        return self._before + len(self._data)

    def flush(self) -> None:
        """Nothing: `take` does."""

    def take(self) -> bytearray:
        data, self._data = self._data, bytearray()
        self._before += len(data)
        return data


class RecordWriter:
    """Writes messages as bytes, with the definitions of their types, in chunks with checksums.

    Parameters
    ----------
    file : GrowingFile
    definition : callable
        definition(kind): text of a type of message.
    about : mapping of str to str
        What is known of the run at its begin.
    """

    def __init__(self, file: GrowingFile, definition: Callable[[str], str], about: Mapping[str, str]) -> None:
        self.file = file
        self._definition = definition
        self._tail = _Tail()
        self._writer = Writer(self._tail, compression=CompressionType.ZSTD, enable_data_crcs=True)  # type: ignore[arg-type]
        self._writer.start(profile="ros2", library=LIBRARY)
        about = {"python": platform.python_version(), **about}
        self._writer.add_metadata(ABOUT, about | {CHECKSUM: checksum(about)})
        # At once: what a recorder leaves that is killed now says of which run it is.
        self.file.write(self._tail.take())
        self._schemas: dict[str, int] = {}
        self._channels: dict[tuple[str, str], int] = {}
        self.count = 0
        """Messages in it."""

    def put(self, topic: str, kind: str, time_ns: int, received_ns: int, data: bytes) -> None:
        """Add a message: its topic and type, simulated time, wall time at which it came [ns], and its bytes."""
        channel = self._channels.get((topic, kind))
        if channel is None:
            channel = self._channels[topic, kind] = self._channel(topic, kind)
        self._writer.add_message(channel, time_ns, data, received_ns, self.count % 2**32)
        self.count += 1

    def flush(self) -> bool:
        """Write what has come to the file, as a chunk that can be read; False if that was not possible."""
        self._writer.flush()
        return self.file.write(self._tail.take())

    def close(self, end: Mapping[str, str]) -> Path:
        """Write the end, with what is known of the run, and the index.

        Raises
        ------
        OSError
            If it could not be written; what could be is in the file.
        """
        self._writer.flush()
        self._writer.add_metadata(END, dict(end))
        self._writer.finish()
        written = self.file.write(self._tail.take())
        self.file.finish()
        if not written:
            raise OSError(f"{self.file.path} has no end: {self.file.problem}")
        return self.file.path

    def _channel(self, topic: str, kind: str) -> int:
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", self._definition(kind).encode())
        return self._writer.register_channel(topic, "cdr", self._schemas[kind])
