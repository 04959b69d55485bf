"""Reads a record: checks its bytes, and gives its messages. Needs no ROS: the definitions stand in the file."""

import os
import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Footer, Message, Metadata, Schema
from mcap.stream_reader import CRCValidationError, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from .record_writer import ABOUT, END
from .recording import DamagedRecording, RecordingError

_HEAD = struct.Struct("<BQ")
_AT_ONCE = 1 << 24
_OPCODES = frozenset(int(each) for each in Opcode)
_ERRORS = (McapError, CRCValidationError, struct.error, ValueError, KeyError, EOFError, OSError, MemoryError)
"""What the library raises for bytes that are not a record of its format."""


class Entry(NamedTuple):
    """A message of a record."""

    topic: str  # within the namespace of the instrument
    kind: str  # type, such as afm_msgs/msg/Waveform
    time_ns: int  # simulated
    message: Any  # with the fields of its definition


class _Place(NamedTuple):
    """A record of the format in the file."""

    opcode: int
    begin: int
    end: int


@dataclass
class Record:
    """The messages of one run, in a file that has been checked; see `open_record`."""

    path: Path
    about: dict[str, str] = field(default_factory=dict)
    """What was known at the begin."""
    end: dict[str, str] | None = None
    """What was known at the end; None: the record has broken off, or still grows."""
    _chunks: list[_Place] = field(default_factory=list)
    _checked: bool = False
    _schemas: dict[int, Schema] = field(default_factory=dict)
    _channels: dict[int, Channel] = field(default_factory=dict)
    _types: Typestore = field(default_factory=Typestore)

    @property
    def missing(self) -> str:
        """Why it is not complete; empty if it is."""
        if self.end is None:
            return "it has no end: its recorder is still at work, or was killed"
        return self.end.get("missing", "")

    def messages(
        self, topics: Collection[str] | None = None, begin_ns: int = 0, end_ns: int = 2**63
    ) -> Iterator[Entry]:
        """Yield the messages in the order in which they came.

        Parameters
        ----------
        topics : collection of str, optional
            Of these topics only.
        begin_ns, end_ns : int
            Leave out chunks without messages in this simulated time [ns]; a block may begin before it.

        Raises
        ------
        RecordingError
            If a message cannot be read by its definition.
        """
        with self.path.open("rb") as file:
            for place in self._chunks_in(file, begin_ns, end_ns):
                yield from self._of_chunk(_chunk(file, place), topics)

    def _chunks_in(self, file: Any, begin_ns: int, end_ns: int) -> Iterator[_Place]:
        before: _Place | None = None
        for place in self._chunks:
            first, last = struct.unpack("<QQ", os.pread(file.fileno(), 16, place.begin + _HEAD.size))
            if last < begin_ns:
                before = place  # its last blocks may reach beyond it
                continue
            if before is not None:
                yield before
                before = None
            if first <= end_ns:
                yield place
        if before is not None:
            yield before

    def _of_chunk(self, chunk: Chunk, topics: Collection[str] | None) -> Iterator[Entry]:
        try:
            records = breakup_chunk(chunk, validate_crc=not self._checked)
        except _ERRORS as error:
            raise DamagedRecording(f"{self.path} is damaged: {error}") from error
        for each in records:
            if isinstance(each, Schema):
                self._learn(each)
            elif isinstance(each, Channel):
                self._channels[each.id] = each
            elif isinstance(each, Message):
                channel = self._channels[each.channel_id]
                if topics is None or channel.topic in topics:
                    kind = self._schemas[channel.schema_id].name
                    yield Entry(channel.topic, kind, each.log_time, self._read(kind, each.data))

    def _learn(self, schema: Schema) -> None:
        if schema.id in self._schemas:
            return
        self._schemas[schema.id] = schema
        found = get_types_from_msg(schema.data.decode(), schema.name)
        self._types.register({name: what for name, what in found.items() if name not in self._types.fielddefs})

    def _read(self, kind: str, data: bytes) -> Any:
        try:
            return self._types.deserialize_cdr(data, kind)
        # Whatever it makes of bytes that are not the message.
        except Exception as error:
            raise RecordingError(f"{self.path}: a message of type {kind} cannot be read: {error}") from error


def open_record(path: Path) -> Record:
    """Check all bytes of a record, and find its parts.

    Raises
    ------
    DamagedRecording
        If it is not what was written.
    RecordingError
        If there is no file, or it is not a record of this microscope.
    """
    try:
        with path.open("rb") as file:
            return _opened(path, file)
    except OSError as error:
        raise RecordingError(f"{path} is no readable recording: {error.strerror or error}") from error


def _opened(path: Path, file: Any) -> Record:
    number, size = file.fileno(), os.fstat(file.fileno()).st_size
    if os.pread(number, len(MCAP0_MAGIC), 0) != MCAP0_MAGIC:
        raise RecordingError(f"{path} is no readable recording: it is not an .mcap file")
    record, data_end = Record(path), None
    places = list(_walk(number, size))
    for place in places:
        if place.opcode == Opcode.CHUNK:
            record._chunks.append(place)
        elif place.opcode == Opcode.METADATA:
            found = _parsed(Metadata, number, place)
            if found.name == ABOUT:
                record.about = found.metadata
            elif found.name == END:
                record.end = found.metadata
        elif place.opcode == Opcode.DATA_END:
            data_end = place
    whole = bool(places) and places[-1].opcode == Opcode.FOOTER and places[-1].end + len(MCAP0_MAGIC) == size
    if data_end is None or not whole:
        record.end = None
        _check_chunks(record, file)
    elif not _is_unchanged(number, data_end, places[-1]):
        _check_chunks(record, file)
        raise DamagedRecording(f"{path} is damaged: bytes outside its chunks are not what was written")
    if not record.about:
        raise RecordingError(f"{path} is not a record of this microscope")
    record._checked = True
    return record


def _walk(file: int, size: int) -> Iterator[_Place]:
    """The records of a file up to where it breaks off."""
    at = len(MCAP0_MAGIC)
    while at + _HEAD.size <= size:
        opcode, length = _HEAD.unpack(os.pread(file, _HEAD.size, at))
        end = at + _HEAD.size + length
        if opcode not in _OPCODES or end > size:
            return
        yield _Place(opcode, at, end)
        if opcode == Opcode.FOOTER:
            return
        at = end


def _is_unchanged(file: int, data_end: _Place, footer: _Place) -> bool:
    expected = _parsed(DataEnd, file, data_end).data_section_crc
    summary = _parsed(Footer, file, footer)
    # The checksum of the summary covers the footer up to itself.
    ends = _crc(file, summary.summary_start or footer.begin, footer.end - 4) == summary.summary_crc
    return expected != 0 and ends and _crc(file, 0, data_end.begin) == expected


def _crc(file: int, begin: int, end: int) -> int:
    crc = 0
    while begin < end and (block := os.pread(file, min(_AT_ONCE, end - begin), begin)):
        crc = zlib.crc32(block, crc)
        begin += len(block)
    return crc


def _check_chunks(record: Record, file: Any) -> None:
    """Raise DamagedRecording if a chunk is not what was written."""
    bad = []
    for place in record._chunks:
        try:
            breakup_chunk(_chunk(file, place), validate_crc=True)
        except _ERRORS:
            bad.append(place)
    if bad:
        size = sum(place.end - place.begin for place in bad)
        raise DamagedRecording(
            f"{record.path} is damaged: bytes {bad[0].begin} to {bad[0].end} are not what was written ({size} bytes in "
            "all); `ros2 run afm_recorder_node repair` copies the rest"
        )


def _chunk(file: Any, place: _Place) -> Chunk:
    return _parsed(Chunk, file.fileno(), place)


def _parsed(kind: Any, file: int, place: _Place) -> Any:
    begin = place.begin + _HEAD.size
    return kind.read(ReadDataStream(BytesIO(os.pread(file, place.end - begin, begin))))
