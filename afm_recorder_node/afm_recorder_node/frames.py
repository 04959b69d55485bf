"""How an .rrd file is cut into messages, so that one that breaks off can be read up to its last whole message.

A file of rerun 0.41 is a header of 12 bytes, then messages: kind and length of the content, 8 bytes each,
little-endian, then the content. The message of kind 0 ends the file; behind its content, the index, stands a footer.
"""

import os
import struct
from typing import BinaryIO

HEADER = 12
_MAGIC = b"RRF2"
_MESSAGE = struct.Struct("<QQ")
_END = 0
_FOOTER, _FOOTER_MAGIC = 32, b"RRF2FOOT"

END = _MESSAGE.pack(_END, 0)
"""Ends a file that has no index."""


def without_ends(stream: bytes) -> bytes:
    """The messages of an encoded stream, without header and end, to be appended to other messages.

    Parameters
    ----------
    stream : bytes
        What a `rerun.BinaryStream` gave: each read of it is a stream of its own, with header, index and footer.
    """
    messages = []
    position = 0
    while position + _MESSAGE.size <= len(stream):
        if stream.startswith(_MAGIC, position):
            position += HEADER
            continue
        kind, length = _MESSAGE.unpack_from(stream, position)
        after = position + _MESSAGE.size + length
        if kind == _END:
            after += _FOOTER if length else 0
        else:
            messages.append(stream[position:after])
        position = after
    return b"".join(messages)


def measure(file: BinaryIO) -> tuple[int, bool]:
    """How far a file can be read.

    Parameters
    ----------
    file : binary file, open for reading

    Returns
    -------
    (int, bool)
        Bytes from the begin up to the end of the last whole message; whether the file is complete: its end is there.
        0 bytes if it is no .rrd file.
    """
    size = os.fstat(file.fileno()).st_size
    if size < HEADER or os.pread(file.fileno(), len(_MAGIC), 0) != _MAGIC:
        return 0, False
    position = HEADER
    while position + _MESSAGE.size <= size:
        kind, length = _MESSAGE.unpack(os.pread(file.fileno(), _MESSAGE.size, position))
        after = position + _MESSAGE.size + length
        if kind == _END:
            if not length:
                return position, after == size
            footer = os.pread(file.fileno(), _FOOTER, after)
            return position, len(footer) == _FOOTER and _FOOTER_MAGIC in footer
        if after > size:
            break
        position = after
    return position, False
