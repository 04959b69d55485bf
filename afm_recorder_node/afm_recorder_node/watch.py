"""Reads the parameters of other nodes, and receives their changes."""

import math
import time
from collections.abc import Callable, Iterable
from typing import Any

from rcl_interfaces.msg import ParameterEvent, ParameterType
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.qos import qos_profile_parameter_events
from rclpy.task import Future

from afm_node_common.decoding import InvalidMessage, value_of
from afm_node_common.subscriptions import Subscriptions

_ANSWER_TIME = 5.0
"""Wall time within which a node answers the parameter services, or has none [s]."""

_AGAIN = 1.0
"""Wall time after which a node that has not answered is asked again [s], each time after twice as long: an answer that
is sent before the node has found who asked is lost."""

_TYPES = range(ParameterType.PARAMETER_BOOL, ParameterType.PARAMETER_STRING_ARRAY + 1)


def full_name(name: str, namespace: str) -> str:
    """Full name of a node."""
    return f"{namespace.rstrip('/')}/{name}"


class ParameterWatch:
    """Parameters of the nodes of one namespace, and of other given nodes.

    Parameters
    ----------
    node : the node that watches; it is not watched itself
    subscriptions : through which it hears of changes
    known : called with a node's full name and its values, once for each node
    changed : called with a node's full name, the name of a parameter, its old and its new value
    """

    def __init__(
        self,
        node: Node,
        subscriptions: Subscriptions,
        known: Callable[[str, dict[str, Any]], None],
        changed: Callable[[str, str, object, object], None],
    ) -> None:
        self.values: dict[str, dict[str, Any]] = {}
        self._node = node
        self._known = known
        self._changed = changed
        self._clients: dict[str, tuple[Client, Client]] = {}
        self._asked: dict[str, tuple[float, float]] = {}  # when, and for how long an answer is waited for
        self._missed_since: dict[str, float] = {}
        subscriptions.subscribe(ParameterEvent, "/parameter_events", self._on_event, qos_profile_parameter_events)

    def look(self, others: Iterable[str] = (), known: Iterable[str] = ()) -> None:
        """Query the nodes that are new since the last call, or have not answered; to be called periodically.

        Parameters
        ----------
        others : full names of nodes outside the namespace
        known : full names of nodes that publish their parameters themselves
        """
        namespace = self._node.get_namespace()
        there = {full_name(name, at): at for name, at in self._node.get_node_names_and_namespaces()}
        wanted = {name for name, at in there.items() if at == namespace or name in others}
        wanted -= {self._node.get_fully_qualified_name(), *known}
        # A node that has ended is queried again after a restart.
        self._asked = {name: asked for name, asked in self._asked.items() if name in wanted}
        now = time.monotonic()
        for name in wanted:
            at, patience = self._asked.get(name, (-math.inf, 0.5 * _AGAIN))
            if now < at + patience:
                continue
            list_names, get_values = self._clients_of(name)
            if list_names.service_is_ready() and get_values.service_is_ready():
                self._asked[name] = now, 2.0 * patience
                listed = list_names.call_async(ListParameters.Request())
                listed.add_done_callback(lambda future, name=name: self._on_names(name, future))

    def settled(self, names: Iterable[str]) -> bool:
        """Whether the parameters of these nodes are known; of one that does not answer, whether it had its time."""
        now = time.monotonic()
        waits = [now - self._missed_since.setdefault(name, now) for name in names if name not in self.values]
        return all(wait > _ANSWER_TIME for wait in waits)

    def _clients_of(self, name: str) -> tuple[Client, Client]:
        if name not in self._clients:
            self._clients[name] = (
                self._node.create_client(ListParameters, f"{name}/list_parameters"),
                self._node.create_client(GetParameters, f"{name}/get_parameters"),
            )
        return self._clients[name]

    def _on_names(self, node: str, listed: Future) -> None:
        names = sorted(listed.result().result.names)
        values = self._clients[node][1].call_async(GetParameters.Request(names=names))
        values.add_done_callback(lambda future: self._on_values(node, names, future))

    def _on_values(self, node: str, names: list[str], answered: Future) -> None:
        found = {
            name: value_of(value)
            for name, value in zip(names, answered.result().values, strict=False)
            if value.type in _TYPES
        }
        if node in self._asked:
            self._asked[node] = math.inf, math.inf
        if node in self.values:
            self._take(node, found)
        else:
            self.values[node] = found
            self._known(node, found)

    def _on_event(self, event: ParameterEvent) -> None:
        parameters = (*event.new_parameters, *event.changed_parameters)
        for parameter in parameters:
            if parameter.value.type not in (*_TYPES, ParameterType.PARAMETER_NOT_SET):
                raise InvalidMessage(
                    f"type {parameter.value.type} of parameter {parameter.name}: there is no such type"
                )
        if event.node in self.values:
            self._take(event.node, {p.name: value_of(p.value) for p in parameters if p.value.type in _TYPES})

    def _take(self, node: str, values: dict[str, Any]) -> None:
        known = self.values[node]
        for name, new in values.items():
            old = known.get(name)
            known[name] = new
            if old != new:
                self._changed(node, name, old, new)
