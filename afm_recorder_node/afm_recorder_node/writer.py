"""Writes one recording: columns of numbers in, one rerun file out. Needs no ROS."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np
import rerun as rr
from numpy.typing import ArrayLike, NDArray

from afm_model.core.shown import shown
from afm_model.parameters.strict_yaml import yaml_text

from . import layout, pictures, screens
from .layout import Signal, instants
from .parameter_writer import ParameterWriter
from .results import Shown, document
from .scan_lines import ScanLine
from .scan_writer import ScanWriter
from .score_text import markdown
from .sink import Sink

_CHUNK_ROWS = 32_768
"""Rows written at once, whenever they come; fewer are written by `flush`."""

_Array = NDArray[np.float64]
Level = Literal["INFO", "WARN", "ERROR"]


class RecordingWriter:
    """One recording. It grows in the file `partial`, and gets its name in `close`.

    While the file cannot be written, rows are dropped; an event then describes the missing rows.

    Parameters
    ----------
    path : path
        First name of the recording. No file is replaced: if it is taken, the recording gets the next one that is free,
        run-2.rrd, run-3.rrd, ...
    patient : bool
        If the file cannot be made now, try again while rows come, in place of raising.
    number : int
        First number to be tried.
    every : int
        Keep one row of the signals in so many.
    title : str
        What the viewer calls the run; empty: by the name of the file.

    Raises
    ------
    OSError
        If the file cannot be written, or another recorder writes it.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        patient: bool = False,
        number: int = 1,
        every: int = 1,
        title: str = "",
    ) -> None:
        self._sink = Sink(Path(path).absolute(), number, patient)
        self.path = self._sink.file.name
        """Name that it will have, or has; `close` takes another one if this one is taken meanwhile."""
        self.number = self._sink.file.number
        """That of the name."""
        self._columns: dict[str, list[tuple[NDArray[np.int64], _Array]]] = {}  # rows that wait to be sent
        self._scales: dict[str, float] = {}
        self._parameters = ParameterWriter(self._sink)
        self.unwritten = self._sink.gaps.unwritten
        """Missing rows of each signal, received while the file could not be written."""
        self.scored = False
        """Whether it holds a score."""
        self._end_ns = 0
        self._closed = False
        self._every = every
        for signal in (*layout.CHANNELS, *layout.TICKS):
            self._declare(signal)
        self._title = title or self.path.stem
        self._describe()
        self._scans = ScanWriter(self._sink, self._arrange)
        self._results: set[str] = set()  # entities of what verbs have brought back
        self._arrange()
        if every > 1:
            self.event(0, f"one tick and one sample of each channel in {every} are recorded")

    @property
    def partial(self) -> Path:
        """Where the recording grows."""
        return self._sink.file.path

    @property
    def set_aside(self) -> Path | None:
        """New name of a partial recording that a killed recorder had left; None if there was none."""
        return self._sink.file.set_aside

    @property
    def problem(self) -> str:
        """Why the file cannot be written at present; empty if it can."""
        return self._sink.file.problem

    def take_news(self) -> str:
        """Last event of the file, once; empty if there was none."""
        news, self._sink.file.news = self._sink.file.news, ""
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
            self._sink.static(signal.entity, about)
        kept = self._kept(first)
        self._append(signal, instants(first, len(values), period)[kept], values[kept] * (scale * signal.factor))

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
        kept = self._kept(first)
        times = instants(first, len(np.asarray(deflection)), period)[kept]
        x = np.asarray(position, dtype=np.float64)[kept]
        r = np.asarray(reference, dtype=np.float64)[kept]
        error = x - r
        error[:, 2] = cantilever_height + np.asarray(deflection)[kept] - r[:, 2]
        for signal, values in (
            (layout.POSITION, x),
            (layout.REFERENCE, r),
            (layout.ERROR, error),
            (layout.DRIVE, np.asarray(drive, dtype=np.float64)[kept]),
            (layout.ROUND_TRIP, np.asarray(round_trip, dtype=np.float64)[kept]),
        ):
            self._append(signal, times, values * signal.factor)

    def line(self, line: ScanLine) -> None:
        """One direction of one line of a scan; the image of the scan is drawn as it grows."""
        if self.problem:
            self._sink.gaps.put(pictures.LINES, np.array([line.time_ns]), self.problem)
        else:
            self._scans.put(line)

    def result(self, shown: Shown) -> None:
        """What a verb has brought back: its table, and its diagrams; those of another verb stay, as they were."""
        if self.problem:
            return
        time = np.array([shown.time_ns])
        drawn = {layout.RESULT: document(shown.words)}
        drawn |= {f"{entity}/{name}": part for entity, parts in shown.drawings.items() for name, part in parts.items()}
        for entity, columns in drawn.items():
            self._sink.columns(entity, time, columns)
        if new := drawn.keys() - self._results:
            self._results |= new
            self._arrange()

    def event(self, time_ns: int, text: str, level: Level = "INFO") -> None:
        """A line of text at a simulated time [ns]."""
        self._sink.event(time_ns, shown(text), level)

    def score(self, time_ns: int, values: Mapping[str, object]) -> None:
        """The score of the run, and when it came: simulated time [ns]."""
        self.scored = True
        self._sink.static(layout.SCORE, rr.TextDocument(yaml_text(values, sort=False)))
        self._describe(values)
        self._sink.event(time_ns, "the score of the run is here")

    def parameters(self, node: str, values: Mapping[str, object]) -> None:
        """Parameters of a node as they are when the recording begins, or when the node appears."""
        self._parameters.known(node, values)

    def parameter_change(self, time_ns: int, node: str, name: str, old: object, new: object) -> None:
        """A parameter has changed at a simulated time [ns]; `old` is None for one that has not been there."""
        if self._parameters.changed(time_ns, node, name, old, new):
            self._end_ns = max(self._end_ns, time_ns)

    def flush(self) -> None:
        """Write all rows received so far to the file; a kill does not lose them."""
        self._send_columns()
        self._sink.write()

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
        self._parameters.finish(self._end_ns)
        self._scans.finish()
        self._send_columns()
        name = self._sink.close(keep=any(self._sink.sent[entity] for entity in self._columns))
        self.path = name or self.path
        return name

    def _kept(self, first: int) -> slice:
        """Rows that are kept of a block that begins with number `first`: those of the numbers 0, every, 2 every, ..."""
        return slice(-first % self._every, None, self._every)

    def _describe(self, score: Mapping[str, object] | None = None) -> None:
        """Title and score as they are read in the viewer."""
        text = rr.TextDocument(markdown(self._title, score), media_type=rr.MediaType.MARKDOWN)
        self._sink.static(layout.RUN, text)

    def _arrange(self) -> None:
        """Arrange the present signals and images in the viewer."""
        self._sink.arrange(screens.blueprint({*self._columns, *self._scans.shown, *self._results}))

    def _declare(self, signal: Signal) -> None:
        self._columns[signal.entity] = []
        self._sink.static(signal.entity, rr.SeriesLines(names=signal.names, colors=signal.colors))

    def _append(self, signal: Signal, times: NDArray[np.int64], values: _Array) -> None:
        expected = (len(times), signal.width) if signal.axes else (len(times),)
        if values.shape != expected:
            raise ValueError(f"{signal.entity}: shape {values.shape} is not allowed: it must be {expected}")
        if not len(times):
            return
        if self.problem:
            self._sink.gaps.put(signal.entity, times, self.problem)
            return
        column = self._columns[signal.entity]
        column.append((times, values))
        self._end_ns = max(self._end_ns, int(times[-1]))
        if sum(len(times) for times, _ in column) >= _CHUNK_ROWS:
            self._send_column(signal.entity)
            self._sink.write()

    def _send_columns(self) -> None:
        for entity in self._columns:
            self._send_column(entity)

    def _send_column(self, entity: str) -> None:
        column, self._columns[entity] = self._columns[entity], []
        if column:
            times, values = (np.concatenate(part) for part in zip(*column, strict=True))
            self._sink.series(entity, times, values)
