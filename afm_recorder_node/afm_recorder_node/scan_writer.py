"""Writes the scans of one recording: each line as it comes, the image from time to time. Needs no ROS."""

from collections import Counter
from collections.abc import Callable

import numpy as np
import rerun as rr

from . import layout, pictures
from .growth import Growth
from .scan_lines import ScanLine, send


class ScanWriter:
    """The scans of one recording.

    Parameters
    ----------
    stream : rr.RecordingStream
    sent : Counter
        Rows by entity, counted here too.
    event : callable
        Called with the simulated time [ns] and a line of text for a person.
    arrange : callable
        Called when there are images that the viewer does not show yet.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        sent: Counter[str],
        event: Callable[[int, str], None],
        arrange: Callable[[], None],
    ) -> None:
        self.shown: set[str] = set()
        """Entities of the images that there are."""
        self._stream = stream
        self._sent = sent
        self._event = event
        self._arrange = arrange
        self._growth = Growth()
        self._time_ns = 0

    def put(self, line: ScanLine) -> None:
        """Write a line, and the image if it has grown enough."""
        if not self._growth.goes_on_with(line):
            self.finish()
            self._growth.begin(line)
            scan = line.scan
            self._event(
                line.time_ns,
                f"scan {line.number}: {scan.pixels} x {scan.lines} pixels, "
                f"{scan.size_x * 1e9:.4g} x {scan.height * 1e9:.4g} nm, {', '.join(line.units)}",
            )
        send(self._stream, line)
        self._sent[pictures.LINES] += 1
        self._time_ns = line.time_ns
        if self._growth.put(line):
            self._draw()

    def finish(self) -> None:
        """Draw what has not been drawn yet: the scan was cancelled, or the recording ends."""
        if not self._growth.drawn:
            self._draw()

    def _draw(self) -> None:
        drawings = self._growth.draw()
        index = [rr.TimeColumn(layout.TIMELINE, duration=np.array([self._time_ns], "timedelta64[ns]"))]
        for drawing in drawings:
            self._stream.send_columns(drawing.entity, index, drawing.columns(), strict=True)
            self._sent[drawing.entity] += 1
        new = {drawing.entity for drawing in drawings} - self.shown
        if new:
            self.shown |= new
            self._arrange()
