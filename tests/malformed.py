"""Bytes that are no message of the control loop, and a reader of their own to judge them by."""

import random
import struct

import numpy as np
from afm_msgs.msg import Measurement, PiezoDrive

from afm_model.compiled import records
from afm_model.parts import signals

SIZE = {PiezoDrive: 3, Measurement: records.size(signals.Measurement)}
"""Numbers in a message without a horizon."""


def read(data: bytes, kind: type) -> tuple[int, int, int, bytes] | None:
    """run_id, sequence, stamp [ns] and the bytes of the values, by the rules of CDR alone; None: it is no message."""
    size = SIZE[kind]
    order = {b"\0\1": "<", b"\0\0": ">"}.get(data[:2])
    if order is None or len(data) < 16:
        return None
    seconds, nanoseconds, length = struct.unpack_from(f"{order}iII", data, 4)
    at = 4 + -(-(12 + length) // 8) * 8
    end = at + 16 + 8 * size
    if length < 1 or len(data) < end or seconds < 0 or nanoseconds >= 10**9:
        return None
    if kind is PiezoDrive:  # a horizon, aligned to 8 if it holds anything
        if len(data) < end + 12:
            return None
        count = struct.unpack_from(f"{order}I", data, end + 8)[0]
        if count > signals.LONGEST_HORIZON:
            return None
        end += 16 + 24 * count if count else 12
    if len(data) != end:
        return None
    frame = data[16 : 16 + length]
    try:
        frame.decode()
    except UnicodeDecodeError:
        return None
    if frame.find(b"\0") != length - 1:
        return None
    values = np.frombuffer(data, f"{order}f8", size, at + 16).astype("<f8").tobytes()
    return *struct.unpack_from(f"{order}QQ", data, at), seconds * 10**9 + nanoseconds, values


def message(rng: random.Random, kind: type) -> bytes:
    """A message as somebody may write it who keeps the rules: any frame, either order of bytes."""
    size = SIZE[kind]
    order, label = rng.choice([("<", b"\0\1"), ("<", b"\0\1"), ("<", b"\0\1"), (">", b"\0\0")])
    frame = (
        rng.choice(["scanner", "scanner", "", "map", "\u00e5ngstr\u00f6m", "x" * rng.randrange(300)]).encode() + b"\0"
    )
    head = struct.pack(f"{order}iII", rng.randrange(2**31), rng.randrange(10**9), len(frame)) + frame
    body = struct.pack(
        f"{order}QQ{size}d", rng.randrange(2**64), rng.randrange(2**64), *(rng.gauss(0.0, 1.0) for _ in range(size))
    )
    if kind is PiezoDrive:
        count = rng.choice([0, 0, 0, 1, 3])
        body += struct.pack(f"{order}dI", 1e-6, count)
        body += struct.pack(f"{order}4x{3 * count}d", *(rng.random() for _ in range(3 * count))) if count else b""
    return label + b"\0\0" + head + rng.randbytes(-len(head) % 8) + body


def spoiled(rng: random.Random, data: bytes) -> bytes:
    """The message with something wrong in it, as a rule; sometimes what comes out is one again."""
    out = bytearray(data)
    kind = rng.randrange(9)
    if kind == 0:
        return data[: rng.randrange(len(data))]
    if kind == 1:
        return data + rng.randbytes(rng.randrange(1, 40))
    if kind == 2:
        return rng.randbytes(rng.randrange(120))
    if kind == 3:  # any byte, the first ones more often
        for _ in range(rng.randrange(1, 4)):
            out[min(rng.randrange(len(out)), rng.randrange(len(out)))] = rng.randrange(256)
    elif kind == 4:  # a stamp out of range
        struct.pack_into("<iI", out, 4, *rng.choice([(-1, 0), (-(2**31), 5), (3, 10**9), (3, 2**32 - 1)]))
    elif kind == 5:  # a length of the frame that is not its own
        struct.pack_into("<I", out, 12, rng.choice([0, 1, 7, 9, 300, 2**31, 2**32 - 1, rng.randrange(2**32)]))
    elif kind == 6 and len(out) > 17:  # no UTF-8, or a zero in the text
        out[16 + rng.randrange(min(8, len(out) - 16))] = rng.choice([0, 0xFF, 0xC0, 0xED])
    elif kind == 7:  # other kinds of encapsulation, with and without options
        out[:4] = rng.choice([b"\0\0", b"\0\2", b"\0\3", b"\0\7", b"\0\x0b", b"\xff\xff", b"\0\1"]) + rng.randbytes(2)
    else:  # a piece is missing, or there twice
        at, length = rng.randrange(len(out)), rng.randrange(1, 12)
        out[at : at + length] = b"" if rng.random() < 0.5 else out[at : at + length] * 2
    return bytes(out)


def nonsense(rng: random.Random, kind: type) -> bytes:
    """Bytes that are no message, whatever happens."""
    while True:
        data = spoiled(rng, message(rng, kind))
        if read(data, kind) is None:
            return data
