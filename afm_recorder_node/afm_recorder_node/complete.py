"""Completes a recording that was interrupted or has just ended: large chunks, index, verified. Needs no ROS."""

import ctypes
import itertools
import os
import warnings
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray
from rerun.chunk import Chunk, RrdReader

from . import layout, screens
from .checksums import measure, seal_file
from .columns import numbers
from .friction_loop import FrictionLoop
from .names import claim
from .scene import Scene
from .streams import give_up, let_go, send_blueprint, send_event, send_series

_CHUNK_ROWS = 32_768
"""Rows of a chunk; one costs some 0.3 ms to read and 1 kB in the file."""
_FLUSHED_ROWS = 1 << 21
"""Rows after which the writer waits for the disk, so that memory does not grow."""
_FLUSH_LIMIT = 60.0
"""Longest wall time to wait for the disk [s]. rerun would wait for ever after a failed write."""

_Rows = tuple[NDArray[np.int64], NDArray[np.float64]]


class NoRoom(OSError):
    """There is no room for a second file."""


@dataclass
class _Batch:
    """Rows of one entity that become one chunk."""

    times: list[NDArray[np.int64]] = field(default_factory=list)
    values: list[NDArray[np.float64]] = field(default_factory=list)
    rows: int = 0


def complete(
    source: Path, targets: Iterable[Path], expected: Mapping[str, int] | None = None, note: str = ""
) -> tuple[Path, Counter[str]]:
    """Copy the contents of a recording without an end into a complete one.

    No file has the name of a recording before all of it has been read back, and none is replaced.

    Parameters
    ----------
    source : Path
        Whole messages, perhaps without an end; see `afm_recorder_node.readable.readable`.
    targets : iterable of Path
        Names for it: it gets the first one that is free.
    expected : mapping, optional
        Rows that each entity has to have. Without it the source may end in something that cannot be read.
    note : str
        Text of an event at the end of the copy.

    Returns
    -------
    (Path, Counter)
        Its name; rows by entity.

    Raises
    ------
    NoRoom
        If there is no room for a copy.
    OSError
        If it could not be written, is not what it should be, or no name is free. `source` is untouched in any case.
    """
    if expected is not None and not _unchanged(source):
        raise OSError(f"{source} has been changed by somebody else")
    names = iter(targets)
    target = next(names)
    closing = target.with_stem(f"{target.stem}.closing")
    with suppress(FileNotFoundError):
        closing.unlink()
    free, size = _free(target.parent), source.stat().st_size
    if free < size:
        raise NoRoom(f"{target} needs {size / 1e6:.0f} MB, {free / 1e6:.0f} MB are free")
    file = os.open(closing, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
    try:
        written, added = _copy(source, file, note, whole=expected is not None)
        let_go()
        if expected is not None and written != Counter(expected):
            raise OSError(f"{source} does not contain the written data: {_difference(written, expected)}")
        seal_file(file)
        verify(closing, written + added)
        os.fsync(file)
        name = claim(closing, itertools.chain([target], names))
    except BaseException:
        with suppress(FileNotFoundError):
            closing.unlink()
        raise
    finally:
        os.close(file)
    return name, written


def chunks(path: Path, *, whole: bool = True, entities: Sequence[str] = ()) -> Iterator[Chunk]:
    """All chunks of the recording in a file; if it is not `whole`, those before the first that cannot be read.

    Parameters
    ----------
    path : Path
    whole : bool
    entities : sequence of str
        Only those of these entities, in rerun's expressions: of a recording with an index no other one is read.

    Raises
    ------
    ValueError
        If it is no recording of this microscope.
    RuntimeError
        If rerun cannot read it.
    """
    with warnings.catch_warnings():
        # rerun reports a missing index, which is known here.
        warnings.simplefilter("ignore", rr.error_utils.RerunWarning)
        reader = RrdReader(path)
        stores = reader.recordings()
    if not stores or stores[0].application_id != layout.APPLICATION:
        raise ValueError("it is no recording of this microscope")
    stream = None
    if entities and whole:
        with suppress(ValueError, RuntimeError):
            stream = reader.store(store=stores[0]).stream()
    stream = stream or reader.stream(store=stores[0])
    try:
        yield from stream.filter(content=list(entities)) if entities else stream
    except (RuntimeError, ValueError):
        if whole:
            raise


def series(batch: pa.RecordBatch) -> _Rows | None:
    """Times [ns] and numbers of a chunk; None if it holds something else. ValueError if one is missing."""
    if layout.SCALARS not in batch.schema.names or layout.TIMELINE not in batch.schema.names:
        return None
    times, values = batch.column(layout.TIMELINE).cast(pa.int64()), batch.column(layout.SCALARS).flatten()
    return numbers(times), numbers(values)


def _copy(source: Path, file: int, note: str, whole: bool) -> tuple[Counter[str], Counter[str]]:
    """Rows of each entity that the source holds, and those that were added."""
    written, added = Counter[str](), Counter[str]()
    batches: dict[str, _Batch] = defaultdict(_Batch)
    loop, scene, ranges = FrictionLoop(), Scene(), dict[tuple[str, int], screens.Range]()
    last = 0
    with ending(rr.RecordingStream(layout.APPLICATION, send_properties=False)) as stream:
        # Through the open file: the name may now belong to another file.
        stream.set_sinks(rr.FileSink(f"/proc/self/fd/{file}"))

        def send(entity: str) -> None:
            batch = batches.pop(entity)
            send_series(stream, entity, np.concatenate(batch.times), np.concatenate(batch.values))

        for chunk in chunks(source, whole=whole):
            if chunk.entity_path.startswith(f"{layout.SCENE}/"):  # of a damaged recording: it is drawn again
                continue
            rows = None if chunk.is_static else series(chunk.to_record_batch())
            if rows is None or len(rows[0]) != chunk.num_rows or len(rows[1]) % max(chunk.num_rows, 1):
                scene.see(chunk)
                stream.send_chunks(chunk)
            else:
                times, values = rows
                last = max(last, int(times[-1]))
                batch = batches[chunk.entity_path]
                batch.times.append(times)
                batch.values.append(values.reshape(len(times), -1))
                loop.put(chunk.entity_path, times, batch.values[-1])
                scene.put(chunk.entity_path, times, batch.values[-1])
                widen(ranges, chunk.entity_path, batch.values[-1])
                batch.rows += len(times)
                if batch.rows >= _CHUNK_ROWS:
                    send(chunk.entity_path)
            before = written.total()
            written[chunk.entity_path] += 0 if chunk.is_static else chunk.num_rows
            if before // _FLUSHED_ROWS != written.total() // _FLUSHED_ROWS:
                stream.flush(timeout_sec=_FLUSH_LIMIT)
        for entity in list(batches):
            send(entity)
        loop.send(stream)
        added += scene.send(stream)
        if note:
            send_event(stream, last, note, "ERROR")
            added[layout.EVENTS] += 1
        send_blueprint(stream, screens.blueprint(written, ranges))
    return +written, added


def widen(ranges: dict[tuple[str, int], screens.Range], entity: str, values: NDArray[np.float64]) -> None:
    """Let the ranges of a signal hold these values (n, width) too; NaN is none."""
    for axis, (low, high) in enumerate(zip(np.fmin.reduce(values), np.fmax.reduce(values), strict=True)):
        if low <= high:
            before = ranges.get((entity, axis), (low, high))
            ranges[entity, axis] = min(float(low), before[0]), max(float(high), before[1])


@contextmanager
def ending(stream: rr.RecordingStream) -> Iterator[rr.RecordingStream]:
    """End the stream, and wait until its file is written; OSError if it could not be."""
    try:
        yield stream
        stream.flush(timeout_sec=_FLUSH_LIMIT)
        stream.disconnect()
    except (RuntimeError, ValueError) as error:
        # Ending the stream, even with the process, may wait for ever for a thread of rerun's that has died.
        give_up()
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(stream))
        raise OSError(str(error)) from error


def verify(path: Path, expected: Mapping[str, int], *, index: bool = True) -> None:
    """Read a file to its end, and its index: rerun reports its own failed writes in the log only.

    Raises
    ------
    OSError
        If it cannot be read, or does not hold the rows that are expected of each entity.
    """
    found: Counter[str] = Counter()
    if not _unchanged(path):
        raise OSError(f"{path} could not be written completely: what was read back is not what was written")
    try:
        if index:
            RrdReader(path).store()
        for chunk in chunks(path):
            found[chunk.entity_path] += 0 if chunk.is_static else chunk.num_rows
    except (RuntimeError, ValueError) as error:
        raise OSError(f"{path} could not be written completely: {error}") from error
    if +found != +Counter(expected):
        raise OSError(f"{path} could not be written completely: {_difference(found, expected)}")


def _unchanged(path: Path) -> bool:
    """Whether all of a file is what was written."""
    with open(path, "rb") as file:
        extent = measure(file.fileno())
        return (
            extent.sealed
            and not extent.damaged
            and (extent.complete or extent.whole == os.fstat(file.fileno()).st_size)
        )


def _difference(found: Mapping[str, int], expected: Mapping[str, int]) -> str:
    wrong = {name for name in {*found, *expected} if found.get(name, 0) != expected.get(name, 0)}
    return ", ".join(f"{found.get(name, 0)} of {expected.get(name, 0)} rows of {name}" for name in sorted(wrong))


def _free(folder: Path) -> int:
    room = os.statvfs(folder)
    return room.f_bavail * room.f_frsize
