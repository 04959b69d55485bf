"""Sends to rerun what is drawn, and the arrangement of the viewer. Needs no ROS."""

from collections import Counter
from collections.abc import Iterable

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings
from numpy.typing import NDArray

from . import layout

_FLUSHED_ROWS = 1 << 21
"""Rows after which rerun's writer is waited for, so that memory does not grow."""

_Times = NDArray[np.int64]
_Array = NDArray[np.float64]
Range = tuple[float, float]


class Canvas:
    """What is drawn of one run.

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
        """Rows by entity."""
        self.ranges = {} if ranges is None else ranges
        self.below = below
        """Entity below which all stands; empty: none."""
        self._stream = stream
        self._events: list[tuple[int, str, str]] = []

    def static(self, entity: str, what: rr.AsComponents) -> None:
        """Draw what has no time."""
        self._stream.log(f"{self.below}{entity}", what, static=True)

    def rows(self, entity: str, times: _Times, columns: Iterable[rr.ComponentColumn]) -> None:
        """Send rows of anything: times (n,) [ns]."""
        self.flush()
        index = rr.TimeColumn(layout.TIMELINE, duration=times.astype("timedelta64[ns]"))
        self._stream.send_columns(f"{self.below}{entity}", [index], columns, strict=True)
        before = self.sent.total() // _FLUSHED_ROWS
        self.sent[entity] += len(times)
        if self.sent.total() // _FLUSHED_ROWS != before:
            self._stream.flush()

    def series(self, entity: str, times: _Times, values: _Array) -> None:
        """Send numbers: times (n,) [ns], values (n,) or (n, width)."""
        wide = values.reshape(len(times), -1)
        self.rows(entity, times, rr.Scalars.columns(scalars=wide if wide.shape[1] > 1 else wide[:, 0]))
        for axis, (low, high) in enumerate(zip(np.fmin.reduce(wide), np.fmax.reduce(wide), strict=True)):
            if low <= high:  # NaN is not part of a range
                before = self.ranges.get((entity, axis), (low, high))
                self.ranges[entity, axis] = min(float(low), before[0]), max(float(high), before[1])

    def event(self, time_ns: int, text: str, level: str) -> None:
        """Add a line of text at a simulated time [ns]; it is sent with what comes next, or by `flush`."""
        self._events.append((time_ns, text, level))

    def flush(self) -> None:
        """Send the events."""
        if self._events:
            times, texts, levels = zip(*self._events, strict=True)
            self._events.clear()
            self.rows(layout.EVENTS, np.array(times), rr.TextLog.columns(text=texts, level=levels))


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
