"""How an .rrd file is cut into messages.

A file of rerun 0.41 is a header of 12 bytes, then messages: kind and length of the content, 8 bytes each,
little-endian, then the content. The message of kind 0 ends the file; its content is the index, and a footer follows it.
"""

import os
import struct
from collections.abc import Iterator
from typing import NamedTuple

HEADER = 12
MAGIC = b"RRF2"
MESSAGE = struct.Struct("<QQ")
END_KIND, STORE_KIND = 0, 1
FOOTER = struct.Struct("<QQI8sI")
"""Start and length of the index, its checksum, a mark, and the number of indices."""
FOOTER_MAGIC = b"RRF2FOOT"

END = MESSAGE.pack(END_KIND, 0)
"""Ends a file that has no index."""


class Message(NamedTuple):
    """Where a message stands in a file [bytes]."""

    kind: int
    start: int
    end: int


def split(stream: bytes) -> list[bytes]:
    """The messages of an encoded stream, without header and end, to be appended to other messages.

    Parameters
    ----------
    stream : bytes
        What a `rerun.BinaryStream` gave: each read of it is a stream of its own, with header, index and footer.
    """
    messages = []
    position = 0
    while position + MESSAGE.size <= len(stream):
        if stream.startswith(MAGIC, position):
            position += HEADER
            continue
        kind, length = MESSAGE.unpack_from(stream, position)
        after = position + MESSAGE.size + length
        if kind == END_KIND:
            after += FOOTER.size if length else 0
        else:
            messages.append(stream[position:after])
        position = after
    return messages


def walk(file: int, position: int = HEADER) -> Iterator[Message]:
    """The whole messages of an open file, up to its end or to where it breaks off; nothing if it is no .rrd file."""
    size = os.fstat(file).st_size
    if os.pread(file, len(MAGIC), 0) != MAGIC:
        return
    while len(head := os.pread(file, MESSAGE.size, position)) == MESSAGE.size:
        kind, length = MESSAGE.unpack(head)
        after = position + MESSAGE.size + length
        if after > size:
            return
        yield Message(kind, position, after)
        if kind == END_KIND:
            return
        position = after
