"""Draws the messages of one run with rerun: signals, events, parameters, images, results. Needs no ROS."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from afm_model.core.shown import shown
from afm_node_common.decoding import InvalidMessage, nanoseconds

from . import checks, layout, messages
from .friction_loop import FrictionLoop
from .gathering import Gathering
from .layout import Signal, instants
from .parameter_writer import ParameterWriter
from .places import Source
from .record import Entry
from .results import drawings
from .scan_writer import ScanWriter
from .scene import Scene
from .score_text import markdown
from .streams import Canvas, Range

_HELD = 500
"""Blocks of control ticks that wait for the height of the cantilever, at most."""


class ViewWriter:
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
        self.canvas = Canvas(stream, below, ranges)
        self._title, self._color = about.get("title") or title, color
        self._parameters = ParameterWriter(self.canvas, about.get("namespace", ""))
        self._scans, self._results = ScanWriter(self.canvas), Gathering()
        self._loop, self._scene = FrictionLoop(), Scene()
        self.canvas.looks += [self._loop.put, self._scene.put]
        self._signals = {signal.name: signal for signal in layout.CHANNELS}
        self._held: list[Any] | None = []  # control traces, until the height of the cantilever is known
        self._state: messages.StateText | None = None
        self._end_ns, self._refused, self._why = 0, 0, ""
        self._takes: Mapping[str, Callable[[str, Any], None]] = {
            "afm_msgs/msg/Waveform": self._waveform,
            "afm_msgs/msg/ControlTrace": self._trace,
            "afm_msgs/msg/InstrumentStatus": self._status,
            "afm_msgs/msg/Event": self._event,
            "afm_msgs/msg/Parameters": self._parameter,
            "afm_msgs/msg/Score": self._score,
            "afm_msgs/msg/ScanLine": self._line,
            "afm_msgs/msg/NamedArray": self._array,
        }
        for signal in (*layout.CHANNELS, *layout.TICKS):
            self._declare(signal)
        self._describe()

    def put(self, entry: Entry) -> None:
        """Draw a message; one that cannot be drawn is counted."""
        if (take := self._takes.get(entry.kind)) is not None:
            try:
                take(entry.topic, entry.message)
            except InvalidMessage as error:
                self._refused, self._why = self._refused + 1, f"{entry.topic}: {error}"

    def draw(self, record: Source) -> None:
        """Draw all of a record. Raises RecordingError if it cannot be read."""
        for entry in record.messages():
            self.put(entry)
        self.finish(record.missing)

    def finish(self, missing: str = "") -> None:
        """Draw what shows the run as a whole, and what is `missing` of it; send all."""
        self._release()
        self._parameters.finish(self._end_ns)
        self._scans.finish()
        if missing:
            self.canvas.event(self._end_ns, shown(f"This recording is not complete: {missing}"), "ERROR")
        if self._refused:
            text = f"{self._refused} messages are not shown, the last one because of {self._why}"
            self.canvas.event(self._end_ns, shown(text), "WARN")
        self.canvas.flush()
        self._loop.send(self.canvas)
        self._scene.send(self.canvas, self._scans.surface)

    def _waveform(self, topic: str, message: Any) -> None:
        signal = self._signals.get(topic)
        if signal is None:
            signal = layout.signal(topic, message.unit)
            if not layout.further([signal.entity]):
                raise InvalidMessage("something else is shown under this name")
            self._signals[topic] = signal
            self._declare(signal)
        checks.block(message.first_sample, message.sample_period, len(message.samples))
        if message.unit != signal.si_unit:
            raise InvalidMessage(f"unit {message.unit[:40]!r}: this channel is in {signal.si_unit!r}")
        times = instants(message.first_sample, len(message.samples), message.sample_period)
        self._series(signal, times, np.asarray(message.samples) * (message.scale * signal.factor))

    def _trace(self, topic: str, message: Any) -> None:
        checks.block(message.first_sequence, message.control_period, len(message.deflection))
        checks.control_trace(message)
        if self._held is None:
            self._ticks(message)
            return
        self._held.append(message)
        if not np.isnan(self._parameters.values.height) or len(self._held) > _HELD:
            self._release()

    def _release(self) -> None:
        held, self._held = self._held, None
        for message in held or ():
            self._ticks(message)

    def _ticks(self, message: Any) -> None:
        """Draw a block of control ticks: the error is that of the scanner, along z that of the tip."""
        found = messages.columns(message)
        error = found["position"] - found["reference"]
        error[:, 2] = self._parameters.values.height + found["deflection"] - found["reference"][:, 2]
        times = instants(message.first_sequence, len(error), message.control_period)
        for signal, values in (
            (layout.POSITION, found["position"]),
            (layout.REFERENCE, found["reference"]),
            (layout.ERROR, error),
            (layout.DRIVE, found["drive"]),
            (layout.ROUND_TRIP, found["round_trip"].astype(np.float64)),
        ):
            self._series(signal, times, values * signal.factor)

    def _status(self, topic: str, message: Any) -> None:
        told = messages.state(message)
        if told != self._state:
            self._state = told
            self._text(message, told.text, told.level)

    def _event(self, topic: str, message: Any) -> None:
        self._text(message, message.text, messages.level(message))

    def _score(self, topic: str, message: Any) -> None:
        self._describe(messages.score(message))
        self._text(message, "the score of the run is here", "INFO")

    def _parameter(self, topic: str, message: Any) -> None:
        checks.stamp(message)
        time_ns = nanoseconds(message.header.stamp)
        self._parameters.put(message, time_ns)
        if message.changes:
            self._end_ns = max(self._end_ns, time_ns)

    def _line(self, topic: str, message: Any) -> None:
        self._scans.put(checks.scan_line(message))

    def _array(self, topic: str, message: Any) -> None:
        """Draw what a verb has brought back when its last array is here; that of another verb stays."""
        result = self._results.put(checks.result_part(message))
        if result is None:
            return
        for entity, columns in drawings(result).items():
            self.canvas.rows(entity, np.array([result.time_ns]), columns)

    def _text(self, message: Any, text: str, level: str) -> None:
        checks.stamp(message)
        self.canvas.event(nanoseconds(message.header.stamp), shown(text), level)

    def _series(self, signal: Signal, times: NDArray[np.int64], values: NDArray[np.float64]) -> None:
        self.canvas.series(signal.entity, times, values)
        self._end_ns = max(self._end_ns, int(times[-1]))

    def _declare(self, signal: Signal) -> None:
        names, colors = signal.names, signal.colors
        if self._color:
            run = self.canvas.below.removeprefix("/")
            names, colors = [f"{run}: {name}" for name in names], (self._color,) * signal.width
        self.canvas.static(signal.entity, rr.SeriesLines(names=names, colors=colors))

    def _describe(self, score: Mapping[str, object] | None = None) -> None:
        """Write title and score as they are read in the viewer."""
        text = rr.TextDocument(markdown(self._title, score), media_type=rr.MediaType.MARKDOWN)
        self.canvas.static(layout.RUN, text)
