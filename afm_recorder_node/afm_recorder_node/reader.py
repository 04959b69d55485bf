"""Reads a recording back as arrays in SI units. Needs no ROS and no viewer.

A recording holds nm, nN and us (see `afm_recorder_node.layout`); here they become m, N and s again, to within the
round-off of one multiplication. Times are whole nanoseconds in the file.
"""

import json
import os
import tempfile
import warnings
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import yaml
from numpy.typing import NDArray

from . import layout, pictures
from .checksums import Extent, measure
from .complete import chunks, series
from .layout import Signal
from .recording import (
    Channel,
    DamagedRecording,
    IncompleteRecording,
    ParameterChange,
    Recording,
    RecordingError,
    UncheckedRecording,
)
from .scan_lines import images

_Array = NDArray[np.float64]
_Batches = dict[str, list[pa.RecordBatch]]


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
    batches, whole = _read(path, every)
    time_ticks, ticks = _aligned(batches, layout.TICKS)
    time_samples, channels = _aligned(batches, layout.CHANNELS)
    events, changes = _events(batches[layout.EVENTS])
    text = _static(batches[layout.PARAMETERS], "TextDocument:text")
    tree = yaml.safe_load(str(text)) if text is not None else {}
    score = _static(batches[layout.SCORE], "TextDocument:text")
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
        parameters={node: known["ros__parameters"] for node, known in tree.items()},
        parameter_changes=changes,
        events=events,
        channels=_channels(batches),
        images=list(images(batches[pictures.LINES]).values()),
        score=yaml.safe_load(str(score)) if score is not None else None,
        complete=whole,
    )


@contextmanager
def readable(path: str | os.PathLike[str], *, salvage: bool = False) -> Iterator[tuple[Path, Extent]]:
    """A file that rerun can read to its end, and what of the recording is in it.

    Of one that breaks off within a message, or still grows, that is a copy of what is whole.

    Parameters
    ----------
    path : path
    salvage : bool
        Leave out what has changed since it was written, in place of raising.

    Raises
    ------
    DamagedRecording
        If it is not what was written.
    RecordingError
        If there is no file, or it is no .rrd file.
    """
    try:
        with open(path, "rb") as file:
            extent = measure(file.fileno())
            if not extent.whole:
                raise RecordingError(f"{os.fspath(path)} is no readable recording: it is no .rrd file")
            if extent.damaged and not salvage:
                (begin, end), size = extent.damaged[0], sum(end - begin for begin, end in extent.damaged)
                raise DamagedRecording(
                    f"{os.fspath(path)} is damaged: bytes {begin} to {end} are not what was written ({size} bytes in "
                    "all); `ros2 run afm_recorder_node repair` copies the rest"
                )
            if not extent.damaged and (extent.complete or extent.whole == os.fstat(file.fileno()).st_size):
                yield Path(path), extent
                return
            with tempfile.NamedTemporaryFile(suffix=".rrd") as copy:
                position = 0
                for begin, end in (*extent.damaged, (extent.whole, extent.whole)):
                    # The recorder may cut it back meanwhile, when its disk is full.
                    while position < begin and (
                        block := os.sendfile(copy.fileno(), file.fileno(), position, begin - position)
                    ):
                        position += block
                    position = max(position, end)
                extent.complete = False
                yield Path(copy.name), extent
    except OSError as error:
        raise RecordingError(f"{os.fspath(path)} is no readable recording: {error}") from error


def _read(path: str | os.PathLike[str], every: int) -> tuple[_Batches, bool]:
    """All chunks of the recording, by entity, of the signals one row in `every`; and whether it is complete."""
    ticks = {signal.entity for signal in layout.TICKS}
    batches: _Batches = defaultdict(list)
    with readable(path) as (file, extent):
        try:
            for chunk in chunks(file, whole=extent.complete):
                batch = chunk.to_record_batch()
                entity = chunk.entity_path
                if every > 1 and series(batch) and (entity in ticks or not entity.startswith(f"{layout.PARAMETERS}/")):
                    # All signals of a kind are cut into chunks at the same times, so that they keep the same ones.
                    batch = batch.take(pa.array(range(0, batch.num_rows, every)))
                batches[entity].append(batch)
        # What rerun raises for a file that it cannot read.
        except (RuntimeError, ValueError, OSError) as error:
            raise RecordingError(f"{os.fspath(path)} is no readable recording: {error}") from error
    if not extent.complete:
        warnings.warn(
            f"{os.fspath(path)} has no end: its recorder is still at work, or has died", IncompleteRecording, 3
        )
    elif not extent.sealed:
        warnings.warn(f"{os.fspath(path)} has no checksums: it cannot be checked", UncheckedRecording, 3)
    return batches, extent.complete


def _rows(batches: list[pa.RecordBatch], signal: Signal) -> tuple[NDArray[np.int64], _Array]:
    """Times [ns] and values in SI units of one signal, sorted by time."""
    times, values = [np.empty(0, np.int64)], [np.empty(0)]
    for batch in batches:
        rows = series(batch)
        if rows is not None:
            times.append(rows[0])
            values.append(rows[1])
    t = np.concatenate(times)
    v = np.concatenate(values) / signal.factor
    if signal.axes:
        v = v.reshape(-1, signal.width)
    if len(t) != len(v):
        raise RecordingError(f"{signal.entity} has rows that do not hold {signal.width} numbers")
    if np.any(np.diff(t) < 0):
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
    known = {signal.entity: signal for signal in layout.CHANNELS}
    channels = {}
    for entity in (*known, *layout.further(batches)):
        unit, factor = _static(batches[entity], "unit"), _static(batches[entity], "factor")
        if entity not in known and np.isnan(_number(factor)):
            continue
        signal = known.get(entity) or Signal(entity, "", _number(factor), str(unit))
        times, values = _rows(batches[entity], signal)
        channels[signal.name] = Channel(times / 1e9, values, signal.si_unit, _scale(batches[entity]))
    return channels


def _events(batches: list[pa.RecordBatch]) -> tuple[list[tuple[float, str]], list[ParameterChange]]:
    events, changes = [], []
    for batch in batches:
        times = batch.column(layout.TIMELINE).cast(pa.int64()).to_pylist()
        texts = batch.column("TextLog:text").to_pylist()
        for time_ns, text, change in zip(times, texts, batch.column("change").to_pylist(), strict=True):
            events.append((time_ns / 1e9, text[0]))
            if change and change[0]:
                changes.append(ParameterChange(time=time_ns / 1e9, **json.loads(change[0])))
    return sorted(events, key=lambda event: event[0]), sorted(changes, key=lambda change: change.time)


def _static(batches: list[pa.RecordBatch], component: str) -> object:
    """The last value of a component that has no time; None if there is none."""
    found = [batch.column(component).to_pylist()[-1] for batch in batches if component in batch.schema.names]
    return found[-1][0] if found and found[-1] else None


def _scale(batches: list[pa.RecordBatch]) -> float:
    return _number(_static(batches, "scale"))


def _number(value: object) -> float:
    """A number; NaN for anything else."""
    return float(value) if isinstance(value, int | float) else float("nan")
