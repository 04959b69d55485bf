"""Simulated time on /clock."""

import struct
import time

from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage

from afm_model.run import Run, RunState
from afm_node_common import topics
from afm_node_common.decoding import NANOSECONDS

_PERIOD = 0.02  # a faster /clock costs every use_sim_time node a third of a core
_BEGIN = 0.1
"""Wall time for which a period that begins a series shows its begin [s]: a busy node receives the newest time only."""


class Clock:
    """Publishes the time of a run [s, simulated] 50 times a second of wall time, and on demand with every measurement.

    In lockstep, `asked` publishes the end of the control period that waits for its drive: a timer of a controller is
    due once for each measurement, the first one included. A measurement that starts a run, or that is sent again, is
    published with its own time first and the end of its period a moment later. So a timer is due even if it was made
    after that time, or has been missed.

    Parameters
    ----------
    node : Node
    run : Run
    period : float [s]
        Control period in lockstep; 0 in real time, where time does not wait for a drive.
    """

    def __init__(self, node: Node, run: Run, period: float) -> None:
        self._run, self._period_ns = run, period * 1e9
        self._publisher = node.create_publisher(ClockMessage, topics.clock(node.get_namespace()), 1)
        self._at = self._begins_until = 0.0
        self._sequence = -1  # measurement published last

    def publish(self) -> None:
        """Publish the time now."""
        begins = self._run.state == RunState.WAITING or time.monotonic() < self._begins_until
        self._send(self._run.stamp_ns if begins else self._end())

    def publish_at(self, now: float) -> None:
        """Publish if it is time to; `now` is steady wall time [s]."""
        if now >= self._at:
            self.publish()

    def asked(self, sequence: int) -> None:
        """Publish the time that belongs to a measurement that has just been published."""
        if self._period_ns and (sequence == 0 or sequence == self._sequence):
            self._begins_until = time.monotonic() + _BEGIN
        self._sequence = sequence
        self.publish()

    def _end(self) -> int:
        """End of the period of the newest measurement [ns]; in real time its begin, which is now."""
        return max(self._run.stamp_ns, round((self._sequence + 1) * self._period_ns))

    def _send(self, nanoseconds: int) -> None:
        self._at = time.monotonic() + _PERIOD
        # As bytes: rclpy's conversion of a message takes longer than a tick may.
        self._publisher.publish(clock_bytes(nanoseconds))


def clock_bytes(nanoseconds: int) -> bytes:
    """Simulated time as a serialized rosgraph_msgs/Clock."""
    return struct.pack("<4siI", b"\0\1\0\0", *divmod(nanoseconds, NANOSECONDS))
