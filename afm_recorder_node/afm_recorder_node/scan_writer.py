"""Writes the scans of one recording: each line as it comes, the image from time to time. Needs no ROS."""

from collections.abc import Callable

import numpy as np

from .growth import Growth
from .pictures import LINES
from .scan_lines import ScanLine, columns
from .sink import Sink


class ScanWriter:
    """The scans of one recording.

    Parameters
    ----------
    sink : Sink
    arrange : callable
        Called when there are images that the viewer does not show yet.
    """

    def __init__(self, sink: Sink, arrange: Callable[[], None]) -> None:
        self.shown: set[str] = set()
        """Entities of the images that there are."""
        self._sink = sink
        self._arrange = arrange
        self._growth = Growth()
        self._time_ns = 0

    def put(self, line: ScanLine) -> None:
        """Write a line, and the image if it has grown enough."""
        if not self._growth.goes_on_with(line):
            self.finish()
            self._growth.begin(line)
            scan = line.scan
            self._sink.event(
                line.time_ns,
                f"scan {line.number}: {scan.pixels} x {scan.lines} pixels, "
                f"{scan.size_x * 1e9:.4g} x {scan.height * 1e9:.4g} nm, {', '.join(line.units)}",
            )
        self._sink.columns(LINES, np.array([line.time_ns]), columns(line))
        self._time_ns = line.time_ns
        if self._growth.put(line):
            self._draw()

    def finish(self) -> None:
        """Draw what has not been drawn yet: the scan was cancelled, or the recording ends."""
        if not self._growth.drawn:
            self._draw()

    def _draw(self) -> None:
        drawings = self._growth.draw()
        for drawing in drawings:
            self._sink.columns(drawing.entity, np.array([self._time_ns]), drawing.columns())
        new = {drawing.entity for drawing in drawings} - self.shown
        if new:
            self.shown |= new
            self._arrange()
