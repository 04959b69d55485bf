"""Notices when the simulator has ended, is silent, or was started again."""

import time
from collections.abc import Callable

from afm_msgs.msg import InstrumentStatus
from rclpy.node import Node

from . import topics
from .direct import Inbox

SILENCE = 2.0
"""A simulator counts as silent after so much wall time without a status [s]; it publishes one every 0.2 s."""


class Presence:
    """Watches the topic `status` for the simulator.

    The middleware itself notices a killed process only after some seconds, up to twenty.

    Parameters
    ----------
    node : Node
    subscribe : bool
        False: the node subscribes to `status` itself and calls `heard`.
    clock : callable
        Steady wall time [s].

    Call `close` before the node is destroyed.
    """

    def __init__(self, node: Node, *, subscribe: bool = True, clock: Callable[[], float] = time.monotonic) -> None:
        self.problem = ""
        """What is wrong with the simulator, in a sentence; empty: nothing, or no simulator has been seen yet."""
        self._node, self._clock = node, clock
        self._topic = node.resolve_topic_name(topics.STATUS)
        self._name = "the simulator"
        self._heard_at: float | None = None
        self._publishers: set[bytes] = set()
        # Beside an executor: a controller's next tick may be due in microseconds.
        self._inbox = Inbox(node, InstrumentStatus, topics.STATUS, topics.LATCHED_QOS) if subscribe else None

    def heard(self) -> None:
        """Note that a status has come."""
        self._heard_at = self._clock()

    def look(self) -> None:
        """Log any change; call this some times a second, or once."""
        now = self._clock()
        while self._inbox is not None and self._inbox.take() is not None:
            self.heard()
        if self._heard_at is None:
            return
        infos = self._node.get_publishers_info_by_topic(self._topic)
        for info in infos:
            # The middleware reports a name a moment after the endpoint.
            if not info.node_name.startswith("_"):
                self._name = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
        publishers = {bytes(info.endpoint_gid) for info in infos}
        if self._publishers and publishers - self._publishers:
            self._node.get_logger().warning(
                f"{self._name} publishes {self._topic} again: it was restarted, or there are two nodes of that name"
            )
        self._publishers |= publishers
        problem, silent = "", now > self._heard_at + SILENCE
        if not publishers:
            problem = f"{self._name} has ended: {self._topic} has no publisher"
        elif silent:
            problem = f"{self._name} has not published its status for {SILENCE:g} s: it has stopped or was killed"
        if problem != self.problem:
            before, self.problem = self.problem, problem
            if problem and (publishers or silent):
                self._node.get_logger().warning(problem)
            elif problem:  # heard up to its end: it has taken its leave
                self._node.get_logger().info(problem)
            elif before:
                self._node.get_logger().info(f"{self._name} publishes its status again")

    def close(self) -> None:
        """Let the node be destroyed."""
        if self._inbox is not None:
            self._inbox.close()
