"""Simulated time on /clock."""

import struct
import time

from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage

from afm_model.run import Run
from afm_node_common import topics
from afm_node_common.stamps import NANOSECONDS

_PERIOD = 0.02  # a faster /clock costs every use_sim_time node a third of a core


class Clock:
    """Publishes the time of a run [s, simulated].

    Parameters
    ----------
    node : Node
    run : Run
    """

    def __init__(self, node: Node, run: Run) -> None:
        self._run = run
        self._publisher = node.create_publisher(ClockMessage, topics.clock(node.get_namespace()), 1)
        self._at = 0.0

    def publish(self) -> None:
        """Publish the time now."""
        self._at = time.monotonic() + _PERIOD
        # As bytes: rclpy's conversion of a message takes longer than a tick may.
        self._publisher.publish(clock_bytes(self._run.stamp_ns))

    def publish_at(self, now: float) -> None:
        """Publish if it is time to; `now` is steady wall time [s]."""
        if now >= self._at:
            self.publish()


def clock_bytes(nanoseconds: int) -> bytes:
    """Simulated time as a serialized rosgraph_msgs/Clock."""
    return struct.pack("<4siI", b"\0\1\0\0", *divmod(nanoseconds, NANOSECONDS))
