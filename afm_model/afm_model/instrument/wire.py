"""The messages of a peer, which compiled code reads and writes in place: the drive that came, the next measurement."""

from collections.abc import Callable
from typing import Annotated, Any

import numpy as np

from ..compiled.jit import kernel
from ..compiled.records import Array, Block, Integers, Record, Vector, place, record_at, size
from ..parts.header import BlockHeader, LawHeader
from ..parts.signals import Delivery, Measurement, PiezoDrive
from .block import LoopState

_HEAD, _NUMBERS = 6, size(Measurement)
_RUN, _SEQUENCE = 4, 5
"""Words of a head."""
_UNUSED = 4
"""Bytes before a message, and after a drive: CDR aligns from the fifth byte of a message on."""
_NANOSECONDS = 1_000_000_000


class Messages(Record):
    """Both in words of 8 bytes. Their heads: kind of encapsulation; stamp; frame_id with its length, in two words;
    run_id; sequence.
    """

    drive_head: Annotated[Integers, (_HEAD,)]
    voltage: Annotated[Vector, "V"]
    horizon: Annotated[Integers, (2,)]  # its period and length: all zero without one
    head: Annotated[Integers, (_HEAD,)]
    numbers: Annotated[Array, (_NUMBERS,)]


@kernel
def read_drive(law: Block, m: Block) -> bool:
    """Command the drive that came, if `law` is a peer; False if it is not the plain answer to the measurement sent."""
    at = record_at(law, 0, LawHeader).messages
    if at == 0:
        return True
    w = record_at(law, at, Messages)
    g = record_at(m, 0, BlockHeader)
    if w.head[_SEQUENCE] != record_at(m, g.loop, LoopState).k or (w.horizon[0] | w.horizon[1]) != 0:
        return False
    for i in range(_HEAD):
        if w.drive_head[i] != w.head[i] and (i != _RUN or w.drive_head[i] != 0):
            return False
    u = record_at(m, g.commanded, PiezoDrive)
    u.sequence, u.horizon_count = w.head[_SEQUENCE], 0
    for axis in range(3):
        u.voltage[axis] = w.voltage[axis]
    return True


@kernel
def write_measurement(law: Block, m: Block) -> None:
    """Write the measurement of the next tick, if `law` is a peer; with sequence -1 if a fault has lost it."""
    at = record_at(law, 0, LawHeader).messages
    if at == 0:
        return
    w = record_at(law, at, Messages)
    g = record_at(m, 0, BlockHeader)
    c = record_at(m, g.loop, LoopState)
    stamp = round(c.k * c.period_ns)
    w.head[1] = stamp // _NANOSECONDS | stamp % _NANOSECONDS << 32
    w.head[_SEQUENCE] = c.k if record_at(m, g.delivery, Delivery).lost == 0.0 else -1
    for i in range(_NUMBERS):
        w.numbers[i] = m[g.measurement + i]


class Wire:
    """Messages of a peer in place.

    Parameters
    ----------
    take : callable
        take(): the oldest message not yet taken, its bytes first; None if no message is left.
    publish : callable
        publish(data): send the bytes of a message.

    Attributes
    ----------
    block : ndarray
        Stands where compiled code takes the block of a law.
    drive, measurement : memoryview
        Bytes of the messages: the drive that came last; the measurement that was sent last, or is to be sent.
    sequence : memoryview
        One number, the sequence of `measurement`.
    """

    def __init__(self, take: Callable[[], tuple[bytes, Any] | None], publish: Callable[[bytes], None]) -> None:
        self.take, self.publish = take, publish
        at = size(LawHeader)
        self.block = np.zeros(at + size(Messages))
        words: Any = memoryview(self.block.view(np.int64))  # type: ignore[arg-type]  # an array is a buffer
        words[place(LawHeader, "messages")] = at
        head = at + place(Messages, "head")
        self.drive = words[at:head].cast("B")[_UNUSED:-_UNUSED]
        self.measurement = words[head:].cast("B")[_UNUSED:]
        self.sequence = words[head + _SEQUENCE : head + _SEQUENCE + 1]
