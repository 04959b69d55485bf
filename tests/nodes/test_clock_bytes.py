"""The clock is published as bytes: they are those of rclpy's serializer."""

import pytest
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock

from afm_sim_node.streams import clock_bytes, stamp


@pytest.mark.parametrize("nanoseconds", [0, 1, 999_999_999, 1_000_000_000, 2**31 * 10**9 - 1])
def test_bytes_of_the_clock_are_those_of_rclpy(nanoseconds: int) -> None:
    assert clock_bytes(nanoseconds) == bytes(serialize_message(Clock(clock=stamp(nanoseconds))))
