"""Listening that survives every message: what cannot be read or makes no sense is dropped, counted and named."""

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.subscription import Subscription

_TOLD_EVERY = 1.0
"""Wall time between two lines in the log [s]: somebody may send nonsense at any rate."""


class Senseless(ValueError):
    """A message that cannot be meant; says which field and what belongs there."""


class Drops:
    """Counts messages that were dropped, and tells of them.

    Parameters
    ----------
    node : Node
    """

    def __init__(self, node: Node) -> None:
        self.count = 0
        """Messages dropped."""
        self.last = ""
        """The last of them, in a sentence; empty if there was none."""
        self._node = node
        self._told_at = float("-inf")
        self._senders: dict[str, tuple[float, str]] = {}

    def note(self, topic: str, why: str) -> None:
        """Count a message, and log it unless there was a line in the log within the last second."""
        self.count += 1
        now = time.monotonic()
        self.last = (
            f"a message on {self._node.resolve_topic_name(topic)} from {self._sender(topic, now)} was dropped: {why}"
        )
        if now >= self._told_at + _TOLD_EVERY:
            self._told_at = now
            self._node.get_logger().warning(f"{self.last} ({self.count} dropped up to now)")

    def _sender(self, topic: str, now: float) -> str:
        """Who publishes there: rclpy does not tell from which of several a message came."""
        asked_at, sender = self._senders.get(topic, (float("-inf"), ""))
        # Asking for names takes a while: not for each of a flood.
        if now < asked_at + _TOLD_EVERY:
            return sender
        resolved = self._node.resolve_topic_name(topic)
        senders = {
            f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            for info in self._node.get_publishers_info_by_topic(resolved)
        }
        sender = " or ".join(sorted(senders)) or "somebody who has gone"
        self._senders[topic] = now, sender
        return sender


class Ears:
    """What a node listens to.

    Messages are taken as bytes: a typed subscription of rclpy raises out of the executor when they cannot be read.

    Parameters
    ----------
    node : Node
    """

    def __init__(self, node: Node) -> None:
        self.drops = Drops(node)
        """What was dropped."""
        self._node = node

    def listen(self, kind: Any, topic: str, take: Callable[[Any], None], qos: QoSProfile) -> Subscription:
        """Have `take` called with each message; it raises `Senseless` for one that cannot be meant."""

        def on_bytes(data: bytes) -> None:
            try:
                message = deserialize_message(data, kind)
            # The middleware, the conversion to Python and memory each fail in their own way.
            except Exception as error:
                self.drops.note(topic, f"{len(data)} bytes that are no {kind.__name__} ({type(error).__name__})")
                return
            try:
                take(message)
            except Senseless as error:
                self.drops.note(topic, str(error))

        return self._node.create_subscription(kind, topic, on_bytes, qos, raw=True)
