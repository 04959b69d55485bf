"""What happens in a run, on a topic: faults and verbs, as they begin and end."""

from afm_msgs.msg import Event
from rclpy.node import Node

from afm_model.core.shown import shown
from afm_node_common import topics
from afm_node_common.stamps import stamp


class Events:
    """Publishes afm_msgs/Event.

    Parameters
    ----------
    node : Node
    """

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(Event, topics.EVENTS, topics.EVENTS_QOS)

    def publish(self, run_id: int, tick: int, stamp_ns: int, text: str, *, warn: bool) -> None:
        """Publish what has happened in a run at a control tick, at a simulated time [ns]; `warn`: not as asked."""
        message = Event(run_id=run_id, tick=tick, text=shown(text), level=Event.WARN if warn else Event.INFO)
        message.header.frame_id = topics.FRAME
        message.header.stamp = stamp(stamp_ns)
        self._publisher.publish(message)
