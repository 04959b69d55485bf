"""Draws the parameters of the nodes, and their changes. Needs no ROS."""

from typing import Any

import numpy as np
import rerun as rr

from afm_model.core.shown import shown
from afm_model.parameters.strict_yaml import yaml_text

from .layout import PARAMETERS
from .parameter_values import ParameterValues, change_text
from .streams import Canvas


class ParameterWriter:
    """The parameters of all nodes, as text; a number that changes becomes a plot of steps too.

    Parameters
    ----------
    canvas : Canvas
    namespace : str
        Of the instrument.
    """

    def __init__(self, canvas: Canvas, namespace: str) -> None:
        self.values = ParameterValues(namespace)
        self._canvas = canvas
        self._steps: dict[str, float] = {}

    def put(self, message: Any, time_ns: int) -> None:
        """Draw an afm_msgs/Parameters. Raises InvalidMessage."""
        for change in self.values.put(message, time_ns):
            self._canvas.event(time_ns, shown(change_text(change)), "INFO")
            if isinstance(change.old, int | float) and isinstance(change.new, int | float):
                self._step(time_ns, change.node, change.name, float(change.old), float(change.new))
        if not message.changes:
            # The layout of a ROS parameter file, so that it can be copied from the viewer and used again.
            tree = {node: {"ros__parameters": values} for node, values in self.values.first.items()}
            self._canvas.static(PARAMETERS, rr.TextDocument(yaml_text(tree)))

    def finish(self, end_ns: int) -> None:
        """Let each step last until the end of the run."""
        for entity, value in self._steps.items():
            self._canvas.series(entity, np.array([end_ns]), np.array([value]))

    def _step(self, time_ns: int, node: str, name: str, old: float, new: float) -> None:
        entity = f"{PARAMETERS}/{rr.escape_entity_path_part(node)}/{rr.escape_entity_path_part(name)}"
        if entity not in self._steps:
            self._canvas.static(entity, rr.SeriesLines(names=f"{node} {name}", interpolation_mode="StepAfter"))
            self._canvas.series(entity, np.zeros(1, np.int64), np.array([old]))
        self._canvas.series(entity, np.array([time_ns]), np.array([new]))
        self._steps[entity] = new
