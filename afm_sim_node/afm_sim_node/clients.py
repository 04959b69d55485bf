"""Whether the client of a goal is still there, which rclpy's action server does not tell."""

import time
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile

SILENCE = 3.0
"""Wall time without an acknowledgement after which a client counts as gone [s]."""
_LONGEST_LOOK = 0.5
"""Wall time between two looks that counts at most [s]: while this process stood still, nobody could be heard."""
_NOW = Duration(seconds=0)


class Feedback:
    """Publishes the feedback of one action, and knows by it who listens.

    Every client of an action subscribes to its feedback, whatever it is written in. The middleware of one that lives
    acknowledges what it receives, even if the client itself is busy; that of one that was killed does not. Without this
    the middleware would take twenty seconds to notice.

    Parameters
    ----------
    node : Node
    kind : type
        Of the action.
    name : str
        Of the action.
    """

    def __init__(self, node: Node, kind: Any, name: str) -> None:
        self._node, self._message = node, kind.Impl.FeedbackMessage
        # A second publisher beside that of the action server, which does not let anybody ask for acknowledgements.
        topic = f"{name}/_action/feedback"
        self._publisher = node.create_publisher(self._message, topic, QoSProfile(depth=10))
        self._topic = node.resolve_topic_name(topic)
        self._listeners: set[bytes] = set()
        self._silent, self._looked_at = 0.0, 0.0

    def begin(self) -> None:
        """A goal is being done: whoever listens from now on may be its client."""
        self._listeners, self._silent, self._looked_at = self._there, 0.0, time.monotonic()

    def publish(self, goal: Any, feedback: Any) -> None:
        """Publish the feedback of a goal."""
        self._publisher.publish(self._message(goal_id=goal.goal_id, feedback=feedback))

    @property
    def gone(self) -> bool:
        """Whether one that may be the client was killed, or all of them have left.

        To be asked some times a second, before `publish`.
        """
        now = time.monotonic()
        passed, self._looked_at = min(now - self._looked_at, _LONGEST_LOOK), now
        # Who is matched only after the goal has come may be the client, too.
        if not self._listeners:
            self._listeners = self._there
            return False
        if self._publisher.wait_for_all_acked(_NOW):
            self._silent = 0.0
        else:
            self._silent += passed
        # Of several nobody knows which one is silent, and which one's the goal is: the tip is safe without it.
        if self._silent > SILENCE:
            return True
        return self._publisher.get_subscription_count() < len(self._listeners) and not self._listeners & self._there

    @property
    def _there(self) -> set[bytes]:
        infos = self._node.get_subscriptions_info_by_topic(self._topic)
        return {bytes(info.endpoint_gid) for info in infos}
