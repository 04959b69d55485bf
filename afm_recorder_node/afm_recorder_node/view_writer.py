"""Draws the messages of one run with rerun: signals, events, parameters, images, results. Needs no ROS."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import rerun as rr

from afm_model.core.shown import shown
from afm_model.parameters.strict_yaml import yaml_text
from afm_node_common.decoding import InvalidMessage

from . import layout
from .canvas import Canvas, Range
from .gathering import Result
from .layout import PlotSignal
from .loop_drawing import LoopPoints
from .messages import Level
from .parameter_values import change_text
from .places import MessageSource
from .record import RecordEntry
from .recording import ParameterChange
from .result_views import drawings
from .scan_lines import ScanLine
from .scan_writer import ScanWriter
from .scene import Scene
from .score_text import markdown
from .visitor import Array, Times, Visitor


class ViewWriter(Visitor):
    """Takes the messages of a run in order and draws them.

    Parameters
    ----------
    stream : rr.RecordingStream
    about : mapping of str to str
        Of the record: namespace of the instrument, and title.
    title : str
        What the viewer calls the run, if the record has no title.
    below : str
        Entity below which all stands, such as /tanh, if the stream shows several runs; empty: one run only.
    color : (r, g, b), optional
        Of all curves of the run, if the stream shows several.
    ranges : dict, optional
        See `Canvas`.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        about: Mapping[str, str],
        title: str,
        *,
        below: str = "",
        color: tuple[int, int, int] | None = None,
        ranges: dict[tuple[str, int], Range] | None = None,
    ) -> None:
        super().__init__(about)
        self.canvas = Canvas(stream, below, ranges)
        self._title, self._color = about.get("title") or title, color
        self._scans = ScanWriter(self.canvas)
        self._loop, self._scene = LoopPoints(), Scene()
        self._steps: dict[str, float] = {}  # entities of numbers that have changed, and their last values
        self._end_ns, self._refused, self._why = 0, 0, ""
        self._describe()

    def put(self, entry: RecordEntry) -> None:
        """Draw a message; one that cannot be drawn is counted."""
        try:
            super().put(entry)
        except InvalidMessage as error:
            self._refused, self._why = self._refused + 1, f"{entry.topic}: {error}"

    def draw(self, record: MessageSource) -> None:
        """Draw all of a record. Raises RecordingError if it cannot be read."""
        for entry in record.messages():
            self.put(entry)
        self.conclude(record.missing)

    def flush(self) -> None:
        """Send all that has been drawn."""
        super().flush()
        self.canvas.flush()

    def conclude(self, missing: str) -> None:
        """Draw what shows the run as a whole, and what is `missing` of it; no message follows."""
        self.finish()
        for entity, value in self._steps.items():  # a step lasts until the end
            self.canvas.series(entity, np.array([self._end_ns]), np.array([value]))
        self._scans.finish()
        if missing:
            self.event(self._end_ns, f"This recording is not complete: {missing}", "ERROR")
        if self._refused:
            self.event(self._end_ns, f"{self._refused} messages are not shown, the last one: {self._why}", "WARN")
        self._loop.send(self.canvas)
        self._scene.send(self.canvas, self._scans.surface)
        self.canvas.flush()

    def rows(self, signal: PlotSignal, times: Times, values: Array) -> None:
        """See `Visitor.rows`."""
        if signal.entity not in self.canvas.sent:
            names, colors = signal.names, signal.colors
            if self._color:
                run = self.canvas.below.removeprefix("/")
                names, colors = [f"{run}: {name}" for name in names], (self._color,) * signal.width
            self.canvas.static(signal.entity, rr.SeriesLines(names=names, colors=colors))
        plotted = values * signal.factor
        self.canvas.series(signal.entity, times, plotted)
        self._loop.put(signal.entity, times, plotted)
        self._scene.put(signal.entity, times, plotted)
        self._end_ns = max(self._end_ns, int(times[-1]))

    def event(self, time_ns: int, text: str, level: Level) -> None:
        """See `Visitor.event`."""
        self.canvas.event(time_ns, shown(text), level)

    def parameters(self, entry: RecordEntry, changes: list[ParameterChange]) -> None:
        """Draw the parameters of all nodes as text, and their changes as events; of a number as a plot of steps too."""
        if entry.message.changes:
            self._end_ns = max(self._end_ns, entry.time_ns)
        else:
            # The layout of a ROS parameter file, so that it can be copied from the viewer and used again.
            text = yaml_text({node: {"ros__parameters": values} for node, values in self.known.first.items()})
            self.canvas.static(layout.PARAMETERS, rr.TextDocument(text))
        for change in changes:
            self.event(entry.time_ns, change_text(change), "INFO")
            if isinstance(change.old, int | float) and isinstance(change.new, int | float):
                self._step(entry.time_ns, f"{change.node} {change.name}", change.old, change.new)

    def _step(self, time_ns: int, name: str, old: float, new: float) -> None:
        entity = "/".join([layout.PARAMETERS, *map(rr.escape_entity_path_part, name.split(" ", 1))])
        times, values = [time_ns], [float(new)]
        if entity not in self._steps:
            self.canvas.static(entity, rr.SeriesLines(names=name, interpolation_mode="StepAfter"))
            times, values = [0, time_ns], [float(old), float(new)]
        self.canvas.series(entity, np.array(times), np.array(values))
        self._steps[entity] = float(new)

    def score(self, time_ns: int, score: dict[str, Any]) -> None:
        """See `Visitor.score`."""
        self._describe(score)
        self.event(time_ns, "the score of the run is here", "INFO")

    def line(self, line: ScanLine) -> None:
        """See `Visitor.line`."""
        self._scans.put(line)

    def result(self, result: Result) -> None:
        """Draw what a verb has brought back; that of another verb stays."""
        for entity, columns in drawings(result).items():
            self.canvas.rows(entity, np.array([result.time_ns]), columns)

    def _describe(self, score: Mapping[str, object] | None = None) -> None:
        """Write title and score as they are read in the viewer."""
        text = rr.TextDocument(markdown(self._title, score), media_type=rr.MediaType.MARKDOWN)
        self.canvas.static(layout.RUN, text)
