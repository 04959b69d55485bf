"""Writes the parameters of the nodes into one recording, and their changes. Needs no ROS."""

import json
from collections.abc import Mapping

import numpy as np
import rerun as rr

from afm_model.core.shown import shown
from afm_model.parameters.strict_yaml import yaml_text

from .layout import PARAMETERS
from .sink import Sink


class ParameterWriter:
    """The parameters of all nodes, as text; a number that changes becomes a plot of steps too.

    Parameters
    ----------
    sink : Sink
    """

    def __init__(self, sink: Sink) -> None:
        self._sink = sink
        self._known: dict[str, dict[str, object]] = {}
        self._steps: dict[str, float] = {}

    def known(self, node: str, values: Mapping[str, object]) -> None:
        """Parameters of a node as they are when the recording begins, or when the node appears."""
        self._known.setdefault(node, {}).update((name, _plain(value)) for name, value in values.items())
        # The layout of a ROS parameter file, so that it can be copied from the viewer and used again.
        tree = {name: {"ros__parameters": known} for name, known in self._known.items()}
        self._sink.static(PARAMETERS, rr.TextDocument(yaml_text(tree)))

    def changed(self, time_ns: int, node: str, name: str, old: object, new: object) -> bool:
        """A parameter has changed; whether it is plotted."""
        # A parameter of bytes is a list of bytes, which JSON does not have.
        change = json.dumps({"node": node, "name": name, "old": old, "new": new}, default=list)
        text = f"{node}: {name} is {new}" if old is None else f"{node}: {name} changed from {old} to {new}"
        self._sink.event(time_ns, shown(text), change=change)
        if not isinstance(old, int | float) or not isinstance(new, int | float):
            return False
        entity = f"{PARAMETERS}/{rr.escape_entity_path_part(node)}/{rr.escape_entity_path_part(name)}"
        if entity not in self._steps:
            self._sink.static(entity, rr.SeriesLines(names=f"{node} {name}", interpolation_mode="StepAfter"))
            self._sink.series(entity, np.zeros(1, np.int64), np.array([float(old)]))
        self._sink.series(entity, np.array([time_ns]), np.array([float(new)]))
        self._steps[entity] = float(new)
        return True

    def finish(self, end_ns: int) -> None:
        """A step lasts until the end of the recording."""
        for entity, value in self._steps.items():
            self._sink.series(entity, np.array([end_ns]), np.array([value]))


def _plain(value: object) -> object:
    """Return a value as text can hold it: bytes as numbers."""
    if isinstance(value, list) and value and isinstance(value[0], bytes):
        return [number for each in value for number in each]
    return value
