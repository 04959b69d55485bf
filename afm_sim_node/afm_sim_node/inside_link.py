"""The link of a simulator with its law inside: no topics of the control loop."""

import time
from collections.abc import Callable

from afm_msgs.msg import Measurement
from rclpy.node import Node

from afm_node_common import topics
from afm_node_common.process import SimNodeParameters

from .peers import Peers
from .topic_link import NodeLink


class InsideLink(NodeLink):
    """Publishes nothing on `measurement` and takes no drive.

    The publisher of `measurement` is there all the same: by it everybody sees that this simulator is. Its parameters
    are those of `TopicLink`.
    """

    def __init__(self, node: Node, parameters: SimNodeParameters, peers: Peers, recorders: Callable[[], int]) -> None:
        super().__init__(parameters, peers, recorders)
        self._presence = node.create_publisher(Measurement, topics.MEASUREMENT, topics.CONTROL_QOS)
        self._law = parameters.law.kind
        self.fast_path: dict[str, bool] = {}
        """Fast ways of the control loop in use: none is needed."""
        self.wait: Callable[[float], None] = time.sleep
        """wait(timeout): there is nothing to wake for."""

    @property
    def controllers(self) -> list[str]:
        """Which law is inside."""
        return [f"inside ({self._law})"]

    def close(self) -> None:
        """Let the node be destroyed."""
