"""Managed (lifecycle) nodes that are not active: they are listed as controllers, and do not answer."""

import time
from collections.abc import Sequence
from typing import Any

from lifecycle_msgs.srv import GetState
from rclpy.node import Node

_ACTIVE = "active"
_TYPE, _SERVICE = "lifecycle_msgs/srv/GetState", "/get_state"
_PERIOD = 0.2
"""Wall time between two looks [s]."""
_PATIENCE = 5.0
"""Wall time after which a node that does not say its state counts as active [s]."""


class Managed:
    """Requests the state of every managed node in the namespace of a node.

    Parameters
    ----------
    node : Node
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients: dict[str, Any] = {}
        self._asked: dict[str, Any] = {}
        self._states: dict[str, str] = {}
        self._since: dict[str, float] = {}
        self._looked_at, self._looked_for = float("-inf"), list[str]()

    def look(self, controllers: Sequence[str]) -> None:
        """Find managed nodes and request their states; the answers come later. Call it while a run does not go on."""
        now = time.monotonic()
        if now < self._looked_at + _PERIOD and list(controllers) == self._looked_for:
            return
        self._looked_at, self._looked_for = now, list(controllers)
        inside = f"{self._node.get_namespace().rstrip('/')}/"
        there = {
            service.removesuffix(_SERVICE)
            for service, types in self._node.get_service_names_and_types()
            if _TYPE in types and service.startswith(inside) and service.endswith(_SERVICE)
        }
        for name in self._clients.keys() - there:
            self._node.destroy_client(self._clients.pop(name))
            for each in (self._asked, self._states, self._since):
                each.pop(name, None)
        for name in there:
            self._ask(name, now)

    def _ask(self, name: str, now: float) -> None:
        if name not in self._clients:
            self._clients[name] = self._node.create_client(GetState, f"{name}{_SERVICE}")
            self._states[name], self._since[name] = "", now
        asked, client = self._asked.get(name), self._clients[name]
        if asked is not None and asked.done():
            answer = asked.result()
            self._states[name] = answer.current_state.label if answer is not None else _ACTIVE
        elif asked is not None or not client.service_is_ready():
            if not self._states[name] and now > self._since[name] + _PATIENCE:
                self._states[name] = _ACTIVE
            return
        self._asked[name] = client.call_async(GetState.Request())

    def inactive(self, controllers: Sequence[str]) -> bool:
        """Whether one of these nodes is known not to be active, or has not said yet."""
        return any(self._states.get(name, _ACTIVE) != _ACTIVE for name in controllers)

    @property
    def problem(self) -> str:
        """A message about managed nodes that are not active; empty if all are active."""
        return "; ".join(
            f"{name} is a managed (lifecycle) node in state {state}, and a controller answers only when it is active: "
            f"ros2 lifecycle set {name} {'activate' if state == 'inactive' else 'configure, then activate'}"
            for name, state in sorted(self._states.items())
            if state not in ("", _ACTIVE)
        )
