"""What is sent to rerun, and how its streams are let go of. Needs no ROS."""

from collections.abc import Iterable

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings
from numpy.typing import NDArray

from . import layout

_stuck = False
"""Whether a stream of this process could not be ended: to wait for it would take for ever."""


def send_series(stream: rr.RecordingStream, entity: str, times: NDArray[np.int64], values: NDArray[np.float64]) -> None:
    """Send rows of numbers as one chunk: times (n,) [ns], values (n,) or (n, width)."""
    if values.ndim == 2 and values.shape[1] == 1:
        values = values[:, 0]
    send_columns(stream, entity, times, rr.Scalars.columns(scalars=values))


def send_event(stream: rr.RecordingStream, time_ns: int, text: str, level: str, change: str = "") -> None:
    """Send a line of text; `change` describes a changed parameter in JSON."""
    columns = [*rr.TextLog.columns(text=[text], level=[level]), *rr.AnyValues.columns(change=[change])]
    send_columns(stream, layout.EVENTS, np.array([time_ns]), columns)


def send_columns(
    stream: rr.RecordingStream,
    entity: str,
    times: NDArray[np.int64],
    columns: Iterable[rr.ComponentColumn],
) -> None:
    """Send rows as one chunk: times (n,) [ns], columns with n values each."""
    index = rr.TimeColumn(layout.TIMELINE, duration=times.astype("timedelta64[ns]"))
    stream.send_columns(entity, [index], columns, strict=True)


def send_blueprint(stream: rr.RecordingStream, blueprint: rrb.Blueprint, application: str = layout.APPLICATION) -> None:
    """Arrange the viewer. rerun's own function keeps two threads and 1 MB of each call until the process ends."""
    native = rerun_bindings.new_blueprint(application, make_default=False, make_thread_default=False)
    arranged = rr.RecordingStream._from_native(native)
    arranged.set_time("blueprint", sequence=0)
    blueprint._log_to_stream(arranged)
    memory = arranged.memory_recording()
    rerun_bindings.send_blueprint(memory.storage, make_active=True, make_default=True, recording=stream.to_native())
    # The stream holds its memory, and that the stream. A scan arranges the viewer anew with each image.
    arranged.disconnect()
    del arranged, memory, native
    let_go()


def let_go() -> None:
    """Free the streams that nobody refers to: rerun keeps their threads and memory as long as the process."""
    if not _stuck:
        rerun_bindings.flush_and_cleanup_orphaned_recordings()


def give_up() -> None:
    """A stream cannot be ended, because a thread of rerun's has died: from now on none is waited for."""
    global _stuck
    _stuck = True
    rr.unregister_shutdown()
