"""The parameters of a node on a topic, with the run in which they hold."""

from collections.abc import Callable
from typing import Any

from afm_msgs.msg import Parameters
from rclpy.node import Node
from rclpy.parameter import Parameter

from afm_model.parameters import Group, flatten

from . import topics
from .parameters import Declared
from .stamps import stamp


class ParameterLog:
    """Publishes afm_msgs/Parameters: all parameters at the first look at a run, later those that have changed.

    Parameters
    ----------
    node : Node
    declared : Declared
        The parameters of the node.
    now : callable
        now(): run_id, and simulated time [ns].
    """

    def __init__(self, node: Node, declared: Declared[Any], now: Callable[[], tuple[int, int]]) -> None:
        self._declared, self._now, self._name = declared, now, node.get_fully_qualified_name()
        self._publisher = node.create_publisher(Parameters, topics.PARAMETERS, topics.EVENTS_QOS)
        self._run_id, self._known = 0, declared.current

    def look(self) -> None:
        """Publish what is new; to be called from time to time, and before a run is left."""
        run_id, time_ns = self._now()
        current: Group = self._declared.current
        if run_id == self._run_id and current is self._known:
            return
        changes = run_id == self._run_id
        before, values = flatten(self._known) if changes else {}, flatten(current)
        self._run_id, self._known = run_id, current
        news = [Parameter(name, value=value) for name, value in values.items() if before.get(name) != value]
        # What is no longer there, as those of another sample: a parameter without a value.
        news += [Parameter(name, Parameter.Type.NOT_SET) for name in before.keys() - values.keys()]
        if run_id and news:
            message = Parameters(run_id=run_id, node=self._name, changes=changes)
            message.header.frame_id, message.header.stamp = topics.FRAME, stamp(time_ns)
            message.parameters = [each.to_parameter_msg() for each in news]
            self._publisher.publish(message)
