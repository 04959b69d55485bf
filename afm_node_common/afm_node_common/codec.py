"""Messages between arrays and the bytes on the wire, without rclpy's typed messages in between.

Measurement and PiezoDrive, of which every control tick has one each: both are a header, a sequence number and then
float64 values only, so their CDR encoding is a fixed layout once the length of frame_id is known. Reading and writing
it in place costs about a microsecond where rclpy's typed messages cost tens. `BlockEncoder` writes the long messages
for recorders. The bytes are those of rclpy's own serializer (padding apart), which is checked when a codec is made: any
ordinary subscriber sees normal messages, and any ordinary publisher is understood.
"""

import array
import struct
from functools import partial
from typing import Any

import numpy as np
from afm_msgs.msg import Measurement, PiezoDrive
from geometry_msgs.msg import Vector3
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message

from afm_model import signals
from afm_model.records import size

from .topics import FRAME

_NANOSECONDS = 1_000_000_000
_LITTLE_ENDIAN_CDR = b"\x00\x01"
_PLAIN = {"uint64": "<Q", "double": "<d"}
_SEQUENCES = {"sequence<double>": "d", "sequence<float>": "f"}
_LONGEST_FRAME = 256
"""frame_id beyond which a message is left to rclpy's serializer [bytes]."""


class _Layout:
    """Where things stand in a message whose frame_id takes `length` bytes, its final zero included."""

    def __init__(self, length: int, size: int) -> None:
        # CDR aligns to 8 counted from behind the encapsulation.
        padding = -(12 + length) % 8
        self.length = length
        # Kind of encapsulation, stamp.sec, stamp.nanosec, length of frame_id, (frame_id), sequence.
        self.head = struct.Struct(f"<2s2xiII{length}x{padding}xQ")
        sequence = self.head.size - 8
        self.padding = slice(sequence - padding, sequence)
        self.body = slice(self.head.size, self.head.size + 8 * size)


def body(message: Any) -> list[float]:
    """The float64 values of a message after its sequence number, in order."""
    values: list[float] = []
    for name in list(message.get_fields_and_field_types())[2:]:
        value = getattr(message, name)
        values.extend([value.x, value.y, value.z] if isinstance(value, Vector3) else [value])
    return values


def fill(message: Any, sequence: int, stamp_ns: int, values: NDArray[np.float64]) -> None:
    """The inverse of `body`, with header and sequence."""
    message.header.frame_id = FRAME
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, _NANOSECONDS)
    message.sequence = sequence
    at = 0
    for name in list(message.get_fields_and_field_types())[2:]:
        if isinstance(getattr(message, name), Vector3):
            x, y, z = (float(v) for v in values[at : at + 3])
            setattr(message, name, Vector3(x=x, y=y, z=z))
            at += 3
        else:
            setattr(message, name, float(values[at]))
            at += 1


class Codec:
    """Encoder and decoder of one message type.

    Parameters
    ----------
    message_type : type
        A message of header, sequence and float64 values (or vectors of them) only.
    size : int
        Number of those values.
    fast : bool
        False: go through rclpy's serializer each time. The bytes are the same.
    """

    def __init__(self, message_type: type, size: int, *, fast: bool = True) -> None:
        self._type = message_type
        self._size = size
        self.fast = True
        """Whether messages are read and written in place; False: through rclpy's serializer, tens of times slower."""
        # In: the layout of the message before; most have the same.
        self._layouts = {length: _Layout(length, size) for length in range(1, _LONGEST_FRAME + 2)}
        self._layout = layout = self._layouts[len(FRAME) + 1]
        self._values = np.zeros(size)
        self._values_bytes = memoryview(self._values).cast("B")
        # Out: what stands between stamp and sequence, and before them.
        self._frame = struct.pack("<I", layout.length) + FRAME.encode() + bytes(layout.head.size - 24 - len(FRAME))
        self._pack_head = partial(struct.Struct(f"<4siI{len(self._frame)}sQ").pack, _LITTLE_ENDIAN_CDR + b"\0\0")
        # Another middleware may lay messages out otherwise: what does not agree is not used.
        self.fast = fast and self._agrees()

    def _agrees(self) -> bool:
        """Whether the fast encoding and rclpy's serializer give the same bytes, and the same values back."""
        values = np.arange(1.0, self._size + 1.0) / 3.0
        sequence, stamp = 2**40 + 7, 3 * _NANOSECONDS + 21
        message = self._type()
        fill(message, sequence, stamp, values)
        expected = bytearray(serialize_message(message))
        # rclpy's serializer leaves in the padding what was in memory.
        padding = self._layout.padding
        expected[padding] = bytes(padding.stop - padding.start)
        if self.encode(sequence, stamp, values) != expected:
            return False
        decoded = self.decode(bytes(expected))
        return decoded[:2] == (sequence, stamp) and np.array_equal(decoded[2], values)

    def encode(self, sequence: int, stamp_ns: int, values: NDArray[np.float64]) -> bytes:
        """Bytes of a message.

        Parameters
        ----------
        sequence : int
        stamp_ns : int [ns]
            Simulated time.
        values : ndarray (size,), contiguous float64
        """
        if not self.fast:
            message = self._type()
            fill(message, sequence, stamp_ns, values)
            return bytes(serialize_message(message))
        seconds, nanoseconds = divmod(stamp_ns, _NANOSECONDS)
        return b"".join((self._pack_head(seconds, nanoseconds, self._frame, sequence), values))

    def decode(self, data: bytes) -> tuple[int, int, NDArray[np.float64]]:
        """Sequence, stamp [ns] and values (size,) of a message; the array is valid until the next call."""
        layout = self._layout
        try:
            kind, seconds, nanoseconds, length, sequence = layout.head.unpack_from(data)
            if length == layout.length and kind == _LITTLE_ENDIAN_CDR and self.fast:
                self._values_bytes[:] = data[layout.body]
                return sequence, seconds * _NANOSECONDS + nanoseconds, self._values
        except (struct.error, ValueError):
            pass  # too short for this layout
        return self._decode_other(data)

    def _decode_other(self, data: bytes) -> tuple[int, int, NDArray[np.float64]]:
        """As `decode`, for a message that is laid out otherwise than the one before, or not as we know it."""
        layout = self._layouts.get(int.from_bytes(data[12:16], "little"))
        if layout is not None and layout is not self._layout:
            self._layout = layout
            return self.decode(data)
        message = deserialize_message(data, self._type)
        self._values[:] = body(message)
        stamp = message.header.stamp
        return message.sequence, stamp.sec * _NANOSECONDS + stamp.nanosec, self._values


class BlockEncoder:
    """Encoder of messages that carry long sequences of numbers.

    rclpy's serializer takes each number of a sequence through a Python object; here a sequence is copied as it stands.

    Parameters
    ----------
    message_type : type
        A message of a header and then uint64, float64, string, float64[] and float32[] fields only.
    fast : bool
        False: go through rclpy's serializer. The bytes are the same.
    """

    def __init__(self, message_type: type, *, fast: bool = True) -> None:
        self._type = message_type
        _, *self._fields = message_type.get_fields_and_field_types().items()
        self.fast = fast and self._agrees()
        """Whether messages are written directly."""

    def _agrees(self) -> bool:
        """Whether the fast encoding and rclpy's serializer give the same message."""
        values: dict[str, Any] = {}
        for i, (name, kind) in enumerate(self._fields, 3):
            if kind not in _PLAIN and kind not in _SEQUENCES and kind != "string":
                return False
            numbers = np.arange(1.0, i + 1.0) / 3.0
            values[name] = (
                numbers.astype(_SEQUENCES[kind]) if kind in _SEQUENCES else "m" * i if kind == "string" else i
            )
        stamp = 3 * _NANOSECONDS + 21
        written = deserialize_message(self._write(stamp, values), self._type)
        return bool(written == deserialize_message(self._serialize(stamp, values), self._type))

    def encode(self, stamp_ns: int, **values: Any) -> bytes:
        """Bytes of a message with this simulated time [ns] and these fields; sequences as arrays."""
        return self._write(stamp_ns, values) if self.fast else self._serialize(stamp_ns, values)

    def _serialize(self, stamp_ns: int, values: dict[str, Any]) -> bytes:
        message = self._type()
        message.header.frame_id = FRAME
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, _NANOSECONDS)
        for name, kind in self._fields:
            value = values[name]
            if kind in _SEQUENCES:
                value = array.array(_SEQUENCES[kind], np.ascontiguousarray(value, _SEQUENCES[kind]).tobytes())
            setattr(message, name, float(value) if kind == "double" else value)
        return bytes(serialize_message(message))

    def _write(self, stamp_ns: int, values: dict[str, Any]) -> bytes:
        frame = FRAME.encode() + b"\0"
        parts = [struct.pack("<iII", *divmod(stamp_ns, _NANOSECONDS), len(frame)), frame]
        at = 12 + len(frame)  # behind the encapsulation

        def put(data: bytes, alignment: int) -> None:
            nonlocal at
            padding = -at % alignment
            parts.append(bytes(padding))
            parts.append(data)
            at += padding + len(data)

        for name, kind in self._fields:
            value = values[name]
            if kind in _SEQUENCES:
                numbers = np.ascontiguousarray(value, _SEQUENCES[kind])
                put(struct.pack("<I", numbers.size), 4)
                if numbers.size:
                    put(numbers.tobytes(), numbers.itemsize)
            elif kind == "string":
                text = value.encode() + b"\0"
                put(struct.pack("<I", len(text)), 4)
                put(text, 1)
            else:
                put(struct.pack(_PLAIN[kind], value), 8)
        return b"".join([_LITTLE_ENDIAN_CDR + b"\0\0", *parts])


def measurement_codec(*, fast: bool = True) -> Codec:
    """Codec of Measurement; values in the order of `afm_model.signals.MEASUREMENT`."""
    return Codec(Measurement, size(signals.MEASUREMENT), fast=fast)


def drive_codec(*, fast: bool = True) -> Codec:
    """Codec of PiezoDrive; values are the voltages of x, y, z."""
    return Codec(PiezoDrive, 3, fast=fast)
