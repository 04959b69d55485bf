"""Subscriptions that survive every message: an unreadable or invalid one is dropped, counted and reported."""

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

from .decoding import InvalidMessage

_LOG_PERIOD = 1.0
"""Least wall time between two lines in the log [s]: invalid messages may come at any rate."""


class DroppedMessages:
    """Counts dropped messages and reports them in the log.

    Parameters
    ----------
    node : Node
    """

    def __init__(self, node: Node) -> None:
        self.count = 0
        """Messages dropped."""
        self.last = ""
        """The last one, in a sentence; empty if there was none."""
        self._node = node
        self._logged_at = float("-inf")
        self._senders: dict[str, tuple[float, str]] = {}

    def add(self, topic: str, why: str) -> None:
        """Count a message, and log it unless there was a line in the log within the last second."""
        self.count += 1
        now = time.monotonic()
        self.last = (
            f"a message on {self._node.resolve_topic_name(topic)} from {self._sender(topic, now)} was dropped: {why}"
        )
        if now >= self._logged_at + _LOG_PERIOD:
            self._logged_at = now
            self._node.get_logger().warning(f"{self.last} ({self.count} dropped up to now)")

    def _sender(self, topic: str, now: float) -> str:
        """Names of the publishers of a topic: rclpy does not say which of them sent a message."""
        queried_at, sender = self._senders.get(topic, (float("-inf"), ""))
        # The query takes a while: at most one in each period.
        if now < queried_at + _LOG_PERIOD:
            return sender
        resolved = self._node.resolve_topic_name(topic)
        senders = {
            f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            for info in self._node.get_publishers_info_by_topic(resolved)
        }
        sender = " or ".join(sorted(senders)) or "a publisher that has ended"
        self._senders[topic] = now, sender
        return sender


class Subscriptions:
    """The subscriptions of a node.

    Messages are taken as bytes: a typed subscription of rclpy raises out of the executor when they cannot be read.

    Parameters
    ----------
    node : Node
    """

    def __init__(self, node: Node) -> None:
        self.drops = DroppedMessages(node)
        """Messages that were dropped."""
        self._node = node

    def subscribe(self, kind: Any, topic: str, take: Callable[[Any], None], qos: QoSProfile) -> Subscription:
        """Call `take` with each message; `take` raises `InvalidMessage` for one that is not valid."""

        def on_bytes(data: bytes) -> None:
            try:
                message = deserialize_message(data, kind)
            # The middleware, the conversion to Python and memory each fail in their own way.
            except Exception as error:
                self.drops.add(topic, f"{len(data)} bytes that are no {kind.__name__} ({type(error).__name__})")
                return
            try:
                take(message)
            except InvalidMessage as error:
                self.drops.add(topic, str(error))

        return self._node.create_subscription(kind, topic, on_bytes, qos, raw=True)
