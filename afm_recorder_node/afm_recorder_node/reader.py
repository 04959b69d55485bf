"""Reads a recording back as arrays in SI units. Needs no ROS and no viewer.

A recording holds nm, nN and us (see `afm_recorder_node.layout`); here they become m, N and s again, to within the
round-off of one multiplication. Times are whole nanoseconds in the file.
"""

import difflib
import os
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from . import layout, pictures
from .complete import chunks, series
from .layout import Signal
from .readable import readable
from .recording import (
    About,
    Channel,
    IncompleteRecording,
    ParameterChange,
    Recording,
    RecordingError,
    UncheckedRecording,
)
from .scan_lines import images
from .texts import change_of, parameters_of, score_of

_Array = NDArray[np.float64]
_Batches = dict[str, list[pa.RecordBatch]]
_Rows = tuple[NDArray[np.int64], _Array]
Visit = Callable[[str, NDArray[np.int64], _Array], None]
"""Takes some rows of a signal: entity, times (n,) [ns], numbers (n, width) as they stand in the file."""


@dataclass(frozen=True)
class Opened:
    """A recording that has been checked, to be read several times; see `opened`."""

    name: str
    file: Path
    complete: bool


Source = str | os.PathLike[str] | Opened


@contextmanager
def opened(path: Source) -> Iterator[Opened]:
    """Check all bytes of a recording once. Raises and warns as `read_recording`."""
    if isinstance(path, Opened):
        yield path
        return
    name = os.fspath(path)
    with readable(path) as (file, extent):
        if not extent.complete:
            warnings.warn(f"{name} has no end: its recorder is still at work, or has died", IncompleteRecording, 5)
        elif not extent.sealed:
            warnings.warn(f"{name} has no checksums: it cannot be checked", UncheckedRecording, 5)
        yield Opened(name, file, extent.complete)


@contextmanager
def _decoding(path: Source) -> Iterator[None]:
    """Name the recording whose contents are not those that a recorder writes, whatever is wrong about them."""
    name = path.name if isinstance(path, Opened) else os.fspath(path)
    try:
        yield
    except RecordingError as error:
        if name in str(error):
            raise
        raise RecordingError(f"{name} is no readable recording: {error}") from None
    except Exception as error:
        raise RecordingError(f"{name} is no readable recording: {type(error).__name__}: {error}") from error


def read_recording(path: str | os.PathLike[str], *, every: int = 1) -> Recording:
    """Read the recording at `path`; one without an end too, up to where it breaks off.

    Parameters
    ----------
    path : path
    every : int
        Keep one in so many ticks and samples, where all of a long run is more than memory holds.

    Raises
    ------
    DamagedRecording
        If it is not what was written: all of it is checked.
    RecordingError
        If there is no file, or it is no recording of this microscope.

    Warns
    -----
    IncompleteRecording
        If the recorder is still at work, or has died; `complete` tells it too.
    UncheckedRecording
        If it has no checksums, as those of earlier versions.
    """
    with _decoding(path):
        return _recording(*_read(path, every=every))


def _recording(batches: _Batches, whole: bool) -> Recording:
    time_ticks, ticks = _aligned(batches, layout.TICKS)
    time_samples, channels = _aligned(batches, layout.CHANNELS)
    return Recording(
        time_ticks=time_ticks,
        position=ticks[layout.POSITION.entity],
        reference=ticks[layout.REFERENCE.entity],
        error=ticks[layout.ERROR.entity],
        drive=ticks[layout.DRIVE.entity],
        round_trip=ticks[layout.ROUND_TRIP.entity],
        time_samples=time_samples,
        deflection=channels[layout.DEFLECTION.entity],
        lateral_force=channels[layout.LATERAL_FORCE.entity],
        lateral_force_y=channels[layout.LATERAL_FORCE_Y.entity],
        normal_force=channels[layout.NORMAL_FORCE.entity],
        deflection_scale=_scale(batches[layout.DEFLECTION.entity]),
        lateral_scale=_scale(batches[layout.LATERAL_FORCE.entity]),
        channels=_channels(batches),
        **vars(_about(batches, whole)),
    )


def read_about(path: Source, visit: Visit, names: Sequence[str] | None = None) -> tuple[About, dict[str, Signal]]:
    """Read what a recording holds beside its signals, and go through these stretch by stretch, with little memory.

    Raises and warns as `read_recording`.

    Parameters
    ----------
    path : path
    visit : callable
        Called with the rows of the signals.
    names : sequence of str, optional
        Signals to go through; None: all. Nothing else is read then, neither the images.

    Returns
    -------
    (About, dict)
        And the signals by entity that `visit` has seen.
    """
    entities = ["+ /**", f"- {pictures.SCANS}/**", f"+ {pictures.LINES}"]
    if names is not None:
        entities = [layout.EVENTS, layout.PARAMETERS, layout.SCORE, *(f"/{name}" for name in names)]
    seen: set[str] = set()

    def see(entity: str, times: NDArray[np.int64], values: _Array) -> None:
        if not entity.startswith(f"{layout.PARAMETERS}/"):
            seen.add(entity)
            visit(entity, times, values)

    with _decoding(path):
        batches, whole = _read(path, entities, visit=see)
        found = {entity: _signal(entity, batches[entity]) for entity in sorted(seen)}
        return _about(batches, whole), {entity: signal for entity, signal in found.items() if signal is not None}


def read_signals(path: Source, names: Sequence[str], begin: float = -np.inf, end: float = np.inf) -> dict[str, Channel]:
    """Read some signals, and nothing else of a recording that has an index.

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
    kept: dict[str, list[_Rows]] = defaultdict(list)

    def keep(entity: str, times: NDArray[np.int64], values: _Array) -> None:
        kept[entity].append((times.copy(), values.flatten()))  # without the rest of the chunk

    found = {}
    for name, signal in visit_signals(path, names, keep, begin, end).items():
        times, values = _joined(kept[signal.entity], signal)
        found[name] = Channel(times / 1e9, values, signal.si_unit, float("nan"))
    return found


def visit_signals(
    path: Source, names: Sequence[str], visit: Visit, begin: float = -np.inf, end: float = np.inf
) -> dict[str, Signal]:
    """Go through some signals stretch by stretch, as they stand in the file; the signals by name.

    Parameters and errors are those of `read_signals`; the stretches come in order of time unless another tool has
    written the file.
    """
    lo, hi = (int(np.clip(1e9 * each, -1, 2**62)) for each in (begin, end))

    def see(entity: str, times: NDArray[np.int64], values: _Array) -> None:
        if len(times) and (times.min() < lo or times.max() > hi):
            inside = (times >= lo) & (times <= hi)
            times, values = times[inside], values[inside]
        if len(times):
            visit(entity, times, values)

    with opened(path) as source:
        _, signals = read_about(source, see, names)
        if missing := [name for name in names if f"/{name}" not in signals]:
            there = [each.name for each in read_about(source, lambda *_: None)[1].values()]
            near = difflib.get_close_matches(missing[0], there, 3, 0.5)
            told = f"did you mean {' or '.join(near)}?" if near else f"there is {', '.join(there) or 'none'}"
            raise RecordingError(f"{source.name} holds no signal {missing[0]}: {told}")
    return {name: signals[f"/{name}"] for name in names}


def _read(
    path: Source, entities: Sequence[str] = (), *, every: int = 1, visit: Visit | None = None
) -> tuple[_Batches, bool]:
    """All chunks of the recording, or of some entities, by entity; and whether it is complete.

    Of signals one row in `every`; those that are visited are not kept.
    """
    ticks = {signal.entity for signal in layout.TICKS}
    batches: _Batches = defaultdict(list)
    with opened(path) as source:
        try:
            for chunk in chunks(source.file, whole=source.complete, entities=entities):
                batch = chunk.to_record_batch()
                entity = chunk.entity_path
                rows = series(batch) if visit or every > 1 else None
                if rows and visit:
                    visit(entity, rows[0], rows[1].reshape(len(rows[0]), -1))
                    continue
                if rows and (entity in ticks or not entity.startswith(f"{layout.PARAMETERS}/")):
                    # All signals of a kind are cut into chunks at the same times, so that they keep the same ones.
                    batch = batch.take(pa.array(range(0, batch.num_rows, every)))
                batches[entity].append(batch)
        # What rerun raises for a file that it cannot read.
        except (RuntimeError, ValueError, OSError) as error:
            raise RecordingError(f"{source.name} is no readable recording: {error}") from error
    return batches, source.complete


def _rows(batches: list[pa.RecordBatch], signal: Signal) -> _Rows:
    """Times [ns] and values in SI units of one signal, sorted by time."""
    return _joined([rows for rows in map(series, batches) if rows is not None], signal)


def _joined(stretches: list[_Rows], signal: Signal) -> _Rows:
    """The same from times and numbers as they stand in the file, which this empties."""
    times, values = [np.empty(0, np.int64)], [np.empty(0)]
    while stretches:  # what is joined is let go of at once
        each = stretches.pop(0)
        times.append(each[0])
        values.append(each[1])
    t = np.concatenate(times)
    times.clear()
    v = np.concatenate(values)
    values.clear()
    v /= signal.factor
    if signal.axes:
        v = v.reshape(-1, signal.width)
    if len(t) != len(v):
        raise RecordingError(f"{signal.entity} has rows that do not hold {signal.width} numbers")
    if np.any(t[1:] < t[:-1]):
        order = np.argsort(t, kind="stable")
        t, v = t[order], v[order]
    return t, v


def _aligned(batches: _Batches, signals: tuple[Signal, ...]) -> tuple[_Array, dict[str, _Array]]:
    """Signals by entity, on one common time axis [s]; NaN where a signal lacks a time that another one has."""
    rows = {signal.entity: _rows(batches[signal.entity], signal) for signal in signals}
    union = rows[signals[0].entity][0]
    if not all(np.array_equal(union, times) for times, _ in rows.values()):
        union = np.unique(np.concatenate([times for times, _ in rows.values()]))
    columns = {}
    for entity, (times, values) in rows.items():
        if len(times) < len(union):
            column = np.full((len(union), *values.shape[1:]), np.nan)
            column[np.searchsorted(union, times)] = values
            values = column
        columns[entity] = values
    return union / 1e9, columns


def _channels(batches: _Batches) -> dict[str, Channel]:
    """All channels by name."""
    channels = {}
    for entity in (*(signal.entity for signal in layout.CHANNELS), *layout.further(batches)):
        signal = _signal(entity, batches[entity])
        if signal is not None:
            times, values = _rows(batches[entity], signal)
            channels[signal.name] = Channel(times / 1e9, values, signal.si_unit, _scale(batches[entity]))
    return channels


def _signal(entity: str, batches: list[pa.RecordBatch]) -> Signal | None:
    """The signal of an entity; None if it is none."""
    if known := layout.KNOWN.get(entity.removeprefix("/")):
        return known
    factor = _number(_static(batches, "factor"))
    return None if np.isnan(factor) else Signal(entity, "", factor, str(_static(batches, "unit")))


def _about(batches: _Batches, whole: bool) -> About:
    events, levels, changes = _events(batches[layout.EVENTS])
    text = _static(batches[layout.PARAMETERS], "TextDocument:text")
    score = _static(batches[layout.SCORE], "TextDocument:text")
    return About(
        parameters=parameters_of(str(text)) if text is not None else {},
        parameter_changes=changes,
        events=events,
        event_levels=levels,
        images=list(images(batches[pictures.LINES]).values()),
        score=score_of(str(score)) if score is not None else None,
        complete=whole,
    )


def _events(batches: list[pa.RecordBatch]) -> tuple[list[tuple[float, str]], list[str], list[ParameterChange]]:
    events, changes = [], []
    for batch in batches:
        times = batch.column(layout.TIMELINE).cast(pa.int64()).to_pylist()
        texts = batch.column("TextLog:text").to_pylist()
        levels = batch.column("TextLog:level").to_pylist()
        for time_ns, text, level, change in zip(times, texts, levels, batch.column("change").to_pylist(), strict=True):
            events.append((time_ns / 1e9, text[0], level[0]))
            if change and change[0]:
                changes.append(ParameterChange(time=time_ns / 1e9, **change_of(change[0])))
    events.sort(key=lambda event: event[0])
    told, levels = [event[:2] for event in events], [event[2] for event in events]
    return told, levels, sorted(changes, key=lambda change: change.time)


def _static(batches: list[pa.RecordBatch], component: str) -> object:
    """The last value of a component that has no time; None if there is none."""
    found = [batch.column(component).to_pylist()[-1] for batch in batches if component in batch.schema.names]
    return found[-1][0] if found and found[-1] else None


def _scale(batches: list[pa.RecordBatch]) -> float:
    return _number(_static(batches, "scale"))


def _number(value: object) -> float:
    """A number; NaN for anything else."""
    return float(value) if isinstance(value, int | float) else float("nan")
