"""What the messages of a run say: signals in stretches, events, parameters, lines of scans, results. Needs no ROS."""

from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from afm_node_common.decoding import InvalidMessage

from . import checks, layout, messages
from .gathering import Gathering, Result
from .layout import PlotSignal, instants
from .names import is_channel
from .parameter_values import ParameterValues
from .record import RecordEntry
from .recording import ParameterChange
from .scan_lines import ScanLine

Array = NDArray[np.float64]
Times = NDArray[np.int64]
_ROWS = 32_768
"""Rows of a signal that are given at once, more or less."""
_HELD = 500
"""Blocks of control ticks that wait for the height of the cantilever, at most."""


class Visitor:
    """Gets the messages of a run in order, and calls its own methods with what they say: a subclass has those it wants.

    Parameters
    ----------
    about : mapping of str to str
        Of the record.
    ticks : sequence of PlotSignal
        Signals of the control ticks that are wanted.
    """

    def __init__(self, about: Mapping[str, str], ticks: Sequence[PlotSignal] = layout.TICKS) -> None:
        self.signals: dict[str, PlotSignal] = {}
        """By name, those that have come."""
        self.scales: dict[str, float] = {}
        """Of each channel, as they were last: SI units per unit as converted."""
        self.known = ParameterValues(about.get("namespace", ""))
        self._ticks = ticks
        self._waiting: dict[str, list[tuple[Times, Array]]] = defaultdict(list)
        self._counts = Counter[str]()  # rows that wait
        self._held: list[Any] | None = []  # control traces, until the height of the cantilever is known
        self._state = messages.StateText("", "INFO")
        self._gathering = Gathering()
        self._takes: Mapping[str, Callable[[RecordEntry], None]] = {
            "afm_msgs/msg/Waveform": self._waveform,
            "afm_msgs/msg/ControlTrace": self._trace,
            "afm_msgs/msg/InstrumentStatus": self._status,
            "afm_msgs/msg/Event": lambda e: self.event(e.time_ns, e.message.text, messages.level(e.message)),
            "afm_msgs/msg/Parameters": lambda e: self.parameters(e, self.known.put(e.message, e.time_ns)),
            "afm_msgs/msg/Score": lambda e: self.score(e.time_ns, messages.score(e.message)),
            "afm_msgs/msg/ScanLine": lambda e: self.line(checks.scan_line(e.message)),
            "afm_msgs/msg/NamedArray": self._array,
        }

    def rows(self, signal: PlotSignal, times: Times, values: Array) -> None:
        """Rows of a signal: times (n,) [ns], numbers (n, width) in SI units."""

    def event(self, time_ns: int, text: str, level: messages.Level) -> None:
        """An event, or a new state of the instrument."""

    def parameters(self, entry: RecordEntry, changes: list[ParameterChange]) -> None:
        """Parameters of a node, and what has changed; `known` has them already."""

    def score(self, time_ns: int, score: dict[str, Any]) -> None:
        """The score of the run."""

    def line(self, line: ScanLine) -> None:
        """One direction of one line of a scan."""

    def result(self, result: Result) -> None:
        """What a verb has brought back."""

    @property
    def height(self) -> float:
        """Height of the cantilever's rest position [m]; NaN: not known."""
        return self.known.height

    def put(self, entry: RecordEntry) -> None:
        """Take a message. Raises InvalidMessage."""
        if (take := self._takes.get(entry.kind)) is not None:
            take(entry)

    def flush(self) -> None:
        """Give the rows that wait until there are many."""
        for name in list(self._waiting):
            self._give(name)

    def finish(self) -> None:
        """Give all that waits: no message follows."""
        self._release()
        self.flush()

    def _waveform(self, entry: RecordEntry) -> None:
        name, message = entry.topic, entry.message
        if not is_channel(name):
            raise InvalidMessage("something else is shown under this name")
        signal = self.signals.get(name) or layout.signal(name, message.unit)
        checks.block(message.first_sample, message.sample_period, len(message.samples))
        if message.unit != signal.si_unit:
            raise InvalidMessage(f"unit {message.unit[:40]!r} of {name}: this channel is in {signal.si_unit!r}")
        self.scales[name] = message.scale
        times = instants(message.first_sample, len(message.samples), message.sample_period)
        self._put(signal, times, np.frombuffer(message.samples) * message.scale)

    def _trace(self, entry: RecordEntry) -> None:
        message = entry.message
        checks.block(message.first_sequence, message.control_period, len(message.deflection))
        checks.control_trace(message)
        if self._held is None:
            self._put_ticks(message)
            return
        self._held.append(message)
        if not np.isnan(self.known.height) or len(self._held) > _HELD:
            self._release()

    def _release(self) -> None:
        held, self._held = self._held, None
        for message in held or ():
            self._put_ticks(message)

    def _put_ticks(self, message: Any) -> None:
        columns = messages.columns(message)
        times = instants(message.first_sequence, len(columns["deflection"]), message.control_period)
        for signal in self._ticks:
            if signal is layout.ERROR:
                # Of the scanner along x and y, of the tip along z.
                values = columns["position"] - columns["reference"]
                values[:, 2] = self.height + columns["deflection"] - columns["reference"][:, 2]
            else:
                values = columns[signal.name].astype(np.float64)
            self._put(signal, times, values)

    def _status(self, entry: RecordEntry) -> None:
        state = messages.state(entry.message)
        if state != self._state:
            self._state = state
            self.event(entry.time_ns, state.text, state.level)

    def _array(self, entry: RecordEntry) -> None:
        result = self._gathering.put(checks.result_part(entry.message))
        if result is not None:
            self.result(result)

    def _put(self, signal: PlotSignal, times: Times, values: Array) -> None:
        if not len(times):
            return
        self.signals[signal.name] = signal
        self._waiting[signal.name].append((times, values.reshape(len(times), -1)))
        self._counts[signal.name] += len(times)
        if self._counts[signal.name] >= _ROWS:
            self._give(signal.name)

    def _give(self, name: str) -> None:
        times, values = (np.concatenate(part) for part in zip(*self._waiting.pop(name), strict=True))
        del self._counts[name]
        self.rows(self.signals[name], times, values)
