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

from afm_node_common.decoding import InvalidMessage

from . import layout
from .layout import PlotSignal
from .names import CHANNELS
from .parameter_values import ParameterValues, change_text
from .places import MessageSource, open_recording
from .record import RecordEntry
from .recording import About, IncompleteRecording, ParameterChange, RecordedChannel, Recording, RecordingError
from .scan_lines import ScanLine, images
from .visitor import Array, Times, Visitor

Visit = Callable[[str, Times, Array], None]
"""Takes some rows of a signal: name, times (n,) [ns], numbers (n, width) in SI units."""
Path = str | os.PathLike[str]
_FEW = ("status", "events", "parameters", "score")
"""Topics with what a recording holds in addition to signals and images."""


def read_recording(path: Path | MessageSource, *, every: int = 1) -> Recording:
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
        If there is no recording, or it is not one of this microscope.

    Warns
    -----
    IncompleteRecording
        If it has no end, or something is missing in it; `complete` says it too.
    """
    rows: dict[str, list[tuple[Times, Array]]] = defaultdict(list)

    def keep(name: str, times: Times, values: Array) -> None:
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
            name: RecordedChannel(*_joined(rows[name]), gathered.signals[name].si_unit, gathered.scales[name])
            for name in sorted(gathered.scales, key=lambda name: ([*CHANNELS, name].index(name), name))
        },
        **vars(gathered.about()),
    )


def read_about(
    path: Path | MessageSource, visit: Visit, names: Sequence[str] | None = None
) -> tuple[About, dict[str, PlotSignal]]:
    """Read what a recording holds besides its signals; go through the signals stretch by stretch, with little memory.

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
    path: Path | MessageSource, names: Sequence[str], begin: float = -np.inf, end: float = np.inf
) -> dict[str, RecordedChannel]:
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
    kept: dict[str, list[tuple[Times, Array]]] = defaultdict(list)
    found = visit_signals(path, names, lambda name, *rows: kept[name].append(rows), begin, end)
    return {name: RecordedChannel(*_joined(kept[name]), signal.si_unit, float("nan")) for name, signal in found.items()}


def visit_signals(
    path: Path | MessageSource, names: Sequence[str], visit: Visit, begin: float = -np.inf, end: float = np.inf
) -> dict[str, PlotSignal]:
    """Go through some signals stretch by stretch; the signals by name.

    Parameters and errors are those of `read_signals`.
    """
    lo, hi = (int(np.clip(1e9 * each, -1, 2**62)) for each in (begin, end))

    def see(name: str, times: Times, values: Array) -> None:
        if times[0] < lo or times[-1] > hi:
            inside = (times >= lo) & (times <= hi)
            times, values = times[inside], values[inside]
        if len(times):
            visit(name, times, values)

    source = path if isinstance(path, MessageSource) else open_recording(path)
    signals = _gather(source, see, names, lo, hi).signals
    if missing := [name for name in names if name not in signals]:
        there = sorted(_gather(source, lambda *_: None).signals)
        if missing[0] not in there:
            near = difflib.get_close_matches(missing[0], there, 3, 0.5)
            hint = f"did you mean {' or '.join(near)}?" if near else f"there is {', '.join(there) or 'none'}"
            raise RecordingError(f"{source.path} holds no signal {missing[0]}: {hint}")
    return {name: signals.get(name) or layout.signal(name, "") for name in names}


class _Gathered(Visitor):
    """What is taken from the messages of a recording.

    Parameters
    ----------
    source : MessageSource
    visit : callable
    names : sequence of str, optional
        Signals to go through.
    """

    def __init__(self, source: MessageSource, visit: Visit, names: Sequence[str] | None = None) -> None:
        self._names = None if names is None else {*names}
        ticks = [each for each in layout.TICKS if self._names is None or each.name in self._names]
        super().__init__(source.about, ticks)
        self._source, self._visit = source, visit
        self._height: float | None = None
        self._changes: list[ParameterChange] = []
        self._events: list[tuple[float, str, str]] = []
        self._lines: list[ScanLine] = []
        self._score: dict[str, object] | None = None

    def topics(self) -> list[str] | None:
        """Topics that are to be read; None: all."""
        if self._names is None:
            return None
        ticks = ["control_trace"] if self._ticks else []
        return [*_FEW, *ticks, *(name for name in self._names if name not in layout.TICK_NAMES)]

    def about(self) -> About:
        """Return what the recording holds in addition to its signals."""
        events = sorted(self._events, key=lambda event: event[0])
        return About(
            parameters=self.known.first,
            parameter_changes=sorted(self._changes, key=lambda change: change.time),
            events=[event[:2] for event in events],
            event_levels=[event[2] for event in events],
            images=images(self._lines),
            score=self._score,  # type: ignore[arg-type]
            complete=not self._source.missing,
            missing=self._source.missing,
        )

    def rows(self, signal: PlotSignal, times: Times, values: Array) -> None:
        """See `Visitor.rows`."""
        self._visit(signal.name, times, values)

    def event(self, time_ns: int, text: str, level: str) -> None:
        """See `Visitor.event`."""
        self._events.append((time_ns / 1e9, text, level))

    def parameters(self, entry: RecordEntry, changes: list[ParameterChange]) -> None:
        """See `Visitor.parameters`."""
        self._changes += changes
        self._events += [(change.time, change_text(change), "INFO") for change in changes]

    def score(self, time_ns: int, score: dict[str, object]) -> None:
        """See `Visitor.score`."""
        self._score = score

    def line(self, line: ScanLine) -> None:
        """See `Visitor.line`."""
        self._lines.append(line)

    @property
    def height(self) -> float:
        """Height of the cantilever's rest position [m], also if its message is elsewhere in the file."""
        if self._height is None:
            known = self.known
            if np.isnan(known.height):
                known = ParameterValues(self._source.about.get("namespace", ""))
                for entry in self._source.messages(("parameters",)):
                    known.put(entry.message, entry.time_ns)
            self._height = known.height
        return self._height


def _gather(
    path: Path | MessageSource, visit: Visit, names: Sequence[str] | None = None, begin_ns: int = 0, end_ns: int = 2**63
) -> _Gathered:
    source = path if isinstance(path, MessageSource) else open_recording(path)
    with _decoding(source):
        if source.missing:
            warnings.warn(f"{source.path} is not complete: {source.missing}", IncompleteRecording, 4)
        gathered = _Gathered(source, visit, names)
        for entry in source.messages(gathered.topics(), begin_ns, end_ns):
            gathered.put(entry)
        gathered.finish()
    return gathered


@contextmanager
def _decoding(source: MessageSource) -> Iterator[None]:
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


def _joined(stretches: list[tuple[Times, Array]]) -> tuple[Array, Array]:
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
    rows: dict[str, list[tuple[Times, Array]]], signals: tuple[PlotSignal, ...]
) -> tuple[Array, dict[str, Array]]:
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
