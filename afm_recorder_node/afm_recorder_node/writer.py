"""Writes one recording: columns of numbers in, one rerun file out, and a live viewer if wanted. Needs no ROS."""

import ctypes
import json
import os
import socket
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import rerun as rr
import yaml
from numpy.typing import ArrayLike, NDArray
from rerun.chunk import RrdReader

from . import layout
from .layout import Signal, instants

_CHUNK_ROWS = 32_768
"""Rows sent at once. A chunk costs some 0.3 ms, 1 kB in the file, and 0.3 kB of memory until the file is closed."""
_LIVE_MEMORY = "256MiB"
"""What the live server keeps for viewers that connect late; it drops the oldest first."""

_FLUSH_LIMIT = 30.0
"""Wall time that the disk has to take what is left [s]. rerun would wait for ever if a write fails meanwhile."""

_Array = NDArray[np.float64]
Level = Literal["INFO", "WARN", "ERROR"]


@dataclass
class _Column:
    """Rows that wait to be sent."""

    times: list[NDArray[np.int64]] = field(default_factory=list)
    values: list[_Array] = field(default_factory=list)
    rows: int = 0


class RecordingWriter:
    """One recording. Nothing stands under its name before `close`; until then it grows in `partial` beside it.

    Parameters
    ----------
    path : path
        Name of the recording; an older one of that name is replaced on `close`.
    live_port : int or None
        Port of a gRPC server that rerun viewers can connect to while the recording grows; None: no server.
    live_address : str
        Address of that server.

    Raises
    ------
    OSError
        If the file cannot be written or the port is taken.
    """

    def __init__(
        self, path: str | os.PathLike[str], *, live_port: int | None = None, live_address: str = "127.0.0.1"
    ) -> None:
        self.path = Path(path)
        if self.path.is_dir():
            raise IsADirectoryError(f"{self.path} is a folder, it must be a file")
        self.partial = self.path.with_name(f".{self.path.name}.partial")
        if live_port is not None:
            _require_free(live_address, live_port)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.partial.open("wb").close()  # rerun's own error would be no OSError
        self._rows = 0
        self._columns = {signal.entity: _Column() for signal in (*layout.CHANNELS, *layout.TICKS)}
        self._scales: dict[str, float] = {}
        self._parameters: dict[str, dict[str, object]] = {}
        self._changed: dict[str, float] = {}
        self._end_ns = 0
        self._closed = False
        self._stream = rr.RecordingStream(layout.APPLICATION)
        sinks: list[rr.sinks.LogSinkLike] = [rr.FileSink(self.partial)]
        if live_port is not None:
            sinks.append(rr.GrpcServerSink(live_address, live_port, server_memory_limit=_LIVE_MEMORY))
        self._stream.set_sinks(*sinks, default_blueprint=layout.blueprint())
        for signal in (*layout.CHANNELS, *layout.TICKS):
            style = rr.SeriesLines(names=signal.names, colors=signal.colors)
            self._stream.log(signal.entity, style, static=True)

    def channel(self, signal: Signal, first: int, period: float, samples: ArrayLike, scale: float = 1.0) -> None:
        """Samples of a detector channel, one of `layout.CHANNELS`.

        Parameters
        ----------
        signal : Signal
        first : int
            Number of the first sample since the start of the run.
        period : float [s]
        samples : ndarray (n,) [V], or in SI units with scale 1
        scale : float
            SI units per unit of a sample. Kept in the recording, so that a photodetector's voltage can be recovered.
        """
        values = np.asarray(samples, dtype=np.float64)
        if self._scales.get(signal.entity) != scale:
            self._scales[signal.entity] = scale
            self._stream.log(signal.entity, rr.AnyValues(scale=scale), static=True)
        self._append(signal, instants(first, len(values), period), values * (scale * signal.factor))

    def control(
        self,
        first: int,
        period: float,
        *,
        position: ArrayLike,
        reference: ArrayLike,
        deflection: ArrayLike,
        drive: ArrayLike,
        round_trip: ArrayLike,
        cantilever_height: float = 0.0,
    ) -> None:
        """What went between instrument and controller at n control ticks.

        The error is that of the scanner along x and y, and of the tip, at height a + deflection, along z.

        Parameters
        ----------
        first : int
            Number of the first tick since the start of the run.
        period : float [s]
        position, reference : ndarrays (n, 3) [m]
        deflection : ndarray (n,) [m]
        drive : ndarray (n, 3) [V]
        round_trip : ndarray (n,) [s]
        cantilever_height : float [m]
            Height a of the cantilever's rest position.
        """
        x = np.asarray(position, dtype=np.float64)
        r = np.asarray(reference, dtype=np.float64)
        error = x - r
        error[:, 2] = cantilever_height + np.asarray(deflection) - r[:, 2]
        times = instants(first, len(x), period)
        for signal, values in (
            (layout.POSITION, x),
            (layout.REFERENCE, r),
            (layout.ERROR, error),
            (layout.DRIVE, np.asarray(drive, dtype=np.float64)),
            (layout.ROUND_TRIP, np.asarray(round_trip, dtype=np.float64)),
        ):
            self._append(signal, times, values * signal.factor)

    def event(self, time_ns: int, text: str, level: Level = "INFO") -> None:
        """A line of text at a simulated time [ns]."""
        self._send_event(time_ns, text, level, "")

    def parameters(self, node: str, values: Mapping[str, object]) -> None:
        """Parameters of a node as they are when the recording begins, or when the node appears."""
        self._parameters.setdefault(node, {}).update(values)
        # The layout of a ROS parameter file: what a run was made with can be copied from the viewer and used again.
        tree = {name: {"ros__parameters": known} for name, known in self._parameters.items()}
        self._stream.log(layout.PARAMETERS, rr.TextDocument(yaml.safe_dump(tree)), static=True)

    def parameter_change(self, time_ns: int, node: str, name: str, old: object, new: object) -> None:
        """A parameter has changed at a simulated time [ns]; numbers become a plot of steps too."""
        change = {"node": node, "name": name, "old": old, "new": new}
        self._send_event(time_ns, f"{node}: {name} changed from {old} to {new}", "INFO", json.dumps(change))
        if not isinstance(old, int | float) or not isinstance(new, int | float):
            return
        entity = f"{layout.PARAMETERS}/{rr.escape_entity_path_part(node)}/{rr.escape_entity_path_part(name)}"
        if entity not in self._changed:
            style = rr.SeriesLines(names=f"{node} {name}", interpolation_mode="StepAfter")
            self._stream.log(entity, style, static=True)
            self._send(entity, np.zeros(1, np.int64), np.array([float(old)]))
        self._send(entity, np.array([time_ns]), np.array([float(new)]))
        self._changed[entity] = float(new)
        self._end_ns = max(self._end_ns, time_ns)

    def flush(self) -> None:
        """Send what waits to become a larger chunk: a live viewer then has it."""
        for entity in self._columns:
            self._send_column(entity)

    def close(self) -> Path | None:
        """Finish the recording and give it its name.

        Returns
        -------
        Path of the recording; None if it is closed already, or holds no sample: then there is no file.

        Raises
        ------
        OSError
            If it could not be written completely; what could be written stays in `partial`.
        """
        if self._closed:
            return None
        self._closed = True
        self.flush()
        # A step lasts until the end of the recording.
        for entity, value in self._changed.items():
            self._send(entity, np.array([self._end_ns]), np.array([value]))
        try:
            self._stream.flush(timeout_sec=_FLUSH_LIMIT)
            self._stream.disconnect()
            if not self._rows:
                self.partial.unlink()
                return None
            # rerun only logs a line when a write fails. The manifest at the end of the file is there if none did.
            RrdReader(self.partial).store()
        except RuntimeError as error:
            # Ending the stream, even with the process, may wait for ever for a thread of rerun's that has died.
            rr.unregister_shutdown()
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(self._stream))
            raise OSError(f"{self.partial} is incomplete: {error}") from error
        with self.partial.open("rb") as file:
            os.fsync(file.fileno())
        os.replace(self.partial, self.path)
        return self.path

    def _append(self, signal: Signal, times: NDArray[np.int64], values: _Array) -> None:
        expected = (len(times), signal.width) if signal.axes else (len(times),)
        if values.shape != expected:
            raise ValueError(f"{signal.entity}: shape {values.shape} where {expected} belongs")
        if not len(times):
            return
        column = self._columns[signal.entity]
        column.times.append(times)
        column.values.append(values)
        column.rows += len(times)
        self._rows += len(times)
        self._end_ns = max(self._end_ns, int(times[-1]))
        if column.rows >= _CHUNK_ROWS:
            self._send_column(signal.entity)

    def _send_column(self, entity: str) -> None:
        column, self._columns[entity] = self._columns[entity], _Column()
        if column.rows:
            self._send(entity, np.concatenate(column.times), np.concatenate(column.values))

    def _send(self, entity: str, times: NDArray[np.int64], values: _Array) -> None:
        index = rr.TimeColumn(layout.TIMELINE, duration=times.astype("timedelta64[ns]"))
        self._stream.send_columns(entity, [index], rr.Scalars.columns(scalars=values), strict=True)

    def _send_event(self, time_ns: int, text: str, level: Level, change: str) -> None:
        index = rr.TimeColumn(layout.TIMELINE, duration=np.array([time_ns], "timedelta64[ns]"))
        columns = [*rr.TextLog.columns(text=[text], level=[level]), *rr.AnyValues.columns(change=[change])]
        self._stream.send_columns(layout.EVENTS, [index], columns, strict=True)


def _require_free(address: str, port: int) -> None:
    """Raise if the port is taken: rerun would only log a line, and record on without a server."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
        except OSError as error:
            raise OSError(f"live_port {port} on {address} is not available: {error.strerror}") from None
