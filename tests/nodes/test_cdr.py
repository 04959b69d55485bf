"""The codec and rclpy's own serializer write the same bytes and understand each other."""

import functools
import struct
from collections.abc import Callable

import numpy as np
import pytest
from afm_msgs.msg import Measurement, PiezoDrive
from geometry_msgs.msg import Vector3
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from afm_model.compiled import records
from afm_model.core.errors import MalformedError
from afm_model.parts import signals
from afm_node_common import topics
from afm_node_common.cdr import Codec, body, fill, measurement_codec
from afm_node_common.drive_codec import drive_codec

HEADER = struct.calcsize("<4siII")
"""Encapsulation, stamp, length of frame_id."""
# One codec for all examples: what a message leaves behind in it must not matter to the next.
KINDS = [
    pytest.param(Measurement, records.size(signals.Measurement), functools.cache(measurement_codec), id="measurement"),
    pytest.param(PiezoDrive, 3, functools.cache(drive_codec), id="drive"),
]
Make = Callable[..., Codec]

sequences = runs = st.integers(0, 2**64 - 1)
# The message's seconds are an int32; simulated time begins at 0.
stamps = st.integers(0, 2**31 * 10**9 - 1)
doubles = st.floats(width=64)  # NaN, infinities and subnormal numbers too
frames = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=40)


def drawn(data: st.DataObject, size: int) -> np.ndarray:
    return np.array(data.draw(st.lists(doubles, min_size=size, max_size=size)))


def tail(kind: type) -> bytes:
    """What stands behind the numbers in a message without a horizon."""
    return bytes(12) if kind is PiezoDrive else b""


def same(a: np.ndarray, b: np.ndarray) -> bool:
    return np.array_equal(a, b, equal_nan=True)


def without_padding(data: bytes) -> bytes:
    """A message without the bytes between frame_id and run_id, which rclpy's serializer does not set."""
    end = HEADER + struct.unpack_from("<I", data, HEADER - 4)[0]
    return data[:end] + data[4 + -(-(end - 4) // 8) * 8 :]


@pytest.mark.parametrize(("kind", "size", "make"), KINDS)
@given(data=st.data(), run_id=runs, sequence=sequences, stamp=stamps)
def test_rclpy_reads_what_the_codec_writes(
    kind: type, size: int, make: Make, data: st.DataObject, run_id: int, sequence: int, stamp: int
) -> None:
    values = drawn(data, size)
    message = deserialize_message(make().encode(run_id, sequence, stamp, values), kind)
    assert (message.run_id, message.sequence) == (run_id, sequence)
    assert message.header.frame_id == topics.FRAME
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp
    assert same(body(message, size), values)


@pytest.mark.parametrize(("kind", "size", "make"), KINDS)
@given(data=st.data(), run_id=runs, sequence=sequences, stamp=stamps, frame=frames)
def test_codec_reads_what_rclpy_writes_whatever_the_frame(
    kind: type, size: int, make: Make, data: st.DataObject, run_id: int, sequence: int, stamp: int, frame: str
) -> None:
    values = drawn(data, size)
    message = kind()
    fill(message, run_id, sequence, stamp, values)
    message.header.frame_id = frame
    if stamp < 0:
        with pytest.raises(MalformedError, match="it must be a time since the start"):
            make().decode(serialize_message(message))
        return
    got = make().decode(serialize_message(message))
    assert got[:3] == (run_id, sequence, stamp)
    assert same(got[3], values)


@pytest.mark.parametrize(("kind", "size", "make"), KINDS)
@given(data=st.data(), run_id=runs, sequence=sequences, stamp=stamps)
def test_fast_and_slow_codec_write_the_same_bytes(
    kind: type, size: int, make: Make, data: st.DataObject, run_id: int, sequence: int, stamp: int
) -> None:
    fast, slow = make(fast=True), make(fast=False)
    assert (fast.fast, slow.fast) == (True, False)
    values = drawn(data, size)
    written = [codec.encode(run_id, sequence, stamp, values) for codec in (fast, slow)]
    assert len(written[0]) == len(written[1])
    assert without_padding(written[0]) == without_padding(written[1])
    for codec, other in ((fast, written[1]), (slow, written[0])):
        if stamp < 0:
            with pytest.raises(MalformedError):
                codec.decode(other)
            continue
        got = codec.decode(other)
        assert got[:3] == (run_id, sequence, stamp)
        assert same(got[3], values)


def test_fields_of_a_measurement_stand_in_the_order_of_the_signals() -> None:
    values = np.arange(float(records.size(signals.Measurement)))
    message = deserialize_message(measurement_codec().encode(0, 0, 0, values), Measurement)
    record = records.record_at(values, 0, signals.Measurement)
    header, run_id, sequence, *fields = Measurement.get_fields_and_field_types()
    assert (header, run_id, sequence) == ("header", "run_id", "sequence")
    assert tuple(fields) == signals.Measurement.names
    for name in fields:
        told = getattr(message, name)
        if isinstance(told, Vector3):
            assert [told.x, told.y, told.z] == list(record[name])
        else:
            assert told == record[name], name


@pytest.mark.parametrize(("kind", "size", "make"), KINDS)
def test_message_of_a_big_endian_machine_is_understood(kind: type, size: int, make: Make) -> None:
    values = np.linspace(-1.0, 1.0, size)
    frame = b"elsewhere\0"
    data = b"\x00\x00\x00\x00" + struct.pack(">iII", 3, 21, len(frame)) + frame
    data += bytes(-(len(data) - 4) % 8) + struct.pack(">QQ", 5, 2**40 + 7) + values.view(">f8").byteswap().tobytes()
    data += tail(kind)
    got = make().decode(data)
    assert got[:3] == (5, 2**40 + 7, 3 * 10**9 + 21)
    assert same(got[3], values)


@pytest.mark.parametrize(("kind", "size", "make"), KINDS)
@pytest.mark.parametrize("frame", ["scanner", "elsewhere"])
def test_messages_are_read_in_place_whatever_the_frame(monkeypatch, kind, size, make, frame) -> None:
    reader, message = make.__wrapped__(), kind()
    fill(message, 5, 7, 11, np.arange(1.0, size + 1.0))
    message.header.frame_id = frame
    data = serialize_message(message)
    monkeypatch.setattr("afm_node_common.cdr.deserialize_message", None)
    assert same(reader.decode(data)[3], np.arange(1.0, size + 1.0))


@pytest.mark.parametrize("fast", [True, False])
@pytest.mark.parametrize(("kind", "size", "make"), KINDS)
def test_message_that_breaks_off_is_an_error_and_never_numbers(kind: type, size: int, make: Make, fast: bool) -> None:
    codec = make(fast=fast)
    whole = codec.encode(5, 7, 11, np.arange(1.0, size + 1.0))
    for length in range(len(whole)):
        with pytest.raises(MalformedError):
            codec.decode(whole[:length])
    assert codec.decode(whole)[1] == 7


@pytest.mark.parametrize(("kind", "size", "make"), KINDS)
def test_length_of_a_frame_beyond_the_message_is_an_error(kind: type, size: int, make: Make) -> None:
    data = bytearray(make().encode(5, 7, 11, np.arange(1.0, size + 1.0)))
    struct.pack_into("<I", data, HEADER - 4, 2**32 - 1)
    with pytest.raises(MalformedError):
        make().decode(bytes(data))
