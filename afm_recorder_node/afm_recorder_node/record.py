"""Reads a record: checks its bytes, and gives its messages. Needs no ROS: the definitions stand in the file."""

import os
import struct
import zlib
from collections.abc import Collection, Iterator
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, DataEnd, Footer, Message, Metadata, Schema
from mcap.stream_reader import CRCValidationError, breakup_chunk
from mcap.writer import MCAP0_MAGIC
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from afm_model.core.errors import reason
from afm_model.core.shown import shown

from .record_writer import ABOUT, CHECKSUM, END, checksum
from .recording import DamagedRecording, RecordingError

_HEAD = struct.Struct("<BQ")
_AT_ONCE = 1 << 24
_LARGEST = 1 << 28
"""Bytes of a chunk that is unpacked; a recorder makes chunks of some MB."""
_OPCODES = frozenset(int(each) for each in Opcode)
_ERRORS = (
    *(McapError, CRCValidationError, zstandard.ZstdError),
    *(struct.error, ValueError, KeyError, EOFError, OSError, MemoryError, OverflowError),
)
"""What the libraries raise for bytes that are not a record of their format."""
_NO_END = "it has no end: its recorder is still at work, or was killed"


class NotOurs(RecordingError):
    """An MCAP file that no recorder of this package has written, such as that of a bag."""


class RecordEntry(NamedTuple):
    """A message of a record."""

    topic: str  # within the namespace of the instrument
    kind: str  # type, such as afm_msgs/msg/Waveform
    time_ns: int  # simulated
    message: Any  # with the fields of its definition


class Raw(NamedTuple):
    """The same as it stands in the file."""

    topic: str
    kind: str
    definition: str
    time_ns: int
    received_ns: int  # wall time
    data: bytes


class _Place(NamedTuple):
    """A record of the format in the file."""

    opcode: int
    begin: int
    end: int


@dataclass
class RunRecord:
    """The messages of one run, in a file that has been checked; see `open_record`."""

    path: Path
    about: dict[str, str] = field(default_factory=dict)
    """What was known at the begin."""
    end: dict[str, str] | None = None
    """What was known at the end; None: the record has broken off, or still grows."""
    damaged: int = 0
    """Bytes that are left out because they are not what was written."""
    _chunks: list[_Place] = field(default_factory=list)
    _read_to: int = len(MCAP0_MAGIC)
    _indexed: bool = False  # whether the types of all messages are known before the chunks are read
    _schemas: dict[int, Schema] = field(default_factory=dict)
    _channels: dict[int, Channel] = field(default_factory=dict)
    _types: dict[int, Typestore] = field(default_factory=dict)  # by schema

    @property
    def missing(self) -> str:
        """Why it is not complete; empty if it is."""
        return _NO_END if self.end is None else shown(self.end.get("missing", ""))

    def messages(
        self, topics: Collection[str] | None = None, begin_ns: int = 0, end_ns: int = 2**63
    ) -> Iterator[RecordEntry]:
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
        yield from map(self._entry, self._raw(topics, begin_ns, end_ns))

    def more(self) -> Iterator[RecordEntry]:
        """Yield the messages that have come into a growing file since the last call. `Record(path)` begins it.

        Raises
        ------
        RecordingError
            If something in it is not what was written.
        """
        with self.path.open("rb") as opened:
            file = opened.fileno()
            for place in _places(file, os.fstat(file).st_size, self._read_to)[0]:
                self._read_to = place.end
                if place.opcode == Opcode.CHUNK:
                    if _numbers(file, place) is None:
                        raise DamagedRecording(f"{self.path} is damaged: bytes {place.begin} to {place.end}")
                    yield from map(self._entry, self._unpacked(file, place))
                elif place.opcode == Opcode.METADATA:
                    self.note(_parsed(Metadata, file, place))

    def _entry(self, raw: tuple[Channel, Schema, Message]) -> RecordEntry:
        channel, schema, message = raw
        try:
            read = self._types[schema.id].deserialize_cdr(message.data, schema.name)
        # Whatever it makes of bytes that are not the message.
        except Exception as error:
            raise RecordingError(f"{self.path}: a {schema.name} cannot be read: {error}") from error
        return RecordEntry(channel.topic, schema.name, message.log_time, read)

    def raw(self) -> Iterator[Raw]:
        """Yield the messages as they stand in the file."""
        for channel, schema, message in self._raw():
            definition = schema.data.decode(errors="replace")
            yield Raw(channel.topic, schema.name, definition, message.log_time, message.publish_time, message.data)

    def _raw(
        self, topics: Collection[str] | None = None, begin_ns: int = 0, end_ns: int = 2**63
    ) -> Iterator[tuple[Channel, Schema, Message]]:
        with self.path.open("rb") as file:
            for place in self._chunks_in(file.fileno(), begin_ns, end_ns):
                for each in self._unpacked(file.fileno(), place):
                    if topics is None or each[0].topic in topics:
                        yield each

    def _unpacked(self, file: int, place: _Place) -> Iterator[tuple[Channel, Schema, Message]]:
        try:
            records = breakup_chunk(_chunk(file, place))
        except _ERRORS as error:
            raise DamagedRecording(f"{self.path} is damaged: {error}") from error
        for each in records:
            if isinstance(each, Message):
                channel = self._channels[each.channel_id]
                yield channel, self._schemas[channel.schema_id], each
            else:
                self.learn(each)

    def _chunks_in(self, file: int, begin_ns: int, end_ns: int) -> Iterator[_Place]:
        before: _Place | None = None
        for place in self._chunks:
            first, last = struct.unpack("<QQ", os.pread(file, 16, place.begin + _HEAD.size))
            if self._indexed and last < begin_ns:
                before = place  # its last blocks may reach beyond it
                continue
            if before is not None:
                yield before
                before = None
            if not self._indexed or first <= end_ns:
                yield place
        if before is not None:
            yield before

    def note(self, found: Metadata) -> None:
        """Take what is known of the run. Raises DamagedRecording."""
        if found.name == ABOUT:
            about = {name: value for name, value in found.metadata.items() if name != CHECKSUM}
            if found.metadata.get(CHECKSUM) != checksum(about):
                raise DamagedRecording(f"{self.path} is damaged: what it says of its run is not what was written")
            self.about = about
        elif found.name == END:
            self.end = found.metadata

    def learn(self, record: object) -> None:
        """Take the type of a message, or the topic that has it."""
        if isinstance(record, Channel):
            self._channels[record.id] = record
        elif isinstance(record, Schema) and record.id not in self._schemas:
            self._schemas[record.id] = record
            try:
                self._types[record.id] = _types_in(record.data.decode(), record.name)
            # What the parser makes of a text that is no definition is of any kind.
            except Exception as error:
                raise RecordingError(f"{self.path}: the definition of {record.name} cannot be read: {error}") from error


@lru_cache(64)
def _types_in(definition: str, name: str) -> Typestore:
    """The types of a definition: to parse it and to make their readers takes 10 ms."""
    types = Typestore()
    types.register(get_types_from_msg(definition, name))
    return types


def open_record(path: Path, *, salvage: bool = False) -> RunRecord:
    """Check all bytes of a record, and find its parts.

    Parameters
    ----------
    path : Path
    salvage : bool
        Leave out what is not what was written, in place of raising.

    Raises
    ------
    DamagedRecording
        If it is not what was written.
    NotOurs
        If it is the file of another program.
    RecordingError
        If there is no file, or it is not an MCAP file.
    """
    try:
        with path.open("rb") as file:
            return _opened(path, file.fileno(), salvage)
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f"{path} is no readable recording: {reason(error)}") from error
    except _ERRORS as error:
        raise DamagedRecording(f"{path} is damaged: {error}") from error


def _opened(path: Path, file: int, salvage: bool) -> RunRecord:
    size = os.fstat(file).st_size
    magic = os.pread(file, len(MCAP0_MAGIC), 0)
    if magic != MCAP0_MAGIC[: len(magic)]:
        raise RecordingError(f"{path} is no readable recording: it is not an .mcap file")
    record = RunRecord(path)
    places, broken = _places(file, size)
    closed = _is_closed(file, size)
    whole = closed and not broken and places[-1].opcode == Opcode.FOOTER
    unchanged = whole and _is_unchanged(file, places)
    chunks = [each for each in places if each.opcode == Opcode.CHUNK]
    bad, between = ([], 0) if unchanged else _damage(file, chunks)
    if (bad or between or broken or (closed and not unchanged)) and not salvage:
        what = f"bytes {bad[0].begin} to {bad[0].end}" if bad else "what stands between its messages"
        raise DamagedRecording(
            f"{path} is damaged: {what} is not what was written; `ros2 run afm_recorder_node repair` copies the rest"
        )
    record.damaged = sum(each.end - each.begin for each in bad) + (between + broken if salvage else 0)
    record._indexed = bool(unchanged)
    record._chunks = [each for each in chunks if each not in bad]
    for place in places:
        if place.opcode == Opcode.METADATA:
            with suppress(*_ERRORS) if salvage else nullcontext():
                record.note(_parsed(Metadata, file, place))
        elif unchanged and place.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            record.learn(_parsed(Schema if place.opcode == Opcode.SCHEMA else Channel, file, place))
    if not whole:
        record.end = None
    if not record.about and not (salvage and record._chunks):
        if not size or (not closed and not record._chunks):
            raise RecordingError(f"{path} is no readable recording: nothing stands in it yet")
        raise NotOurs(f"{path} is no readable recording: it is not a record of this microscope")
    return record


def _is_closed(file: int, size: int) -> bool:
    """Whether a file ends as one that was written to its end."""
    return size > 2 * len(MCAP0_MAGIC) and os.pread(file, len(MCAP0_MAGIC), size - len(MCAP0_MAGIC)) == MCAP0_MAGIC


def _places(file: int, size: int, at: int = len(MCAP0_MAGIC)) -> tuple[list[_Place], int]:
    """Return the records of a file from a place up to where it breaks off, and how many bytes after it are no records.

    A file may end within a record: its recorder was killed, or writes it at this moment.
    """
    found, broken = list[_Place](), 0
    while at + _HEAD.size <= size:
        opcode, length = _HEAD.unpack(os.pread(file, _HEAD.size, at))
        end = at + _HEAD.size + length
        if opcode not in _OPCODES:
            broken = size - at
            break
        if end > size:
            break
        found.append(_Place(opcode, at, end))
        if opcode == Opcode.FOOTER:
            return found, 0
        at = end
    # Behind a length that has changed the index still knows where the chunks are.
    tail = _HEAD.size + 20 + len(MCAP0_MAGIC)
    if size > tail and _is_closed(file, size) and os.pread(file, 1, size - tail) == bytes([Opcode.FOOTER]):
        try:
            return found + _indexed_chunks(file, size, tail, at), size - at
        except _ERRORS:
            pass
    return found, broken


def _indexed_chunks(file: int, size: int, tail: int, after: int) -> list[_Place]:
    footer = _parsed(Footer, file, _Place(Opcode.FOOTER, size - tail, size - len(MCAP0_MAGIC)))
    at, found = footer.summary_start, list[_Place]()
    while after < at < size - tail:
        opcode, length = _HEAD.unpack(os.pread(file, _HEAD.size, at))
        place = _Place(opcode, at, at + _HEAD.size + length)
        if opcode == Opcode.CHUNK_INDEX:
            index = _parsed(ChunkIndex, file, place)
            begin, end = index.chunk_start_offset, index.chunk_start_offset + index.chunk_length
            if begin >= after and end <= size:
                found.append(_Place(Opcode.CHUNK, begin, end))
        at = place.end
    return sorted(found)


def _is_unchanged(file: int, places: list[_Place]) -> bool:
    ends = [each for each in places if each.opcode == Opcode.DATA_END]
    if not ends:
        return False
    expected, footer = _parsed(DataEnd, file, ends[0]).data_section_crc, places[-1]
    summary = _parsed(Footer, file, footer)
    # The checksum of the summary covers the footer up to itself.
    begin = summary.summary_start or footer.begin
    summed = begin == ends[0].end and _crc(file, begin, footer.end - 4) == summary.summary_crc
    return expected != 0 and summed and _crc(file, 0, ends[0].begin) == expected


def _crc(file: int, begin: int, end: int) -> int:
    crc = 0
    while begin < end and (block := os.pread(file, min(_AT_ONCE, end - begin), begin)):
        crc = zlib.crc32(block, crc)
        begin += len(block)
    return crc


def _damage(file: int, chunks: list[_Place]) -> tuple[list[_Place], int]:
    """Chunks that are not what was written, and bytes between chunks where others have been."""
    bad, between, following, end = list[_Place](), 0, 0, 0
    for place in chunks:
        numbers = _numbers(file, place)
        if numbers is None:
            bad.append(place)
            following = -1  # not known
        elif numbers:
            if following not in (-1, numbers[0]):
                between += place.begin - end
            following = numbers[-1] + 1
        end = place.end
    return bad, between


def _numbers(file: int, place: _Place) -> list[int] | None:
    """Numbers of the messages in a chunk, without a gap in the whole record; None: it is not what was written."""
    try:
        records = breakup_chunk(_chunk(file, place), validate_crc=True)
    except _ERRORS:
        return None
    return [each.sequence for each in records if isinstance(each, Message)]


def _chunk(file: int, place: _Place) -> Chunk:
    """A chunk; ValueError if it says that it is larger than any that a recorder makes."""
    chunk: Chunk = _parsed(Chunk, file, place)
    if chunk.compression != "zstd" or not chunk.uncompressed_crc:
        raise ValueError("a chunk has no checksum, or another compression than zstd")
    sizes = (chunk.uncompressed_size, zstandard.frame_content_size(chunk.data))
    if max(sizes) > _LARGEST or sizes[1] < 0:
        raise ValueError(f"a chunk of {max(sizes)} bytes: at most {_LARGEST} are allowed")
    return chunk


def _parsed(kind: Any, file: int, place: _Place) -> Any:
    begin = place.begin + _HEAD.size
    return kind.read(ReadDataStream(BytesIO(os.pread(file, place.end - begin, begin))))
