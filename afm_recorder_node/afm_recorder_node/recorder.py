"""One recording for each run of the instrument. Needs no ROS."""

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from afm_node_common.memory import give_back

from . import layout
from .intake import Intake
from .layout import Signal
from .parameters import RecorderParameters
from .recording_files import Log, RecordedCounts, RecordingFiles, report
from .results import Shown
from .scan_lines import ScanLine
from .writer import Level

_Array = NDArray[np.float64]
_CONTROL = "control"
_FLUSH_PERIOD = 0.4
"""Wall time between two flushes [s]: a kill loses at most this and the time between two calls of `update`."""
_SAME_TIME_NS = 1_000


class Recorder:
    """Blocks, states and parameters in; recordings out.

    A reset of the instrument begins a new run at time 0, and with it a new recording: recording-2.rrd.

    Parameters
    ----------
    parameters : RecorderParameters
    log : Log

    Raises
    ------
    ParameterError
        If there cannot be a file at the path.
    """

    def __init__(self, parameters: RecorderParameters, log: Log) -> None:
        self.time_ns = 0
        """Last simulated time received [ns]."""
        self.known: dict[str, dict[str, object]] = {}
        """Parameters as they are now: node, name, value."""
        self._log = log
        self._flush_at = 0.0
        self._held_since: float | None = None
        self._files = RecordingFiles(parameters, log)
        self._writer = self._files.open_first()
        self._intake = Intake((_CONTROL, *(signal.entity for signal in layout.CHANNELS)), self._begin_run)
        self._height: float | None = None
        self._ticks = 0
        self._state: tuple[str, Level] | None = None
        self._state_ns = 0
        self._score: tuple[int, Mapping[str, object]] | None = None
        self._lines, self._lines_lost = 0, 0
        self._last_line: ScanLine | None = None
        self._held_lines: list[ScanLine] = []  # of the run to come
        self._begun = False  # whether blocks had come by the last state
        self._resetting = False  # the instrument has been reset, but blocks of the run before may still come

    @property
    def problem(self) -> str:
        """Why the recording cannot be written at present; empty if it can."""
        return self._writer.problem

    @property
    def scored(self) -> bool:
        """Whether the score of the present run has been recorded."""
        return self._writer.scored

    @property
    def strays(self) -> int:
        """Blocks dropped because they belong to no run: another node has sent them."""
        return self._intake.strays

    def further_channel(self, signal: Signal) -> None:
        """A channel beyond `layout.CHANNELS`, before its first block."""
        self._intake.add(signal.entity)

    def channel(self, signal: Signal, first: int, period: float, samples: _Array, scale: float) -> None:
        """A block of a detector channel; see `RecordingWriter.channel`."""
        self._intake.put(
            signal.entity, first, len(samples), lambda: self._writer.channel(signal, first, period, samples, scale)
        )

    def control(self, first: int, period: float, time_ns: int, columns: Mapping[str, NDArray[Any]]) -> None:
        """A block of control ticks that begins at `time_ns`; `columns` as in `RecordingWriter.control`."""

        def write() -> None:
            if self._height is None:
                self._log.warning("cantilever.a of the instrument is not known: errors of the tip are NaN until it is")
                self._height = float("nan")
            self._writer.control(first, period, **columns, cantilever_height=self._height)
            self.time_ns = max(self.time_ns, time_ns)

        self._intake.put(_CONTROL, first, len(columns["deflection"]), write)

    def cantilever_height(self, height: float) -> None:
        """Height of the cantilever's rest position [m]. The error of the tip depends on it, so blocks wait for it."""
        self._height = height
        self._intake.open()

    def state(self, time_ns: int, ticks: int, text: str, level: Level) -> None:
        """State of the instrument, after `ticks` control ticks; a change becomes an event."""
        # A run of which nothing had come by its last status is no run here: the recorder was too late for it.
        if ticks < self._ticks and self._begun:
            self._resetting = True
        self._begun = self._intake.begun
        news = (text, level) != self._state
        self.time_ns, self._ticks, self._state = time_ns, ticks, (text, level)
        self._state_ns = time_ns
        if news and not self._resetting:
            self._writer.event(time_ns, text, level)
        self._match_score()

    def score(self, time_ns: int, values: Mapping[str, object]) -> None:
        """The score of the run that ended at a simulated time [ns].

        A recorder that comes late hears the score of a run before: one belongs to this run if its status says its time.
        """
        self._score = time_ns, values
        self._match_score()

    def event(self, time_ns: int, text: str, level: Level) -> None:
        """Something that has happened in the run at a simulated time [ns], such as the begin of a fault."""
        if not self._resetting:
            self._writer.event(time_ns, text, level)

    def result(self, shown: Shown) -> None:
        """What a verb has brought back."""
        if not self._resetting:
            self._writer.result(shown)

    def line(self, line: ScanLine) -> None:
        """One direction of one line of a scan."""
        last = self._last_line
        if self._resetting and (last is None or line.time_ns < last.time_ns):
            self._held_lines.append(line)
            return
        known = last is not None and last.number == line.number
        expected = last.line.number + 1 if last is not None and known else 0
        self._lines += 1
        self._lines_lost += max(line.line.number - expected, 0)
        self._last_line = line
        self._writer.line(line)

    def parameters(self, node: str, values: Mapping[str, object]) -> None:
        """Add the parameters of a new node."""
        self.known[node] = dict(values)
        self._writer.parameters(node, values)

    def parameter_change(self, node: str, name: str, old: object, new: object) -> None:
        """Record a change of a parameter, at the last simulated time received."""
        self.known[node][name] = new
        # Between two runs nothing is recorded: the next recording begins with the new value.
        if not self._resetting:
            self._writer.parameter_change(self.time_ns, node, name, old, new)

    def counts(self) -> RecordedCounts:
        """What the present run has brought up to now."""
        ticks = self._intake.streams[_CONTROL]
        channels = [self._intake.streams[signal.entity] for signal in layout.CHANNELS]
        return RecordedCounts(
            path=str(self._writer.path),
            ticks=ticks.received,
            samples=min(channel.received for channel in channels),
            ticks_lost=ticks.lost,
            samples_lost=max(channel.lost for channel in channels),
            ticks_unwritten=self._writer.unwritten[layout.POSITION.entity],
            samples_unwritten=max(self._writer.unwritten[signal.entity] for signal in layout.CHANNELS),
            lines=self._lines,
            lines_lost=self._lines_lost,
        )

    def has(self, ticks: int, samples: int) -> bool:
        """Whether every stream has come up to these numbers of ticks and samples since the start of the run."""
        ends = {name: stream.expected or 0 for name, stream in self._intake.streams.items()}
        return ends[_CONTROL] >= ticks and min(ends[signal.entity] for signal in layout.CHANNELS) >= samples

    def update(self) -> None:
        """Write received data; call this some times a second in every state."""
        now = time.monotonic()
        if self._height is None and self._intake.begun:
            # Blocks wait for the height of the cantilever, but not for longer than may be lost.
            self._held_since = self._held_since or now
            if now >= self._held_since + _FLUSH_PERIOD:
                self._intake.open()
        if now >= self._flush_at:
            self._writer.flush()
            self._flush_at = now + _FLUSH_PERIOD
        self._files.watch(self._writer)

    def close(self) -> None:
        """Write the blocks held back and finish the recording.

        Raises
        ------
        OSError
            If it could not be written completely.
        """
        self._intake.finish()
        self._close()

    def _match_score(self) -> None:
        if self._score is None or self._resetting or not self._intake.begun:
            return
        time_ns, values = self._score
        if self._state is not None and abs(time_ns - self._state_ns) <= _SAME_TIME_NS:
            self._score = None
            self._writer.score(time_ns, values)

    def _close(self) -> None:
        if self._writer.close() is None:
            self._log.warning("nothing recorded: no block has come from the instrument")
        else:
            report(self._log, self.counts(), self._intake.streams[_CONTROL].begin)

    def _begin_run(self) -> None:
        try:
            self._close()
        except OSError as error:
            self._log.error(str(error))
        self._writer = self._files.open_next()
        give_back()
        for node, values in self.known.items():
            self._writer.parameters(node, values)
        if self._resetting and self._state is not None:
            self._writer.event(self.time_ns, *self._state)
        else:  # the state of the new run is still to come
            self.time_ns, self._ticks, self._state = 0, 0, None
        self._resetting = False
        self._lines, self._lines_lost, self._last_line = 0, 0, None
        held, self._held_lines = self._held_lines, []
        for line in held:
            self.line(line)
