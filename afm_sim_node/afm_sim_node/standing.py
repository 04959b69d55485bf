"""Subscribers whose process stands still or was killed.

Fast DDS reaches a process on the same machine through a queue in shared memory. When nothing has read that queue for a
second, Fast DDS calls it unhealthy, and from then on makes and removes another one for each message, until it drops
the process after 20 s. No setting was found that avoids this and costs nothing else, so it is reported by name.
"""

import os
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

from afm_node_common.senders import UNKNOWN
from afm_node_common.shared_memory import used_by

_LOOKS = 5
"""Looks at processes between two queries of the middleware, which take longer; a new number of them is seen at once."""
_MACHINE, _PROCESS = slice(0, 4), slice(4, 6)
"""Bytes of an identifier of Fast DDS: its vendor and the machine, and the lower half of the process id."""
_STOPPED, _ZOMBIE = ("T", "t"), "Z"
_UNNAMED = "a node without a name"


class _Process(NamedTuple):
    name: str  # of its node
    pid: int
    begun: str  # when, in ticks of the system: another process may get its number


class StandingSubscribers:
    """Looks for subscribers of a topic, on this machine, whose process stands still or was killed.

    Parameters
    ----------
    node : Node
        It publishes the topic.
    topic : str
    """

    def __init__(self, node: Node, topic: str) -> None:
        self._node, self._topic = node, node.resolve_topic_name(topic)
        self._known: dict[bytes, _Process] = {}
        self._counted, self._looks = 0, 0

    def look(self) -> str:
        """Return a message about them, to be read once a second; empty if there is no such process.

        Of another machine, container, user or middleware than Fast DDS nothing is known.
        """
        self._looks += 1
        count = self._node.count_subscribers(self._topic)
        if count != self._counted or self._looks % _LOOKS == 0:
            # One that was stopped at its start never gives its name.
            self._query(unnamed=count == self._counted)
            self._counted = count
        return "; ".join(filter(None, map(self._about, self._known.values())))

    def _query(self, *, unnamed: bool) -> None:
        own = next(iter(self._node.get_publishers_info_by_topic(self._topic)), None)
        ends = {bytes(info.endpoint_gid): info for info in self._node.get_subscriptions_info_by_topic(self._topic)}
        self._known = {end: known for end, known in self._known.items() if end in ends and known.name != _UNNAMED}
        new = {
            end: info
            for end, info in ends.items()
            if end not in self._known and (unnamed or UNKNOWN not in info.node_name)
        }
        if own is None or not new:
            return
        pids = [int(entry) for entry in os.listdir("/proc") if entry.isdigit()]
        for end, info in new.items():
            if end[_MACHINE] == bytes(own.endpoint_gid)[_MACHINE] and (found := self._found(end, info, pids)):
                self._known[end] = found

    @staticmethod
    def _found(end: bytes, info: TopicEndpointInfo, pids: Iterable[int]) -> _Process | None:
        """The process of an endpoint: its number ends as the identifier says, and it uses the middleware."""
        half = int.from_bytes(end[_PROCESS], "little")
        name = _UNNAMED if UNKNOWN in info.node_name else f"{info.node_namespace.rstrip('/')}/{info.node_name}"
        found = [pid for pid in pids if pid & 0xFFFF == half and used_by(pid)]
        return _Process(name, found[0], _stat(found[0])[1]) if len(found) == 1 else None

    def _about(self, process: _Process) -> str:
        state, begun = _stat(process.pid)
        who = f"{process.name} (process {process.pid})"
        if begun != process.begun or state == _ZOMBIE:
            return (
                f"{who} was killed and is still listed as a subscriber of {self._topic}: the loop is slower until the "
                f"middleware drops it, within 20 s"
            )
        if state in _STOPPED:
            return (
                f"{who} is stopped and subscribes to {self._topic}: the loop is slower until it continues or ends, or "
                f"until the middleware drops it, within 20 s"
            )
        return ""


def _stat(pid: int) -> tuple[str, str]:
    """Return the state of a process, a letter, and when it began; empty if the process does not exist."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return "", ""
    return fields[0], fields[19]  # state and starttime of proc(5)
