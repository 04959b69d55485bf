"""The file of one recording while it grows: rerun encodes what is sent, `Partial` writes it. Needs no ROS."""

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from . import layout, pictures, streams
from .checksums import seal
from .complete import NoRoom, complete, verify
from .frames import END, HEADER, split
from .partial import Partial

_COPIED_UP_TO = 2_000_000_000
"""Larger files are finished in place [bytes]: a copy takes half a second for each minute of a run at 1 kHz."""
_TICKS = {signal.entity for signal in layout.TICKS}


class Gaps:
    """Rows that are missing because the file could not be written: counts them and describes each gap."""

    def __init__(self) -> None:
        self.unwritten: Counter[str] = Counter()
        """Missing rows of each entity, of all gaps."""
        self._rows: Counter[str] = Counter()  # of the present gap
        self._begin_ns = self._end_ns = 0
        self._why = ""

    @property
    def open(self) -> bool:
        """Whether there is a gap that `take` has not described."""
        return bool(self._rows)

    def put(self, entity: str, times: NDArray[np.int64], why: str) -> None:
        """Count rows at simulated times [ns]; `why`: the reason, of which the first one of a gap counts."""
        begin, end = int(times[0]), int(times[-1])
        if self.open:
            begin, end, why = min(begin, self._begin_ns), max(end, self._end_ns), self._why
        self._begin_ns, self._end_ns, self._why = begin, end, why
        self._rows[entity] += len(times)
        self.unwritten[entity] += len(times)

    def take(self) -> tuple[int, str]:
        """End the gap: its begin [ns] and its description."""
        rows, self._rows = self._rows, Counter()
        lines = rows.pop(pictures.LINES, 0)
        samples = max((count for entity, count in rows.items() if entity not in _TICKS), default=0)
        of_scans = f", and {lines} lines of scans (trace and retrace counted each)," if lines else ""
        return self._begin_ns, (
            f"{rows[layout.POSITION.entity]} ticks and {samples} samples a channel{of_scans} are missing from "
            f"{self._begin_ns / 1e9:g} s to {self._end_ns / 1e9:g} s: {self._why}"
        )


class Sink:
    """Encodes what is sent and writes it into a growing file, which gets its name in `close`.

    Parameters are those of `afm_recorder_node.writer.RecordingWriter`.
    """

    def __init__(self, path: Path, number: int, patient: bool) -> None:
        self.sent: Counter[str] = Counter()
        """Rows by entity."""
        self.gaps = Gaps()
        """Rows that came while the file could not be written."""
        self._stream = rr.RecordingStream(layout.APPLICATION)
        # rerun's own file sink only logs a line when a write fails, and remembers each chunk until the end.
        self._bytes = rr.binary_stream(self._stream)
        self._stream.set_sinks(self._bytes)
        first = self._bytes.read() or b""
        try:
            self.file = Partial(path, first[:HEADER], patient=patient, number=number)
        except BaseException:
            self._end_stream()
            raise
        messages = split(first)
        self._carrier = messages[0]
        self.file.write(b"".join(messages) + seal(self._carrier, [first[:HEADER], *messages]))

    def static(self, entity: str, about: rr.AsComponents) -> None:
        """Log what has no time."""
        self._stream.log(entity, about, static=True)

    def series(self, entity: str, times: NDArray[np.int64], values: NDArray[np.float64]) -> None:
        """Send rows of numbers: times (n,) [ns], values (n,) or (n, width)."""
        streams.send_series(self._stream, entity, times, values)
        self.sent[entity] += len(times)

    def columns(self, entity: str, times: NDArray[np.int64], columns: Iterable[rr.ComponentColumn]) -> None:
        """Send rows of anything: times (n,) [ns]."""
        streams.send_columns(self._stream, entity, times, columns)
        self.sent[entity] += len(times)

    def event(self, time_ns: int, text: str, level: str = "INFO", change: str = "") -> None:
        """Send a line of text; `change` describes a changed parameter in JSON."""
        streams.send_event(self._stream, time_ns, text, level, change)
        self.sent[layout.EVENTS] += 1

    def arrange(self, blueprint: rrb.Blueprint) -> None:
        """Arrange the viewer."""
        streams.send_blueprint(self._stream, blueprint)

    def write(self) -> None:
        """Write what was sent to the file; after a gap, add an event about the missing rows."""
        if self._write(self._bytes.read()) and self.gaps.open:
            self.event(*self.gaps.take(), "ERROR")
            self._write(self._bytes.read())

    def close(self, *, keep: bool) -> Path | None:
        """Finish the recording, read it back and give it its name; if it is not worth to `keep`, remove it.

        Raises
        ------
        OSError
            If it could not be written completely; what could be written stays where it is.
        """
        self.write()
        self._end_stream()
        if not keep:
            self.file.discard()
            return None
        try:
            if self.file.problem:
                raise OSError(self.file.problem)
            try:
                if self.file.path.stat().st_size > _COPIED_UP_TO:
                    raise NoRoom
                name, _ = complete(self.file.path, self.file.names, self.sent)
                self.file.discard()
            except NoRoom:
                name = self._finish_in_place()
        except OSError as error:
            self.file.release()
            raise OSError(f"{self.file.path} is incomplete: {error}") from error
        return name

    def _finish_in_place(self) -> Path:
        """Without room or time for a copy the file keeps its small chunks, and has no index."""
        if not self.file.write(seal(self._carrier, [], END) + END):
            raise OSError(self.file.problem)
        verify(self.file.path, self.sent, index=False)
        return self.file.give_name()

    def _write(self, stream: bytes | None) -> bool:
        messages = split(stream or b"")
        return self.file.write(b"".join([*messages, seal(self._carrier, messages)]) if messages else b"")

    def _end_stream(self) -> None:
        self._stream.disconnect()
        self._bytes.read(flush=False)  # read the index, or rerun logs its absence
        del self._stream, self._bytes
        streams.let_go()
