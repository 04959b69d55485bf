"""Entries on /diagnostics, for ordinary tools."""

from collections.abc import Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node


def entry(name: str, level: Any, message: str, values: Mapping[str, object]) -> DiagnosticStatus:
    """The state of one node as an entry of /diagnostics.

    Parameters
    ----------
    name : str
        Full name of the node, and its role.
    level
        Of DiagnosticStatus.
    message : str
    values : mapping
        Further values, by the name that is shown.
    """
    pairs = [KeyValue(key=key, value=str(value)) for key, value in values.items()]
    return DiagnosticStatus(level=level, name=name, message=message, hardware_id="virtual AFM", values=pairs)


def stamped(node: Node, status: DiagnosticStatus) -> DiagnosticArray:
    """An entry as a message, with the time of the node's clock."""
    array = DiagnosticArray(status=[status])
    array.header.stamp = node.get_clock().now().to_msg()
    return array
