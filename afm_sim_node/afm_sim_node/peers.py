"""Other nodes on the topics of the control loop."""

from collections import Counter
from collections.abc import Sequence

from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

from afm_node_common import topics
from afm_node_common.senders import UNKNOWN

from .managed import Managed


def _names(infos: Sequence[TopicEndpointInfo]) -> list[str]:
    """Full names of the known nodes of these endpoints, with repetitions."""
    names = [f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in infos]
    return sorted(name for name in names if UNKNOWN not in name)


class Peers:
    """Queries the middleware for publishers of drives, and for other publishers of measurements.

    Parameters
    ----------
    node : Node
    law_inside : bool
        Whether the law is inside the simulator, so that nobody takes drives.
    """

    def __init__(self, node: Node, *, law_inside: bool = False) -> None:
        self._node = node
        self._law_inside = law_inside
        self._managed = Managed(node)
        self._counted = 0
        self._known: dict[str, set[bytes]] = {}
        self._drives = node.resolve_topic_name(topics.PIEZO_DRIVE)
        self._measurements = node.resolve_topic_name(topics.MEASUREMENT)
        self.clock = node.resolve_topic_name(topics.clock(node.get_namespace()))
        """Full name of the topic of simulated time."""
        self.controllers: list[str] = []
        """Full names of the nodes whose drives are received."""
        self.incompatible = ""
        """Message about nodes whose drives cannot be received; empty if there is no such node."""

    @property
    def inactive(self) -> bool:
        """Whether a controller is a managed node that is not active."""
        if self._law_inside:
            return False
        self._managed.look(self.controllers)
        return self._managed.inactive(self.controllers)

    def silent(self) -> str:
        """Message about nodes that would answer only when they are active; for a run that waits for drives."""
        if self._law_inside:
            return ""
        self._managed.look(self.controllers)
        return self._managed.problem

    @property
    def controller(self) -> str:
        """Full names of the nodes whose drives are received."""
        return " and ".join(self.controllers)

    def look(self, *, force: bool = False) -> None:
        """Query the publishers of drives if their number has changed, or if `force`."""
        # Asking for names takes a while; asking how many does not.
        count = self._node.count_publishers(self._drives)
        if count == self._counted and not force:
            return
        self._counted = count
        infos = self._node.get_publishers_info_by_topic(self._drives)
        if self._law_inside:
            names = " and ".join(_names(infos))
            self.incompatible = f"{names} publishes piezo_drive, which is not used: the law is inside" if names else ""
            return
        incompatible = [info for info in infos if info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT]
        before, self.controllers = self.controllers, sorted(set(_names([i for i in infos if i not in incompatible])))
        self.incompatible = (
            f"{' and '.join(_names(incompatible))} publishes piezo_drive best effort: it must be reliable"
            if incompatible
            else ""
        )
        self._notice_restarts([info for info in infos if info not in incompatible])
        if len(self.controllers) > 1 and self.controllers != before:
            self._node.get_logger().warning(
                f"{self.controller} publish piezo_drive: each answers, the drives get mixed"
            )

    def _notice_restarts(self, infos: Sequence[TopicEndpointInfo]) -> None:
        """Report a controller that was killed and started again: the old one is still listed for some seconds."""
        for info in infos:
            for name in _names([info]):
                known = self._known.setdefault(name, set())
                if known and bytes(info.endpoint_gid) not in known:
                    self._node.get_logger().warning(
                        f"{name} publishes piezo_drive again: it was restarted, or there are two nodes of that name"
                    )
                known.add(bytes(info.endpoint_gid))

    def on_simulated_time(self) -> list[str]:
        """Return the full names of the controllers that subscribe to simulated time: those with `use_sim_time`."""
        listeners = _names(self._node.get_subscriptions_info_by_topic(self.clock))
        return sorted({*listeners} & {*self.controllers})

    def rivalry(self) -> str:
        """The sentence about other simulators on the same topics; empty if this one is alone."""
        if self._node.count_publishers(self._measurements) < 2:
            return ""
        infos = self._node.get_publishers_info_by_topic(self._measurements)
        names = Counter(_names(infos))
        # A moment later all names are known.
        if names.total() < len(infos):
            return ""
        listed = [name if count == 1 else f"{name} ({count} nodes of this name)" for name, count in names.items()]
        return (
            f"{' and '.join(listed)} publish {self._measurements}: a controller answers them all and no run is what it "
            "seems; end all but one, or give each a namespace"
        )
