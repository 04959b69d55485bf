"""The parameters of nodes during a run, from the messages that bring them and their changes. Needs no ROS."""

from typing import Any

from afm_node_common.decoding import value_of

from .recording import ParameterChange, Value


class ParameterValues:
    """The parameters of each node, as they are after the messages up to now.

    Parameters
    ----------
    namespace : str
        Of the instrument: nodes in it are called by their short names.
    """

    def __init__(self, namespace: str) -> None:
        self._space = f"{namespace.rstrip('/')}/"
        self.first: dict[str, dict[str, Value]] = {}
        """By node and name, as they were first known."""
        self._now: dict[str, dict[str, Value]] = {}

    @property
    def height(self) -> float:
        """Height of the cantilever's rest position [m]; NaN: not known yet."""
        found = self.first.get("afm_sim_node", {}).get("cantilever.a")
        return float(found) if isinstance(found, int | float) else float("nan")

    def put(self, message: Any, time_ns: int) -> list[ParameterChange]:
        """Take an afm_msgs/Parameters; what it changes. Raises InvalidMessage."""
        node = message.node.removeprefix(self._space)
        is_new = node not in self.first
        first, now = self.first.setdefault(node, {}), self._now.setdefault(node, {})
        changes = []
        for each in message.parameters:
            value = value_of(each.value)
            if value is None:  # it has gone with the part that had it
                now.pop(each.name, None)
                continue
            if is_new and not message.changes:
                first[each.name] = value
            elif now.get(each.name) != value:
                changes.append(ParameterChange(time_ns / 1e9, node, each.name, now.get(each.name), value))
            now[each.name] = value
        return changes


def change_text(change: ParameterChange) -> str:
    """A change as an event."""
    if change.old is None:
        return f"{change.node}: {change.name} is {change.new}"
    return f"{change.node}: {change.name} changed from {change.old} to {change.new}"
