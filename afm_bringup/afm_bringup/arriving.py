"""The lines of a scan as they arrive: what image they make, and which are missing."""

from afm_msgs.msg import ScanLine

from afm_model.microscope.image import Image, Line
from afm_model.microscope.verbs import Scan
from afm_node_common.decoding import line_of


class Arriving:
    """The lines of the scan that is being done.

    Parameters
    ----------
    scan : Scan
    after : float
        Simulated time before it [s]: the microscope keeps lines of scans before for whoever comes late.
    """

    def __init__(self, scan: Scan, after: float) -> None:
        self.image: Image | None = None
        self._new = list[Line]()
        self._scan, self._after = scan, after
        self._number = 0

    def put(self, message: ScanLine) -> None:
        """Take a line, if it belongs to this scan."""
        line = line_of(message)
        if line.time < self._after or message.scan < self._number:
            return
        if self.image is None or message.scan > self._number:
            self._number = message.scan
            self.image = Image.empty(
                self._scan.of_channels(list(message.channels)), dict(zip(message.channels, message.units, strict=True))
            )
        self.image.put(line)
        self._new.append(line)

    def news(self) -> list[Line]:
        """Lines that have come since this was asked last."""
        news, self._new = self._new, []
        return news

    @property
    def received(self) -> int:
        """How many lines have come, trace and retrace counted each."""
        return len(self.image.times) if self.image is not None else 0

    def missing(self, lines_done: int) -> int:
        """How many lines of so many, trace and retrace counted each, have not come."""
        return self.image.missing(lines_done) if self.image is not None else 2 * lines_done

    def has_news(self, lines_done: int, before: int) -> bool:
        """Return whether more than `before` lines have come, or none of the `lines_done` lines is missing."""
        return not self.missing(lines_done) or self.received > before
