"""Messages between arrays and the bytes on the wire, without rclpy's typed messages in between.

Measurement and PiezoDrive, of which every control tick has one each: both are a header, run_id, sequence and then
numbers of 8 bytes only, so their CDR encoding is a fixed layout once the length of frame_id is known (a PiezoDrive with
a horizon: `drive_codec`). Reading and writing it in place costs about a microsecond where rclpy's typed messages cost
tens. Bytes that are no such message, with nothing after it, are refused with `MalformedError`, whoever sent them and
whatever they are. `BlockEncoder` writes the long messages for recorders. The bytes are those of rclpy's own serializer
(padding apart), which is checked when a codec is made: any ordinary subscriber sees normal messages, and any ordinary
publisher is understood.
"""

import array
import struct
from functools import partial
from typing import Any

import numpy as np
from afm_msgs.msg import Measurement, Telemetry
from geometry_msgs.msg import Vector3
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message

from afm_model.compiled.records import size
from afm_model.core.errors import MalformedError
from afm_model.parts import signals

from .decoding import NANOSECONDS, nanoseconds
from .stamps import stamp
from .topics import FRAME

_BIG_ENDIAN_CDR, LITTLE_ENDIAN_CDR = b"\x00\x00", b"\x00\x01"
_PLAIN = {"uint64": "<Q", "double": "<d"}
_SEQUENCES = {"sequence<double>": "d", "sequence<float>": "f"}
_ndarray = np.ndarray
_LONGEST_FRAME = 256
"""frame_id beyond which a message is left to rclpy's serializer [bytes]."""


class _Layout:
    """Where things stand in a message whose frame_id takes `length` bytes, its final zero included."""

    def __init__(self, length: int, size: int, tail: int) -> None:
        # CDR aligns to 8, counted from the end of the encapsulation header.
        padding = -(12 + length) % 8
        self.length = length
        # Kind of encapsulation, stamp.sec, stamp.nanosec, frame_id with its length, run_id, sequence.
        self.head = struct.Struct(f"<2s2xiI{4 + length}s{padding}xQQ")
        run_id = self.head.size - 16
        self.padding = slice(run_id - padding, run_id)
        # The same, the numbers, and the last four bytes after them.
        end = f"{tail - 4}x4s" if tail else "0s"
        whole = struct.Struct(f"{self.head.format}{8 * size}s{end}")
        self.size = whole.size
        self.unpack = whole.unpack
        """Unpack a message; struct.error if it has another number of bytes."""


def body(message: Any, size: int) -> NDArray[np.float64]:
    """The `size` numbers of a message after its sequence, in order; whole numbers by their bytes."""
    values = np.zeros(size)
    at = 0
    for name in list(message.get_fields_and_field_types())[3:]:
        if at == size:
            break
        value = getattr(message, name)
        numbers = [value.x, value.y, value.z] if isinstance(value, Vector3) else [value]
        if isinstance(value, int):
            values[at : at + 1].view(np.int64)[0] = value
        else:
            values[at : at + len(numbers)] = numbers
        at += len(numbers)
    return values


def fill(message: Any, run_id: int, sequence: int, stamp_ns: int, values: NDArray[np.float64]) -> None:
    """The inverse of `body`, with header, run_id and sequence."""
    message.header.frame_id = FRAME
    message.header.stamp = stamp(stamp_ns)
    message.run_id = run_id
    message.sequence = sequence
    at = 0
    for name in list(message.get_fields_and_field_types())[3:]:
        if at == values.size:
            return
        value = getattr(message, name)
        if isinstance(value, Vector3):
            x, y, z = (float(v) for v in values[at : at + 3])
            setattr(message, name, Vector3(x=x, y=y, z=z))
            at += 3
        else:
            whole = isinstance(value, int)
            setattr(message, name, int(values[at : at + 1].view(np.int64)[0]) if whole else float(values[at]))
            at += 1


class Codec:
    """Encoder and decoder of one message type.

    Parameters
    ----------
    message_type : type
        A message of header, run_id, sequence and numbers of 8 bytes (or vectors of them), and then what `tail` is.
    size : int
        Number of those numbers.
    tail : bytes
        What follows them in every message that is read and written in place.
    fast : bool
        False: go through rclpy's serializer each time. The bytes are the same.
    """

    def __init__(self, message_type: type, size: int, *, tail: bytes = b"", fast: bool = True) -> None:
        self._type = message_type
        self._size = size
        self._tail = tail
        self._end = tail[-4:]
        self.fast = True
        """Whether messages are read and written in place; False: through rclpy's serializer, tens of times slower."""
        # In: the layout and the frame_id, with its length, of the message before; most have the same.
        self._layouts = {length: _Layout(length, size, len(tail)) for length in range(1, _LONGEST_FRAME + 2)}
        self._layout = layout = self._layouts[len(FRAME) + 1]
        self._frame_in = b""
        self._values = np.zeros(size)
        self._values_bytes = memoryview(self._values).cast("B")
        # Outgoing: the bytes between stamp and run_id, and before them.
        self._frame = struct.pack("<I", layout.length) + FRAME.encode() + bytes(layout.head.size - 32 - len(FRAME))
        self._pack_head = partial(struct.Struct(f"<4siI{len(self._frame)}sQQ").pack, LITTLE_ENDIAN_CDR + b"\0\0")
        # Another middleware may use another layout: the fast way is used only if it agrees.
        self.fast = fast and self._agrees()

    def _agrees(self) -> bool:
        """Whether the fast encoding and rclpy's serializer give the same bytes, and the same values back."""
        values = np.arange(1.0, self._size + 1.0) / 3.0
        run_id, sequence, time = 2**50 + 3, 2**40 + 7, 3 * NANOSECONDS + 21
        message = self._type()
        fill(message, run_id, sequence, time, values)
        expected = bytearray(serialize_message(message))
        # rclpy's serializer leaves uninitialised bytes in the padding.
        padding = self._layout.padding
        expected[padding] = bytes(padding.stop - padding.start)
        if self.encode(run_id, sequence, time, values) != expected:
            return False
        decoded = self.decode(bytes(expected))
        return decoded[:3] == (run_id, sequence, time) and np.array_equal(decoded[3], values)

    def encode(self, run_id: int, sequence: int, stamp_ns: int, values: Any) -> bytes:
        """Bytes of a message.

        Parameters
        ----------
        run_id, sequence : int
        stamp_ns : int [ns]
            Simulated time.
        values : ndarray (size,), contiguous float64
        """
        if self.fast and type(values) is _ndarray:
            pack = self._pack_head
            seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
            return b"".join((pack(seconds, nanoseconds, self._frame, run_id, sequence), values, self._tail))
        return self._encode_other(run_id, sequence, stamp_ns, values)

    def _encode_other(self, run_id: int, sequence: int, stamp_ns: int, values: Any) -> bytes:
        """As `encode`, by rclpy's serializer."""
        message = self._type()
        fill(message, run_id, sequence, stamp_ns, values)
        return bytes(serialize_message(message))

    def decode(self, data: bytes) -> tuple[int, int, int, Any]:
        """run_id, sequence, stamp [ns] and values (size,) of a message; the array is valid until the next call.

        Raises
        ------
        MalformedError
            If these bytes are not one message of this type and nothing else, with a frame_id in UTF-8 and a stamp that
            is not before 0.
        """
        unpack = self._layout.unpack
        try:
            kind, seconds, nanoseconds, frame, run_id, sequence, numbers, end = unpack(data)
        except struct.error:  # too short for this layout, or too long
            return self._decode_other(data)
        if (
            frame == self._frame_in
            and end == self._end
            and kind == LITTLE_ENDIAN_CDR
            and seconds >= 0
            and nanoseconds < NANOSECONDS
        ):
            self._values_bytes[:] = numbers
            return run_id, sequence, seconds * NANOSECONDS + nanoseconds, self._values
        return self._decode_other(data)

    def _decode_other(self, data: bytes) -> tuple[int, int, int, Any]:
        """As `decode`, for a message with another layout than the previous one."""
        if self.fast and data[:2] == LITTLE_ENDIAN_CDR:
            layout = self._layouts.get(int.from_bytes(data[12:16], "little"))
            if layout is not None and len(data) == layout.size and data.endswith(self._end):
                frame = data[12 : 16 + layout.length]
                if frame != self._frame_in and is_text(frame[4:]):
                    self._layout, self._frame_in = layout, frame
                    return self.decode(data)
        message = _deserialize(data, self._type)
        return message.run_id, message.sequence, nanoseconds(message.header.stamp), self._read(message)

    def _read(self, message: Any) -> Any:
        """What `decode` gives for a message of rclpy's."""
        self._values[:] = body(message, self._size)
        return self._values


def is_text(data: bytes) -> bool:
    """Whether these bytes are one zero-terminated string in UTF-8."""
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return False
    return text.find("\0") == len(text) - 1


def _deserialize(data: bytes, kind: Any) -> Any:
    """A message by rclpy's serializer, which reads over much that it should not.

    Raises
    ------
    MalformedError
        See `Codec.decode`.
    """
    what = f"{len(data)} bytes that are no {kind.__name__}"
    orders = {LITTLE_ENDIAN_CDR: "<I", _BIG_ENDIAN_CDR: ">I"}
    if data[:2] not in orders:
        raise MalformedError(f"{what} (they begin with 0x{data[:2].hex()}: plain CDR begins with 0x0001 or 0x0000)")
    try:
        message = deserialize_message(data, kind)
        whole = len(serialize_message(message))
    # The middleware, the conversion to Python and memory each fail in their own way.
    except Exception as error:
        raise MalformedError(f"{what} ({type(error).__name__})") from None
    stamp, frame = message.header.stamp, message.header.frame_id.encode() + b"\0"
    if stamp.sec < 0 or stamp.nanosec >= NANOSECONDS:
        raise MalformedError(
            f"a {kind.__name__} with stamp {stamp.sec} s + {stamp.nanosec} ns: it must be a time since the start"
        )
    # The serializer would change a text that is no UTF-8 or continues after a zero.
    if data[12 : 16 + len(frame)] != struct.pack(orders[data[:2]], len(frame)) + frame:
        raise MalformedError(f"a {kind.__name__} whose frame_id is no text in UTF-8")
    if whole != len(data):
        raise MalformedError(f"{len(data)} bytes for a {kind.__name__} of {whole}")
    return message


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
        time = 3 * NANOSECONDS + 21
        written = deserialize_message(self._write(time, values), self._type)
        return bool(written == deserialize_message(self._serialize(time, values), self._type))

    def encode(self, stamp_ns: int, **values: Any) -> bytes:
        """Bytes of a message with this simulated time [ns] and these fields; sequences as arrays."""
        return self._write(stamp_ns, values) if self.fast else self._serialize(stamp_ns, values)

    def _serialize(self, stamp_ns: int, values: dict[str, Any]) -> bytes:
        message = self._type()
        message.header.frame_id = FRAME
        message.header.stamp = stamp(stamp_ns)
        for name, kind in self._fields:
            value = values[name]
            if kind in _SEQUENCES:
                value = array.array(_SEQUENCES[kind], np.ascontiguousarray(value, _SEQUENCES[kind]).tobytes())
            setattr(message, name, float(value) if kind == "double" else value)
        return bytes(serialize_message(message))

    def _write(self, stamp_ns: int, values: dict[str, Any]) -> bytes:
        frame = FRAME.encode() + b"\0"
        parts = [struct.pack("<iII", *divmod(stamp_ns, NANOSECONDS), len(frame)), frame]
        at = 12 + len(frame)  # after the encapsulation header

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
        return b"".join([LITTLE_ENDIAN_CDR + b"\0\0", *parts])


def measurement_codec(*, fast: bool = True) -> Codec:
    """Codec of Measurement; values in the order of `afm_model.parts.signals.Measurement`."""
    return Codec(Measurement, size(signals.Measurement), fast=fast)


def telemetry_codec() -> Codec:
    """Codec of Telemetry."""
    return Codec(Telemetry, len(Telemetry.get_fields_and_field_types()) - 3)
