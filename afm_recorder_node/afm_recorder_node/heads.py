"""What stands in front of every message, read in place: the time, the run, and of a block its numbers."""

import math
import struct
from typing import NamedTuple

from afm_node_common.cdr import LITTLE_ENDIAN_CDR
from afm_node_common.decoding import NANOSECONDS, InvalidMessage

from . import checks

_BLOCK = struct.Struct("<QdI")
_COUNT = struct.Struct("<I")


class MessageHead(NamedTuple):
    """Time and run of a message; of a block its numbers, and the unit of its samples."""

    time_ns: int
    run_id: int
    first: int = 0
    count: int = 0  # type: ignore[assignment]
    unit: str = ""


def head(data: bytes) -> tuple[MessageHead, int]:
    """Return the head of a message that begins with a header and run_id, and where its other fields begin.

    Raises
    ------
    InvalidMessage
        If the bytes are not such a message, or its time is not a time of a run.
    """
    try:
        seconds, nanoseconds, length = struct.unpack_from("<iII", data, 4)
        at = _aligned(16 + length, 8)
        (run_id,) = struct.unpack_from("<Q", data, at)
        data[16 : 16 + length].decode()
    except struct.error:
        raise InvalidMessage(f"{len(data)} bytes are too short for a message") from None
    except UnicodeDecodeError:
        raise InvalidMessage("frame_id is not text") from None
    if data[:2] != LITTLE_ENDIAN_CDR:
        raise InvalidMessage(f"the bytes begin with 0x{data[:2].hex()}: plain CDR begins with 0x0001")
    if seconds < 0 or nanoseconds >= NANOSECONDS:
        raise InvalidMessage(f"stamp {seconds} s + {nanoseconds} ns: it must be a time since the start")
    return MessageHead(seconds * NANOSECONDS + nanoseconds, run_id), at + 8


def waveform(data: bytes) -> MessageHead:
    """Return the head of an afm_msgs/Waveform that is whole and can be placed in time. Raises InvalidMessage."""
    found, at = head(data)
    first, period, count = _block(data, at)
    at = _aligned(at + _BLOCK.size, 8) + 8 * count
    try:
        scale, length = struct.unpack_from("<dI", data, at)
        (unit,) = struct.unpack_from(f"{length}s", data, at + 12)
    except struct.error:
        raise InvalidMessage(f"{len(data)} bytes are too short for {count} samples") from None
    _ends(data, at + 12 + length)
    if not math.isfinite(scale) or scale == 0.0:
        raise InvalidMessage(f"scale {scale:g}: it must be finite and not 0")
    text = unit[:-1].decode(errors="replace")
    checks.check_unit(text)
    return _placed(found, "first_sample", first, period, count)._replace(unit=text)


def control_trace(data: bytes) -> MessageHead:
    """Return the head of an afm_msgs/ControlTrace that is whole and can be placed in time. Raises InvalidMessage."""
    found, at = head(data)
    first, period, values = _block(data, at)
    count, rest = divmod(values, 3)
    if rest:
        raise InvalidMessage(f"{values} values of position: it must be x, y, z of each tick")
    at += _BLOCK.size - _COUNT.size
    for name, width, size in (
        ("position", 3, 8),
        ("velocity", 3, 8),
        ("reference_position", 3, 8),
        ("deflection", 1, 8),
        ("drive", 3, 8),
        ("round_trip", 1, 4),
    ):
        at = _aligned(at, 4)
        try:
            given = int(_COUNT.unpack_from(data, at)[0])
        except struct.error:
            raise InvalidMessage(f"{len(data)} bytes are too short for {count} ticks") from None
        if given != width * count:
            raise InvalidMessage(f"{given} values of {name} with {count} ticks: it must be {width * count}")
        at = _aligned(at + _COUNT.size, size) + size * given
    _ends(data, at)
    return _placed(found, "first_sequence", first, period, count)


def _block(data: bytes, at: int) -> tuple[int, float, int]:
    try:
        first, period, count = _BLOCK.unpack_from(data, at)
    except struct.error:
        raise InvalidMessage(f"{len(data)} bytes are too short for a block") from None
    return first, period, count


def _ends(data: bytes, at: int) -> None:
    # The middleware may pad a message to a multiple of four bytes.
    if not at <= len(data) < at + 4:
        raise InvalidMessage(f"{len(data)} bytes for a message of {at}")


def _placed(found: MessageHead, name: str, first: int, period: float, count: int) -> MessageHead:
    """Check that a block can stand where its numbers say: its stamp must be the time of its first value."""
    if not found.run_id:
        raise InvalidMessage("run_id 0: it must be that of a run")
    if not count:
        raise InvalidMessage("it holds no values")
    checks.block(first, period, count, name)
    stamp, time = found.time_ns * 1e-9, first * period
    if abs(stamp - time) > max(period, 1e-6) + 1e-9 * time:
        raise InvalidMessage(f"stamp {stamp:g} s of {name} {first} at a period of {period:g} s: it must be {time:g} s")
    return found._replace(first=first, count=count)


def _aligned(at: int, size: int) -> int:
    """CDR aligns from the fifth byte of a message on."""
    return at + -(at - 4) % size
