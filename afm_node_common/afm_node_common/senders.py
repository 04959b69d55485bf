"""How many nodes publish a topic: a killed one is still listed for as long as the middleware takes to miss it."""

import time
from collections import defaultdict
from collections.abc import Callable
from itertools import pairwise

from rclpy.node import Node

UNKNOWN = "_UNKNOWN_"
"""Part of the name of a node that the middleware does not know yet."""
LEASE = 25.0
"""Wall time after which an endpoint that is still listed is that of a living node [s]; Fast DDS misses one in 20 s."""
_NAMED = 5.0
"""Wall time within which the name of a node becomes known [s]."""


class Senders:
    """Counts the nodes that publish a topic.

    A second endpoint of one name is a node that was killed and started again, unless both are listed for LEASE, or were
    found at the same time: a killed node is not found any more.

    Parameters
    ----------
    node : Node
    topic : str
    clock : callable
        Steady wall time [s].
    """

    def __init__(self, node: Node, topic: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._node, self._topic, self._clock = node, node.resolve_topic_name(topic), clock
        self._since: dict[bytes, float] = {}
        self._known = defaultdict[str, set[bytes]](set)
        self.restarted: list[str] = []
        """Full names of nodes that were started again, one for each time; whoever reads them may clear the list."""

    def count(self) -> int:
        """Number of nodes that publish the topic; call it some times a second."""
        now, named = self._clock(), defaultdict[str, list[float]](list)
        since: dict[bytes, float] = {}
        for info in self._node.get_publishers_info_by_topic(self._topic):
            end = bytes(info.endpoint_gid)
            since[end] = self._since.get(end, now)
            name = f"{info.node_namespace.rstrip('/')}/{info.node_name}"
            if UNKNOWN not in name:
                named[name].append(since[end])
                self._note(name, end)
            elif now > since[end] + _NAMED:
                named[f"{name} {end.hex()}"].append(since[end])
        self._since = since
        return sum(1 + self._others(sorted(times), now) for times in named.values())

    def _note(self, name: str, end: bytes) -> None:
        known = self._known[name]
        if known and end not in known:
            self.restarted.append(name)
        known.add(end)

    @staticmethod
    def _others(times: list[float], now: float) -> int:
        """How many of the endpoints of one name, found at these times, live in addition to the last one."""
        return sum(newer == older or now > newer + LEASE for older, newer in pairwise(times))
