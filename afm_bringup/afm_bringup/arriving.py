"""The lines of a scan as they arrive: what image they make, and which are missing."""

import numpy as np
from afm_msgs.msg import ScanLine

from afm_model.microscope.backend import OnLine
from afm_model.microscope.results import RETRACE, Image, Line
from afm_model.microscope.verbs import Scan


class Arriving:
    """The lines of the scan that is being done.

    Parameters
    ----------
    scan : Scan
    after : float
        Simulated time before it [s]: the microscope keeps lines of scans before for whoever comes late.
    on_line : OnLine or None
        Called with each line.
    """

    def __init__(self, scan: Scan, after: float, on_line: OnLine | None) -> None:
        self.scan = scan
        self.image: Image | None = None
        self.received = 0
        self._after, self._on_line = after, on_line
        self._number = 0
        self._there: set[int] = set()

    def put(self, message: ScanLine) -> None:
        """Take a line, if it belongs to this scan."""
        if message.time < self._after or message.scan < self._number:
            return
        if message.scan > self._number:
            self._number, self.received = message.scan, 0
            self._there = set()
            self.image = Image.empty(self.scan, dict(zip(message.channels, message.units, strict=True)))
        assert self.image is not None
        values = np.array(message.data, np.float64).reshape(len(message.channels), message.pixels)
        line = Line(message.index, message.direction, message.time, dict(zip(message.channels, values, strict=True)))
        self.image.put(line)
        self._there.add(2 * line.index + (line.direction == RETRACE))
        self.received += 1
        if self._on_line is not None:
            self._on_line(line)

    def missing(self, lines_done: int) -> int:
        """How many lines of so many, trace and retrace counted each, have not come."""
        return len(set(range(2 * lines_done)) - self._there)
