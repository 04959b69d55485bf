"""Checksums of a recording, by which every changed byte of its file is found. Needs neither ROS nor rerun.

A **seal** is a message that repeats the description of the recording, as rerun itself does, with one more field of
Protocol Buffers. Readers pass over fields that they do not know; this one holds the crc32 of every message since the
seal before it. The first seal covers the header too. The last one stands before the end of the file, and holds the
crc32 of everything behind it. The writer seals each flush, so that what a killed recorder has left can be checked.
"""

import os
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field

from .frames import END_KIND, FOOTER, FOOTER_MAGIC, HEADER, MESSAGE, STORE_KIND, Message, walk

_FIELD = b"\xca\xb5\x03"  # number 7001, a length and as many bytes
_TAIL = struct.Struct("<III8s")  # number of checksums, that of the rest, that of the seal up to here, the mark
_MARK = b"AFMCRC32"
_READ_AT_ONCE = 1 << 20


@dataclass
class Extent:
    """How far a file can be read, and what of it has changed since it was written."""

    whole: int = 0
    """Bytes from the begin up to the end of the last message to be read; 0: it is no .rrd file."""
    complete: bool = False
    """Whether the end of the file is there."""
    sealed: bool = False
    """Whether it has checksums: older recordings have none."""
    damaged: list[tuple[int, int]] = field(default_factory=list)
    """Changed messages: begin and end [bytes]."""


def seal(carrier: bytes, parts: Sequence[bytes], rest: bytes = b"") -> bytes:
    """A message that is to stand behind these parts of a file.

    Parameters
    ----------
    carrier : bytes
        Message of the file that describes the recording.
    parts : sequence of bytes
        Everything since the seal before: messages, at the begin of the file its header.
    rest : bytes
        All that will follow up to the end of the file; empty: more messages.
    """
    return _seal(carrier, [zlib.crc32(part) for part in parts], zlib.crc32(rest))


def _seal(carrier: bytes, checksums: Sequence[int], rest: int) -> bytes:
    length = 4 * len(checksums) + _TAIL.size
    content = carrier[MESSAGE.size :] + _FIELD + _varint(length) + struct.pack(f"<{len(checksums)}I", *checksums)
    content += struct.pack("<II", len(checksums), rest)
    message = MESSAGE.pack(STORE_KIND, len(content) + _TAIL.size - 8) + content
    return message + struct.pack("<I8s", zlib.crc32(message), _MARK)


def _varint(number: int) -> bytes:
    groups = []
    while number > 0x7F:
        groups.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*groups, number])


def seal_file(file: int) -> None:
    """Put a seal before the end of a file that rerun has written, and adapt its footer.

    Raises
    ------
    OSError
        If it has another form than expected, or cannot be written.
    """
    *messages, end = walk(file)
    rest = _read(file, end.start, os.fstat(file).st_size)
    carrier = next(_read(file, *message[1:]) for message in messages if message.kind == STORE_KIND)
    checksums = [_checksum(file, 0, HEADER), *(_checksum(file, *message[1:]) for message in messages)]
    start, *others = FOOTER.unpack(rest[-FOOTER.size :])
    if end.kind != END_KIND or start != end.start + MESSAGE.size or FOOTER_MAGIC not in others:
        raise OSError("the footer of the file is not that of this version of rerun")
    shift = len(_seal(carrier, checksums, 0))
    rest = rest[: -FOOTER.size] + FOOTER.pack(start + shift, *others)
    written = _seal(carrier, checksums, zlib.crc32(rest)) + rest
    done = 0
    while done < len(written):
        done += os.pwrite(file, memoryview(written)[done:], end.start + done)


def measure(file: int) -> Extent:
    """Read an open file from begin to end, and check it.

    Returns
    -------
    Extent
        Of a sealed file that breaks off, up to its last seal.
    """
    size = os.fstat(file).st_size
    extent, since, rest = Extent(), [Message(-1, 0, HEADER)], 0
    last = Message(-1, 0, 0)
    for last in walk(file):
        if last.kind == END_KIND:
            break
        found = _read_seal(file, last) if last.kind == STORE_KIND else None
        if found is None:
            since.append(last)
            if not extent.sealed:
                extent.whole = last.end
            continue
        checksums, rest = found
        if len(checksums) != len(since):
            # The seal itself has changed, or messages are missing: nothing tells which.
            extent.damaged.append(last[1:])
        else:
            extent.damaged += [m[1:] for m, c in zip(since, checksums, strict=True) if _checksum(file, *m[1:]) != c]
        extent.sealed, extent.whole, since = True, last.end, []
    if last.kind == END_KIND:
        extent.complete = not (extent.sealed and since) and _ends(file, last, size)
        if extent.complete and extent.sealed and _checksum(file, last.start, size) != rest:
            extent.damaged.append((last.start, size))
    return extent


def _ends(file: int, end: Message, size: int) -> bool:
    footer = os.pread(file, FOOTER.size, end.end)
    index = end.end - end.start > MESSAGE.size
    return len(footer) == FOOTER.size and FOOTER_MAGIC in footer if index else end.end == size


def _read_seal(file: int, message: Message) -> tuple[Sequence[int], int] | None:
    """Checksums of a seal, and that of the rest; None if the message is none. No checksums if the seal has changed."""
    content = _read(file, *message[1:])
    if not content.endswith(_MARK):
        return None
    count, rest, own, _ = _TAIL.unpack(content[-_TAIL.size :])
    begin = len(content) - _TAIL.size - 4 * count
    if zlib.crc32(content[: -len(_MARK) - 4]) != own or begin < 0:
        return (), 0
    return struct.unpack_from(f"<{count}I", content, begin), rest


def _read(file: int, start: int, end: int) -> bytes:
    return os.pread(file, end - start, start)


def _checksum(file: int, start: int, end: int) -> int:
    value = 0
    while start < end and (block := os.pread(file, min(end - start, _READ_AT_ONCE), start)):
        value = zlib.crc32(block, value)
        start += len(block)
    return value
