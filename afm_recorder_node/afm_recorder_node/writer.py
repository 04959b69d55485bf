"""Writes one recording: columns of numbers in, one rerun file out, and a live viewer if wanted. Needs no ROS."""

import json
import os
import socket
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import rerun as rr
import yaml
from numpy.typing import ArrayLike, NDArray

from . import layout, pictures
from .complete import NoRoom, complete, send_series, verify
from .frames import END, HEADER, without_ends
from .gaps import Gaps
from .layout import Signal, instants
from .partial import Partial, check_name
from .scan_lines import ScanLine
from .scan_writer import ScanWriter

_CHUNK_ROWS = 32_768
"""Rows written at once, whenever they come; fewer are written by `flush`."""
_COPIED_UP_TO = 2_000_000_000
"""Larger files are finished in place [bytes]: a copy takes half a second for each minute of a run at 1 kHz."""
_LIVE_MEMORY = "256MiB"
"""What the live server keeps for viewers that connect late; it drops the oldest first."""

_Array = NDArray[np.float64]
Level = Literal["INFO", "WARN", "ERROR"]


@dataclass
class _Column:
    """Rows that wait to be sent."""

    times: list[NDArray[np.int64]] = field(default_factory=list)
    values: list[_Array] = field(default_factory=list)
    rows: int = 0


class RecordingWriter:
    """One recording. It grows in the file `partial`, and gets its name in `close`.

    While the file cannot be written, rows are dropped; an event then describes the missing rows.

    Parameters
    ----------
    path : path
        Name of the recording; an older one of that name is replaced on `close`.
    live_port : int or None
        Port of a gRPC server that rerun viewers can connect to while the recording grows; None: no server.
    live_address : str
        Address of that server.
    patient : bool
        If the file cannot be made now, try again while rows come, in place of raising.

    Raises
    ------
    OSError
        If the file cannot be written, another recorder writes it, or the port is taken.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        live_port: int | None = None,
        live_address: str = "127.0.0.1",
        patient: bool = False,
    ) -> None:
        self.path = Path(path).absolute()
        check_name(self.path)
        if live_port is not None:
            _require_free(live_address, live_port)
        self._sent: Counter[str] = Counter()
        self._columns: dict[str, _Column] = {}
        self._scales: dict[str, float] = {}
        self._parameters: dict[str, dict[str, object]] = {}
        self._changed: dict[str, float] = {}
        self._gaps = Gaps()
        self.unwritten = self._gaps.unwritten
        """Missing rows of each signal, received while the file could not be written."""
        self.scored = False
        """Whether it holds a score."""
        self._end_ns = 0
        self._closed = False
        self._stream = rr.RecordingStream(layout.APPLICATION)
        # rerun's own file sink only logs a line when a write fails, and remembers each chunk until the end.
        self._bytes = rr.binary_stream(self._stream)
        sinks: list[rr.sinks.LogSinkLike] = [self._bytes]
        if live_port is not None:
            sinks.append(rr.GrpcServerSink(live_address, live_port, server_memory_limit=_LIVE_MEMORY))
        self._stream.set_sinks(*sinks, default_blueprint=layout.blueprint())
        first = self._bytes.read() or b""
        try:
            self._file = Partial(self.path, first[:HEADER], patient=patient)
        except BaseException:
            self._end_stream()
            raise
        self._file.write(without_ends(first))
        for signal in (*layout.CHANNELS, *layout.TICKS):
            self._declare(signal)
        self._scans = ScanWriter(self._stream, self._sent, self.event, self._arrange)

    @property
    def partial(self) -> Path:
        """Where the recording grows."""
        return self._file.path

    @property
    def set_aside(self) -> Path | None:
        """New name of a partial recording that a killed recorder had left; None if there was none."""
        return self._file.set_aside

    @property
    def problem(self) -> str:
        """Why the file cannot be written at present; empty if it can."""
        return self._file.problem

    def take_news(self) -> str:
        """Last event of the file, once; empty if there was none."""
        news, self._file.news = self._file.news, ""
        return news

    def channel(self, signal: Signal, first: int, period: float, samples: ArrayLike, scale: float = 1.0) -> None:
        """Samples of a detector channel, one of `layout.CHANNELS` or another made by `layout.signal`.

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
        if signal.entity not in self._columns:
            self._declare(signal)
            self._arrange()
        if self._scales.get(signal.entity) != scale:
            self._scales[signal.entity] = scale
            about = rr.AnyValues(scale=scale, factor=signal.factor, unit=signal.si_unit)
            self._stream.log(signal.entity, about, static=True)
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
        """Measurements and drives of n control ticks.

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
            Height a of the cantilever's rest position; NaN: not known, then the error along z is NaN.
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

    def line(self, line: ScanLine) -> None:
        """One direction of one line of a scan; the image of the scan is drawn as it grows."""
        if self.problem:
            self._gaps.put(pictures.LINES, np.array([line.time_ns]), self.problem)
        else:
            self._scans.put(line)

    def event(self, time_ns: int, text: str, level: Level = "INFO") -> None:
        """A line of text at a simulated time [ns]."""
        self._send_event(time_ns, text, level, "")

    def score(self, time_ns: int, values: Mapping[str, object]) -> None:
        """The score of the run, and when it came: simulated time [ns]."""
        self.scored = True
        self._stream.log(layout.SCORE, rr.TextDocument(yaml.safe_dump(dict(values), sort_keys=False)), static=True)
        self._send_event(time_ns, "the score of the run is here", "INFO", "")

    def parameters(self, node: str, values: Mapping[str, object]) -> None:
        """Parameters of a node as they are when the recording begins, or when the node appears."""
        self._parameters.setdefault(node, {}).update(values)
        # The layout of a ROS parameter file, so that it can be copied from the viewer and used again.
        tree = {name: {"ros__parameters": known} for name, known in self._parameters.items()}
        self._stream.log(layout.PARAMETERS, rr.TextDocument(yaml.safe_dump(tree)), static=True)

    def parameter_change(self, time_ns: int, node: str, name: str, old: object, new: object) -> None:
        """A parameter has changed at a simulated time [ns]; numbers become a plot of steps too.

        `old` is None for one that has not been there.
        """
        change = {"node": node, "name": name, "old": old, "new": new}
        # A parameter of bytes is a list of bytes, which JSON does not have.
        text = f"{node}: {name} is {new}" if old is None else f"{node}: {name} changed from {old} to {new}"
        self._send_event(time_ns, text, "INFO", json.dumps(change, default=list))
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
        """Write all rows received so far to the file and to a live viewer; a kill does not lose them."""
        for entity in self._columns:
            self._send_column(entity)
        self._write()

    def close(self) -> Path | None:
        """Finish the recording, read it back and give it its name.

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
        # A step lasts until the end of the recording.
        for entity, value in self._changed.items():
            self._send(entity, np.array([self._end_ns]), np.array([value]))
        self._scans.finish()
        self.flush()
        self._end_stream()
        if not any(self._sent[entity] for entity in self._columns):
            self._file.discard()
            return None
        try:
            if self.problem:
                raise OSError(self.problem)
            check_name(self.path)
            try:
                if self.partial.stat().st_size > _COPIED_UP_TO:
                    raise NoRoom
                complete(self.partial, self.path, self._sent)
                self._file.discard()
            except NoRoom:
                self._finish_in_place()
        except OSError as error:
            self._file.release()
            raise OSError(f"{self.partial} is incomplete: {error}") from error
        return self.path

    def _finish_in_place(self) -> None:
        """Without room or time for a copy the file keeps its small chunks, and has no index."""
        if not self._file.write(END):
            raise OSError(self.problem)
        verify(self.partial, self._sent, index=False)
        self._file.give_name(self.path)

    def _end_stream(self) -> None:
        self._stream.disconnect()
        self._bytes.read(flush=False)  # read the index, or rerun logs its absence

    def _arrange(self) -> None:
        """Arrange the present signals and images in the viewer."""
        self._stream.send_blueprint(
            layout.blueprint(layout.further(self._columns), pictures.pictures(self._scans.shown))
        )

    def _declare(self, signal: Signal) -> None:
        self._columns[signal.entity] = _Column()
        style = rr.SeriesLines(names=signal.names, colors=signal.colors)
        self._stream.log(signal.entity, style, static=True)

    def _append(self, signal: Signal, times: NDArray[np.int64], values: _Array) -> None:
        expected = (len(times), signal.width) if signal.axes else (len(times),)
        if values.shape != expected:
            raise ValueError(f"{signal.entity}: shape {values.shape} is not allowed: it must be {expected}")
        if not len(times):
            return
        if self.problem:
            self._gaps.put(signal.entity, times, self.problem)
            return
        column = self._columns[signal.entity]
        column.times.append(times)
        column.values.append(values)
        column.rows += len(times)
        self._end_ns = max(self._end_ns, int(times[-1]))
        if column.rows >= _CHUNK_ROWS:
            self._send_column(signal.entity)
            self._write()

    def _write(self) -> None:
        """Write the encoded data to the file; after a gap, add an event about the missing rows."""
        if self._file.write(without_ends(self._bytes.read() or b"")) and self._gaps.open:
            self.event(*self._gaps.take(), "ERROR")
            self._file.write(without_ends(self._bytes.read() or b""))

    def _send_column(self, entity: str) -> None:
        column, self._columns[entity] = self._columns[entity], _Column()
        if column.rows:
            self._send(entity, np.concatenate(column.times), np.concatenate(column.values))

    def _send(self, entity: str, times: NDArray[np.int64], values: _Array) -> None:
        send_series(self._stream, entity, times, values)
        self._sent[entity] += len(times)

    def _send_event(self, time_ns: int, text: str, level: Level, change: str) -> None:
        index = rr.TimeColumn(layout.TIMELINE, duration=np.array([time_ns], "timedelta64[ns]"))
        columns = [*rr.TextLog.columns(text=[text], level=[level]), *rr.AnyValues.columns(change=[change])]
        self._stream.send_columns(layout.EVENTS, [index], columns, strict=True)
        self._sent[layout.EVENTS] += 1


def _require_free(address: str, port: int) -> None:
    """Raise if the port is taken: rerun would only log a line and record without a server."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((address, port))
        except OSError as error:
            raise OSError(f"live_port {port} on {address} is not available: {error.strerror}") from None
