"""Reads a recording as arrays in SI units. Needs no ROS and no viewer.

What is read are the messages that the instrument has published: of a record, or of a bag.
"""

import difflib
import os
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from afm_node_common.decoding import InvalidMessage

from . import checks, layout, messages
from .layout import Signal, instants
from .names import CHANNELS, is_channel
from .parameter_values import ParameterValues, change_text
from .places import Source, open_recording
from .record import Entry
from .recording import About, Channel, IncompleteRecording, ParameterChange, Recording, RecordingError
from .scan_lines import ScanLine, images

_Array = NDArray[np.float64]
_Times = NDArray[np.int64]
Visit = Callable[[str, _Times, _Array], None]
"""Takes some rows of a signal: name, times (n,) [ns], numbers (n, width) in SI units."""
Path = str | os.PathLike[str]
_ROWS = 32_768
"""Rows of a signal that are given to `visit` at once."""
_TRACE = "control_trace"
_WAVEFORM = "afm_msgs/msg/Waveform"
_FEW = ("status", "events", "parameters", "score")
"""Topics with what a recording holds beside signals and images."""


def read_recording(path: Path | Source, *, every: int = 1) -> Recording:
    """Read the recording at `path`; one without an end too, up to where it breaks off.

    Parameters
    ----------
    path : path
        A record (.mcap), the view next to it (.rrd), a folder with one of them, or a bag of `ros2 bag record`.
    every : int
        Keep one in so many ticks and samples, where all of a long run is more than memory holds.

    Raises
    ------
    DamagedRecording
        If it is not what was written: all of it is checked.
    RecordingError
        If there is none, or it is no recording of this microscope.

    Warns
    -----
    IncompleteRecording
        If it has no end, or something is missing in it; `complete` says it too.
    """
    rows: dict[str, list[tuple[_Times, _Array]]] = defaultdict(list)

    def keep(name: str, times: _Times, values: _Array) -> None:
        thinned = slice(-int(rows_seen[name]) % every, None, every)
        rows_seen[name] += len(times)
        rows[name].append((times[thinned].copy(), values[thinned].copy()))

    rows_seen: dict[str, int] = defaultdict(int)
    gathered = _gather(path, keep)
    time_ticks, ticks = _aligned(rows, layout.TICKS)
    time_samples, channels = _aligned(rows, layout.CHANNELS)
    return Recording(
        time_ticks=time_ticks,
        position=ticks["position"],
        reference=ticks["reference"],
        error=ticks["error"],
        drive=ticks["drive"],
        round_trip=ticks["round_trip"],
        time_samples=time_samples,
        deflection=channels[layout.DEFLECTION.name],
        lateral_force=channels[layout.LATERAL_FORCE.name],
        lateral_force_y=channels[layout.LATERAL_FORCE_Y.name],
        normal_force=channels[layout.NORMAL_FORCE.name],
        deflection_scale=gathered.scales.get(layout.DEFLECTION.name, float("nan")),
        lateral_scale=gathered.scales.get(layout.LATERAL_FORCE.name, float("nan")),
        channels={
            name: Channel(*_joined(rows[name]), gathered.units[name], gathered.scales[name])
            for name in sorted(gathered.units, key=lambda name: ([*CHANNELS, name].index(name), name))
        },
        **vars(gathered.about()),
    )


def read_about(
    path: Path | Source, visit: Visit, names: Sequence[str] | None = None
) -> tuple[About, dict[str, Signal]]:
    """Read what a recording holds beside its signals, and go through these stretch by stretch, with little memory.

    Raises and warns as `read_recording`.

    Parameters
    ----------
    path : path
    visit : callable
        Called with the rows of the signals.
    names : sequence of str, optional
        Signals to go through; None: all. Images are not read then.

    Returns
    -------
    (About, dict)
        And the signals by name that `visit` has seen.
    """
    gathered = _gather(path, visit, names)
    return gathered.about(), gathered.signals


def read_signals(
    path: Path | Source, names: Sequence[str], begin: float = -np.inf, end: float = np.inf
) -> dict[str, Channel]:
    """Read some signals.

    Raises and warns as `read_recording`.

    Parameters
    ----------
    path : path
    names : sequence of str
        Such as position, drive, deflection, truth/normal_force: of those of every tick and of the channels.
    begin, end : float, optional [s]
        Simulated time.

    Returns
    -------
    dict
        Channel by name; values (n, 3) of those that have x, y, z.

    Raises
    ------
    RecordingError
        Also if there is no signal of a name; the message has those that are near.
    """
    kept: dict[str, list[tuple[_Times, _Array]]] = defaultdict(list)
    found = visit_signals(path, names, lambda name, *rows: kept[name].append(rows), begin, end)
    return {name: Channel(*_joined(kept[name]), signal.si_unit, float("nan")) for name, signal in found.items()}


def visit_signals(
    path: Path | Source, names: Sequence[str], visit: Visit, begin: float = -np.inf, end: float = np.inf
) -> dict[str, Signal]:
    """Go through some signals stretch by stretch; the signals by name.

    Parameters and errors are those of `read_signals`.
    """
    lo, hi = (int(np.clip(1e9 * each, -1, 2**62)) for each in (begin, end))

    def see(name: str, times: _Times, values: _Array) -> None:
        if times[0] < lo or times[-1] > hi:
            inside = (times >= lo) & (times <= hi)
            times, values = times[inside], values[inside]
        if len(times):
            visit(name, times, values)

    source = path if isinstance(path, Source) else open_recording(path)
    signals = _gather(source, see, names, lo, hi).signals
    if missing := [name for name in names if name not in signals]:
        there = sorted(_gather(source, lambda *_: None).signals)
        if missing[0] not in there:
            near = difflib.get_close_matches(missing[0], there, 3, 0.5)
            hint = f"did you mean {' or '.join(near)}?" if near else f"there is {', '.join(there) or 'none'}"
            raise RecordingError(f"{source.path} holds no signal {missing[0]}: {hint}")
    return {name: signals.get(name) or layout.signal(name, "") for name in names}


class _Gathered:
    """What is taken from the messages of a recording.

    Parameters
    ----------
    source : Source
    visit : callable
    names : sequence of str, optional
        Signals to go through.
    """

    def __init__(self, source: Source, visit: Visit, names: Sequence[str] | None = None) -> None:
        self._source, self._visit = source, visit
        self._names = None if names is None else {*names}
        self._ticks = [each for each in layout.TICKS if self._names is None or each.name in self._names]
        self._waiting: dict[str, list[tuple[_Times, _Array]]] = defaultdict(list)
        self._rows: dict[str, int] = defaultdict(int)  # that wait
        self._parameters = ParameterValues(source.about.get("namespace", ""))
        self._height: float | None = None
        self._changes: list[ParameterChange] = []
        self._events: list[tuple[float, str, str]] = []
        self._lines: list[ScanLine] = []
        self._state = messages.StateText("", "INFO")
        self._score: dict[str, object] | None = None
        self.units: dict[str, str] = {}
        """Of each channel."""
        self.scales: dict[str, float] = {}
        """Of each channel, as they were last: SI units per unit as converted."""
        self.signals: dict[str, Signal] = {}
        """By name, those that have been seen."""

    def topics(self) -> list[str] | None:
        """Topics that are to be read; None: all."""
        if self._names is None:
            return None
        ticks = [_TRACE] if self._ticks else []
        return [*_FEW, *ticks, *(name for name in self._names if name not in layout.TICK_NAMES)]

    def put(self, entry: Entry) -> None:
        """Take a message."""
        message, time_ns = entry.message, entry.time_ns
        if entry.kind == _WAVEFORM:
            if is_channel(entry.topic):
                self._waveform(entry.topic, message)
        elif entry.topic == _TRACE:
            self._trace(message)
        elif entry.topic == "status":
            state = messages.state(message)
            if state != self._state:
                self._state = state
                self._events.append((time_ns / 1e9, state.text, state.level))
        elif entry.topic == "events":
            self._events.append((time_ns / 1e9, message.text, messages.level(message)))
        elif entry.topic == "parameters":
            for change in self._parameters.put(message, time_ns):
                self._changes.append(change)
                self._events.append((change.time, change_text(change), "INFO"))
        elif entry.topic == "score":
            self._score = messages.score(message)
        elif entry.topic == "scan_line":
            self._lines.append(checks.scan_line(message))

    def finish(self) -> None:
        """Give `visit` what still waits."""
        for name in list(self._waiting):
            self._send(name)

    def about(self) -> About:
        """What the recording holds beside its signals."""
        events = sorted(self._events, key=lambda event: event[0])
        return About(
            parameters=self._parameters.first,
            parameter_changes=sorted(self._changes, key=lambda change: change.time),
            events=[event[:2] for event in events],
            event_levels=[event[2] for event in events],
            images=images(self._lines),
            score=self._score,  # type: ignore[arg-type]
            complete=not self._source.missing,
            missing=self._source.missing,
        )

    def _waveform(self, name: str, message: object) -> None:
        m: object = message
        first, period, samples = int(m.first_sample), float(m.sample_period), np.frombuffer(m.samples)  # type: ignore[attr-defined]
        checks.block(first, period, len(samples))
        unit, scale = str(m.unit), float(m.scale)  # type: ignore[attr-defined]
        if self.units.setdefault(name, unit) != unit:
            raise InvalidMessage(f"unit {unit[:40]!r} of {name}: this channel is in {self.units[name]!r}")
        self.scales[name] = scale
        self._put(layout.signal(name, unit), instants(first, len(samples), period), samples * scale)

    def _trace(self, message: object) -> None:
        checks.control_trace(message)
        columns = messages.columns(message)
        first, period = int(message.first_sequence), float(message.control_period)  # type: ignore[attr-defined]
        checks.block(first, period, len(columns["deflection"]))
        times = instants(first, len(columns["deflection"]), period)
        for signal in self._ticks:
            if signal is layout.ERROR:
                error = columns["position"] - columns["reference"]
                error[:, 2] = self._cantilever() + columns["deflection"] - columns["reference"][:, 2]
                self._put(signal, times, error)
            else:
                self._put(signal, times, columns[signal.name].astype(np.float64))

    def _cantilever(self) -> float:
        """Height of the cantilever's rest position, also where its message comes late."""
        if self._height is None:
            known = self._parameters
            if np.isnan(known.height):
                known = ParameterValues(self._source.about.get("namespace", ""))
                for entry in self._source.messages(("parameters",)):
                    known.put(entry.message, entry.time_ns)
            self._height = known.height
        return self._height

    def _put(self, signal: Signal, times: _Times, values: _Array) -> None:
        if not len(times):
            return
        self.signals[signal.name] = signal
        self._waiting[signal.name].append((times, values.reshape(len(times), -1)))
        self._rows[signal.name] += len(times)
        if self._rows[signal.name] >= _ROWS:
            self._send(signal.name)

    def _send(self, name: str) -> None:
        self._rows[name] = 0
        waiting = self._waiting.pop(name, [])
        if waiting:
            times, values = (np.concatenate(part) for part in zip(*waiting, strict=True))
            self._visit(name, times, values)


def _gather(
    path: Path | Source, visit: Visit, names: Sequence[str] | None = None, begin_ns: int = 0, end_ns: int = 2**63
) -> _Gathered:
    source = path if isinstance(path, Source) else open_recording(path)
    with _decoding(source):
        if source.missing:
            warnings.warn(f"{source.path} is not complete: {source.missing}", IncompleteRecording, 4)
        gathered = _Gathered(source, visit, names)
        for entry in source.messages(gathered.topics(), begin_ns, end_ns):
            gathered.put(entry)
        gathered.finish()
    return gathered


@contextmanager
def _decoding(source: Source) -> Iterator[None]:
    """Name the recording whose contents are not those that an instrument publishes, whatever is wrong about them."""
    try:
        yield
    except RecordingError as error:
        if str(source.path) in str(error):
            raise
        raise RecordingError(f"{source.path} is no readable recording: {error}") from None
    except InvalidMessage as error:
        raise RecordingError(f"{source.path} is no readable recording: {error}") from None
    except Exception as error:
        raise RecordingError(f"{source.path} is no readable recording: {type(error).__name__}: {error}") from error


def _joined(stretches: list[tuple[_Times, _Array]]) -> tuple[_Array, _Array]:
    """Times [s] and values of one signal, sorted by time."""
    if not stretches:
        return np.empty(0), np.empty(0)
    times, values = (np.concatenate(part) for part in zip(*stretches, strict=True))
    if values.shape[1] == 1:
        values = values[:, 0]
    if np.any(times[1:] < times[:-1]):
        order = np.argsort(times, kind="stable")
        times, values = times[order], values[order]
    return times / 1e9, values


def _aligned(
    rows: dict[str, list[tuple[_Times, _Array]]], signals: tuple[Signal, ...]
) -> tuple[_Array, dict[str, _Array]]:
    """Signals by name, on one common time axis [s]; NaN where a signal lacks a time that another one has."""
    joined = {signal.name: _joined(rows[signal.name]) for signal in signals}
    union = joined[signals[0].name][0]
    if not all(np.array_equal(union, times) for times, _ in joined.values()):
        union = np.unique(np.concatenate([times for times, _ in joined.values()]))
    columns = {}
    for signal in signals:
        times, values = joined[signal.name]
        if len(times) < len(union):
            column = np.full((len(union), *([signal.width] if signal.axes else [])), np.nan)
            column[np.searchsorted(union, times)] = values
            values = column
        columns[signal.name] = values.reshape(len(union), signal.width) if signal.axes else values
    return union, columns
