"""A PiezoDrive with a horizon on the wire: rclpy's serializer and ours understand each other."""

import struct

import numpy as np
import pytest
from afm_msgs.msg import PiezoDrive
from geometry_msgs.msg import Vector3
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message

from afm_model import Command, DriveError
from afm_model.core.errors import MalformedError
from afm_model.parts.signals import LONGEST_HORIZON
from afm_node_common.drive_codec import drive_codec

FAST, SLOW = drive_codec(), drive_codec(fast=False)
drives = st.tuples(*[st.floats(-1e3, 1e3)] * 3)
horizons = st.lists(drives, min_size=1, max_size=12)
frames = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=12)


def message(horizon: list[tuple[float, float, float]], period: float = 5e-5, frame: str = "scanner") -> PiezoDrive:
    told = PiezoDrive(run_id=5, sequence=7, voltage=Vector3(x=1.0, y=2.0, z=3.0), horizon_period=period)
    told.header.frame_id = frame
    told.header.stamp.sec, told.header.stamp.nanosec = 3, 21
    told.horizon = [Vector3(x=x, y=y, z=z) for x, y, z in horizon]
    return told


@given(horizon=horizons, frame=frames)
def test_codecs_read_a_horizon_that_rclpy_writes(horizon, frame) -> None:
    data = serialize_message(message(horizon, frame=frame))
    for codec in (FAST, SLOW):
        run_id, sequence, stamp, drive = codec.decode(data)
        assert (run_id, sequence, stamp) == (5, 7, 3 * 10**9 + 21)
        assert isinstance(drive, Command)
        assert (drive.voltage.tolist(), drive.horizon_period) == ([1.0, 2.0, 3.0], 5e-5)
        assert drive.horizon.tolist() == [list(each) for each in horizon]


def test_horizon_is_read_and_written_in_place(monkeypatch) -> None:
    data = serialize_message(message([(4.0, 5.0, 6.0)]))
    monkeypatch.setattr("afm_node_common.cdr.deserialize_message", None)
    monkeypatch.setattr("afm_node_common.drive_codec.serialize_message", None)
    drive = FAST.decode(data)[3]
    assert deserialize_message(FAST.encode(5, 7, 3 * 10**9 + 21, drive), PiezoDrive) == message([(4.0, 5.0, 6.0)])
    assert FAST.decode(data)[3].horizon.tolist() == [[4.0, 5.0, 6.0]]


@given(horizon=horizons)
def test_rclpy_reads_a_horizon_that_the_codecs_write(horizon) -> None:
    for codec in (FAST, SLOW):
        written = codec.encode(5, 7, 3 * 10**9 + 21, Command(np.array([1.0, 2.0, 3.0]), np.array(horizon), 5e-5))
        assert deserialize_message(written, PiezoDrive) == message(horizon)


def test_command_without_a_horizon_is_an_ordinary_drive_on_the_wire() -> None:
    voltage = np.array([1.0, 2.0, 3.0])
    assert FAST.encode(5, 7, 0, Command(voltage)) == FAST.encode(5, 7, 0, voltage)
    assert isinstance(FAST.decode(FAST.encode(5, 7, 0, voltage))[3], np.ndarray)


@pytest.mark.parametrize(
    ("horizon", "period", "reason"),
    [
        ([(0.0, 0.0, 0.0)], 0.0, "horizon_period = 0.0 s"),
        ([(0.0, 0.0, 0.0)], float("nan"), "horizon_period = nan s"),
        ([(0.0, 0.0, 0.0)], -1.0, "horizon_period = -1.0 s"),
    ],
)
def test_horizon_that_cannot_be_meant_is_told_with_the_sequence_it_came_with(horizon, period, reason) -> None:
    data = serialize_message(message(horizon, period))
    for codec in (FAST, SLOW):
        _, sequence, _, drive = codec.decode(data)
        assert sequence == 7
        assert isinstance(drive, DriveError) and reason in str(drive)


def test_longest_horizon_is_that_of_the_type_and_a_longer_one_is_no_message() -> None:
    assert PiezoDrive.get_fields_and_field_types()["horizon"] == f"sequence<geometry_msgs/Vector3, {LONGEST_HORIZON}>"
    whole = serialize_message(message([(1.0, 2.0, 3.0)] * LONGEST_HORIZON))
    count = len(whole) - 24 * LONGEST_HORIZON - 8
    assert struct.unpack_from("<I", whole, count) == (LONGEST_HORIZON,)
    longer = whole[:count] + struct.pack("<I", LONGEST_HORIZON + 1) + whole[count + 4 :] + bytes(24)
    for codec in (FAST, SLOW):
        assert len(codec.decode(whole)[3].horizon) == LONGEST_HORIZON
        with pytest.raises(MalformedError):
            codec.decode(longer)


def test_horizon_that_breaks_off_or_goes_on_behind_its_end_is_malformed() -> None:
    whole = serialize_message(message([(1.0, 2.0, 3.0)] * 3))
    for data in (*(whole[:length] for length in range(len(whole))), whole + b"\0", whole + bytes(24)):
        for codec in (FAST, SLOW):
            with pytest.raises(MalformedError):
                codec.decode(data)
