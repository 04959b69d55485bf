"""Taking and publishing serialized messages with nothing between the control loop and rclpy's handles.

An executor wakes, builds a wait set over every entity of the node and dispatches in Python: hundreds of microseconds a
message. On the control loop's one subscription the message is taken directly, and until one has come the thread
sleeps in a wait set over that subscription alone. The handles are entered once, not for every message.

`take_message`, `publish_raw` and the wait set are rclpy's own building blocks but not its documented surface, so they
are used here only; where they are not there, `Inbox` falls back to an executor, `Outbox` to `Publisher.publish`, and
both say so in `direct`.
"""

from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile


class Unscheduled(CallbackGroup):
    """A group whose entities no executor ever runs: they are taken by hand."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        pass


class Inbox:
    """Serialized messages of one topic, taken by the thread that wants them.

    Parameters
    ----------
    node : Node
    message_type : type
    topic : str
    qos : QoSProfile

    Call `close` before the node is destroyed.
    """

    def __init__(self, node: Node, message_type: type, topic: str, qos: QoSProfile) -> None:
        self._queue: deque[bytes] = deque()
        self._wait_set = self._make_wait_set(node)
        self.direct = self._wait_set is not None
        """Whether messages are taken directly; False: through an executor, slower."""
        group = Unscheduled() if self.direct else None
        self.subscription = node.create_subscription(
            message_type, topic, self._arrived, qos, raw=True, callback_group=group
        )
        if self.direct and not hasattr(self.subscription.handle, "take_message"):
            node.destroy_subscription(self.subscription)
            self.direct = False
            self.subscription = node.create_subscription(message_type, topic, self._arrived, qos, raw=True)
        self._node = node
        self._executor: Executor | None = None  # a node does not keep its executor alive
        self.take: Callable[[], tuple[bytes, Any] | None] = self._take_from_queue
        """take(): the oldest message not yet taken, its bytes first; or None."""
        if self.direct:
            self._handle = self.subscription.handle
            self._handle.__enter__()
            # No function of our own in between: at this rate each one counts.
            self.take = partial(self._handle.take_message, message_type, True)

    def _arrived(self, data: bytes) -> None:
        self._queue.append(data)

    @staticmethod
    def _make_wait_set(node: Node) -> Any:
        try:
            from rclpy.impl.implementation_singleton import rclpy_implementation

            return rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, node.context.handle)
        except (ImportError, AttributeError, TypeError):
            return None

    def _take_from_queue(self) -> tuple[bytes, Any] | None:
        return (self._queue.popleft(), None) if self._queue else None

    def wait(self, timeout: float) -> None:
        """Sleep until a message may be there, or for `timeout` seconds of wall time."""
        if not self.direct:
            # The executor that serves the node's other entities brings the message too.
            executor = self._node.executor
            if executor is None:
                executor = self._executor = SingleThreadedExecutor()
                executor.add_node(self._node)
            executor.spin_once(timeout_sec=timeout)
            return
        self._wait_set.clear_entities()
        self._wait_set.add_subscription(self._handle)
        self._wait_set.wait(int(timeout * 1e9))

    def close(self) -> None:
        """Let the node destroy the subscription; nothing can be taken any more."""
        if self.direct:
            self._handle.__exit__(None, None, None)

    @property
    def publishers(self) -> int:
        """Number of publishers matched."""
        return int(self.subscription.get_publisher_count())


class Outbox:
    """Publishes serialized messages on one topic.

    Parameters
    ----------
    node : Node
    message_type : type
    topic : str
    qos : QoSProfile

    Call `close` before the node is destroyed.
    """

    def __init__(self, node: Node, message_type: type, topic: str, qos: QoSProfile) -> None:
        self._publisher = node.create_publisher(message_type, topic, qos)
        self._handle = self._publisher.handle
        raw = self._publish_raw(self._handle)
        self.direct = raw is not None
        """Whether messages go to the handle directly; False: through `Publisher.publish`, slower."""
        self.publish = raw or self._publisher.publish
        """publish(data): send the bytes of one message."""
        if self.direct:
            self._handle.__enter__()

    @staticmethod
    def _publish_raw(handle: Any) -> Callable[[bytes | bytearray], None] | None:
        return getattr(handle, "publish_raw", None)

    @property
    def subscribers(self) -> int:
        """Number of subscribers matched."""
        return int(self._publisher.get_subscription_count())

    def close(self) -> None:
        """Let the node destroy the publisher; nothing can be published any more."""
        if self.direct:
            self._handle.__exit__(None, None, None)
