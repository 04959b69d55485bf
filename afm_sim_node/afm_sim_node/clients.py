"""Whether the client of a goal is still there, which rclpy's action server does not report."""

import time
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile
from unique_identifier_msgs.msg import UUID

from afm_node_common import topics

SILENCE = 3.0
"""Wall time without an acknowledgement after which a client counts as gone, and in which it is found [s]."""
_LONGEST_LOOK = 0.5
"""Wall time between two looks that counts at most [s]: while this process stood still, nobody could be heard."""
_NOW = Duration(seconds=0)


class TopicListeners:
    """Those who listen to a topic. The middleware acknowledges what it receives, however busy its process is, unless
    that was killed or stopped; without this the middleware here would take twenty seconds to notice.

    Parameters
    ----------
    node : Node
    kind : type
        Of the messages.
    topic : str
    """

    def __init__(self, node: Node, kind: Any, topic: str) -> None:
        self._node, self._topic = node, node.resolve_topic_name(topic)
        self._publisher = node.create_publisher(kind, topic, QoSProfile(depth=10))
        self.publish = self._publisher.publish
        self.begin()

    def begin(self, process: bytes = b"") -> None:
        """From now on those are meant that listen now, or are found soon, if their identifier begins with `process`."""
        self._process = process
        self.meant = {one for one in self._there() if one.startswith(process)}
        self._silent, self._passed, self._looked_at = 0.0, 0.0, time.monotonic()

    def destroy(self) -> None:
        """Let the node be destroyed."""
        self._node.destroy_publisher(self._publisher)

    def gone(self) -> bool:
        """Whether all that are meant are gone for certain: they have left, or the only one there is silent.

        To be asked some times a second, before `publish`.
        """
        now, there = time.monotonic(), self._there()
        passed, self._looked_at = min(now - self._looked_at, _LONGEST_LOOK), now
        self._passed += passed
        if self._passed < SILENCE or not self.meant:
            self.meant |= {one for one in there if one.startswith(self._process)}
        # Of several nobody knows which one is silent; the middleware may miss one a moment before the graph does.
        several = max(len(there), self._publisher.get_subscription_count()) > 1
        acknowledged = self._publisher.wait_for_all_acked(_NOW)
        self._silent = 0.0 if several or acknowledged else self._silent + passed
        return bool(self.meant) and (not self.meant & there or self._silent > SILENCE)

    def _there(self) -> set[bytes]:
        """Who listens, living or not yet missed by the middleware."""
        return {bytes(info.endpoint_gid) for info in self._node.get_subscriptions_info_by_topic(self._topic)}


def process_of(identifier: bytes) -> bytes:
    """What all identifiers of the process begin with that has this one; empty: not known."""
    return identifier[:12]


class Clients:
    """Publishes the feedback of goals, and knows by it whether their client is still there.

    A client that subscribes to the topic of its goals (`topics.client`) is known by that. Any other is known by its
    request, which names its process as the subscription of the feedback does that every client has.

    Parameters
    ----------
    node : Node
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._feedback: dict[str, TopicListeners] = {}
        self._known: TopicListeners | None = None
        self._topic = ""

    def begin(self, kind: Any, name: str, goal: Any, process: bytes) -> None:
        """A goal of the action `name` is being done, for this process (see `process_of`)."""
        if name not in self._feedback:
            # A second publisher beside that of the action server, which does not let anybody ask for acknowledgements.
            self._feedback[name] = TopicListeners(self._node, kind.Impl.FeedbackMessage, f"{name}/_action/feedback")
        self._feedback[name].begin(process)
        topic = self._node.resolve_topic_name(topics.client(goal.goal_id.uuid))
        if self._known is not None and self._topic == topic:
            self._known.begin()
        elif self._known is not None:
            self._known.destroy()
            self._known = None
        self._topic = topic

    def look(self, kind: Any, name: str, goal: Any, feedback: Any) -> bool:
        """Publish the feedback of the goal that is being done, some times a second.

        Returns
        -------
        bool
            Whether its client has gone.
        """
        if self._known is None and self._node.count_subscribers(self._topic):
            self._known = TopicListeners(self._node, UUID, self._topic)
        # First: what is published now has not been acknowledged yet.
        gone = (self._known or self._feedback[name]).gone()
        self._feedback[name].publish(kind.Impl.FeedbackMessage(goal_id=goal.goal_id, feedback=feedback))
        if self._known is not None:
            self._known.publish(goal.goal_id)
        return gone
