"""Draws the parameters of the nodes, and their changes. Needs no ROS."""

from collections.abc import Mapping

import numpy as np
import rerun as rr

from afm_model.core.shown import shown
from afm_model.parameters.strict_yaml import yaml_text

from .layout import PARAMETERS
from .parameter_values import change_text
from .recording import ParameterChange, Value
from .streams import Canvas


class ParameterWriter:
    """The parameters of all nodes, as text; a number that changes becomes a plot of steps too."""

    def __init__(self, canvas: Canvas) -> None:
        self._canvas = canvas
        self._steps: dict[str, float] = {}

    def known(self, nodes: Mapping[str, Mapping[str, Value]]) -> None:
        """Draw the parameters of all nodes, as they were first."""
        # The layout of a ROS parameter file, so that it can be copied from the viewer and used again.
        text = yaml_text({node: {"ros__parameters": values} for node, values in nodes.items()})
        self._canvas.static(PARAMETERS, rr.TextDocument(text))

    def changed(self, time_ns: int, change: ParameterChange) -> None:
        """Draw a change at a simulated time [ns]."""
        self._canvas.event(time_ns, shown(change_text(change)), "INFO")
        if not isinstance(change.old, int | float) or not isinstance(change.new, int | float):
            return
        entity = "/".join([PARAMETERS, *map(rr.escape_entity_path_part, (change.node, change.name))])
        times, values = [time_ns], [float(change.new)]
        if entity not in self._steps:
            name = f"{change.node} {change.name}"
            self._canvas.static(entity, rr.SeriesLines(names=name, interpolation_mode="StepAfter"))
            times, values = [0, *times], [float(change.old), *values]
        self._canvas.series(entity, np.array(times), np.array(values))
        self._steps[entity] = float(change.new)

    def finish(self, end_ns: int) -> None:
        """Let each step last until the end of the run."""
        for entity, value in self._steps.items():
            self._canvas.series(entity, np.array([end_ns]), np.array([value]))
