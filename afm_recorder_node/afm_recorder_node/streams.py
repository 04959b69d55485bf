"""Sends what is drawn to rerun: rows of an entity in large chunks, and the arrangement of the viewer. Needs no ROS."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings
from numpy.typing import NDArray

from . import layout

_CHUNK_ROWS = 32_768
"""Rows of a chunk at most; one costs some 0.3 ms to read and 1 kB in the file."""
_FLUSHED_ROWS = 1 << 21
"""Rows after which rerun's writer is waited for, so that memory does not grow."""

_Times = NDArray[np.int64]
_Array = NDArray[np.float64]
Range = tuple[float, float]
Look = Callable[[str, _Times, _Array], None]
"""Gets the rows of an entity: times (n,) [ns], values (n, width) as they are drawn."""


class Canvas:
    """What is drawn of one run. Rows are collected, and sent by `flush` or when there are many.

    Parameters
    ----------
    stream : rr.RecordingStream
    below : str
        Entity below which all stands, such as /tanh; empty: none.
    ranges : dict, optional
        Least and largest number of each signal, by entity and axis, which grow with what is drawn.
    """

    def __init__(
        self, stream: rr.RecordingStream, below: str = "", ranges: dict[tuple[str, int], Range] | None = None
    ) -> None:
        self.sent = Counter[str]()
        """Rows by entity, as far as they have been sent."""
        self.ranges = {} if ranges is None else ranges
        self.looks: list[Look] = []
        """Called with the numbers that are sent."""
        self._stream, self._below = stream, below
        self._waiting: dict[str, list[tuple[_Times, _Array]]] = defaultdict(list)
        self._rows = Counter[str]()  # that wait
        self._events: list[tuple[int, str, str]] = []

    @property
    def below(self) -> str:
        """Entity below which all stands; empty: none."""
        return self._below

    def static(self, entity: str, what: rr.AsComponents) -> None:
        """Draw what has no time."""
        self._stream.log(f"{self._below}{entity}", what, static=True)

    def rows(self, entity: str, times: _Times, columns: Iterable[rr.ComponentColumn]) -> None:
        """Send rows of anything: times (n,) [ns]."""
        index = rr.TimeColumn(layout.TIMELINE, duration=times.astype("timedelta64[ns]"))
        self._stream.send_columns(f"{self._below}{entity}", [index], columns, strict=True)
        before = self.sent.total() // _FLUSHED_ROWS
        self.sent[entity] += len(times)
        if self.sent.total() // _FLUSHED_ROWS != before:
            self._stream.flush()

    def series(self, entity: str, times: _Times, values: _Array) -> None:
        """Draw numbers: times (n,) [ns], values (n,) or (n, width)."""
        self._waiting[entity].append((times, values))
        self._rows[entity] += len(times)
        if self._rows[entity] >= _CHUNK_ROWS:
            self._send(entity)

    def event(self, time_ns: int, text: str, level: str) -> None:
        """Add a line of text at a simulated time [ns]."""
        self._events.append((time_ns, text, level))

    def flush(self) -> None:
        """Send what has been collected."""
        for entity in list(self._waiting):
            self._send(entity)
        if self._events:
            times, texts, levels = zip(*self._events, strict=True)
            self._events.clear()
            self.rows(layout.EVENTS, np.array(times), rr.TextLog.columns(text=texts, level=levels))

    def _send(self, entity: str) -> None:
        times, values = (np.concatenate(each) for each in zip(*self._waiting.pop(entity), strict=True))
        del self._rows[entity]
        self.rows(entity, times, rr.Scalars.columns(scalars=values))
        wide = values.reshape(len(times), -1)
        for axis, (low, high) in enumerate(zip(np.fmin.reduce(wide), np.fmax.reduce(wide), strict=True)):
            if low <= high:  # NaN is not part of a range
                before = self.ranges.get((entity, axis), (low, high))
                self.ranges[entity, axis] = min(float(low), before[0]), max(float(high), before[1])
        for look in self.looks:
            look(entity, times, wide)


def send_blueprint(stream: rr.RecordingStream, blueprint: rrb.Blueprint, application: str = layout.APPLICATION) -> None:
    """Arrange the viewer. rerun's own function keeps two threads and 1 MB of each call until the process ends."""
    native = rerun_bindings.new_blueprint(application, make_default=False, make_thread_default=False)
    arranged = rr.RecordingStream._from_native(native)
    arranged.set_time("blueprint", sequence=0)
    blueprint._log_to_stream(arranged)
    memory = arranged.memory_recording()
    rerun_bindings.send_blueprint(memory.storage, make_active=True, make_default=True, recording=stream.to_native())
    # The stream holds its memory, and that the stream. A scan arranges the viewer again with each image.
    arranged.disconnect()
    del arranged, memory, native
    let_go()


def let_go() -> None:
    """Free the streams that nobody refers to: rerun keeps their threads and memory as long as the process."""
    rerun_bindings.flush_and_cleanup_orphaned_recordings()
