"""Times in messages: a stamp gives back the time that it was made of, and the clock the bytes of rclpy's serializer."""

import pytest
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock

from afm_node_common.decoding import nanoseconds
from afm_node_common.stamps import stamp
from afm_sim_node.clock import clock_bytes


@pytest.mark.parametrize("time", [0, 1, 999_999_999, 1_000_000_000, 2**31 * 10**9 - 1])
def test_bytes_of_the_clock_are_those_of_rclpy_and_a_stamp_loses_nothing(time: int) -> None:
    assert clock_bytes(time) == bytes(serialize_message(Clock(clock=stamp(time))))
    assert nanoseconds(stamp(time)) == time
    assert (stamp(time).sec, stamp(time).nanosec) == divmod(time, 10**9)
