"""Writes the scans of one recording: each line as it comes, the image from time to time. Needs no ROS.

An image is far larger than a line, and drawn a few times in the course of its scan: a recording grows by a bounded
number of copies of it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from afm_model.microscope.image import DIRECTIONS, RETRACE, Image

from .layout import RESULT, plotted
from .pictures import LINES, picture_of
from .results import document, of_image
from .scan_lines import ScanLine, columns
from .sink import Sink

STAGES = 16
"""Times that an image is drawn while it grows."""
LARGEST = 512
"""Pixels along an edge of a drawing at most; of a larger image one in several is drawn."""
_SHOWN = (1.0, 99.0)
"""Percentiles of the values that the colours span: a few pixels that stick out take no contrast from the others."""


@dataclass(frozen=True)
class Drawing:
    """One channel of an image as the viewer shows it."""

    entity: str
    values: NDArray[np.float32]
    """(rows, columns) in the unit of the plot; the first row is at the top, at the largest y. NaN: not measured yet."""
    span: tuple[float, float]
    """Values that have the darkest and the brightest colour."""

    def columns(self) -> rr.ComponentColumnList:
        """As one row of the recording."""
        # The viewer draws NaN in the colour of the highest: what is not measured yet is as dark as the lowest.
        drawn = np.where(np.isfinite(self.values), self.values, np.float32(self.span[0]))
        tensor = rr.encodings.TensorData(array=drawn, dim_names=("row", "column"))
        return rr.Tensor.columns(data=[tensor], value_range=[self.span])


class Growth:
    """The image of the scan that goes on."""

    def __init__(self) -> None:
        self._number = 0
        self._image: Image | None = None
        self._stage = 0
        self._changed = False

    def goes_on_with(self, line: ScanLine) -> bool:
        """Whether a line belongs to the scan of the lines before it."""
        return self._image is not None and line.number == self._number and self._image.scan == line.scan

    def begin(self, line: ScanLine) -> None:
        """A scan begins, with this line."""
        self._number, self._image = line.number, Image.empty(line.scan, line.units)
        self._stage, self._changed = 0, False

    def put(self, line: ScanLine) -> bool:
        """Take a line of this scan; whether the image is to be drawn now."""
        assert self._image is not None
        self._image.put(line.line)
        self._changed = True
        stage = (line.line.index + 1) * STAGES // line.scan.lines
        return line.line.direction == RETRACE and stage > self._stage

    @property
    def drawn(self) -> bool:
        """Whether all that has come has been drawn."""
        return not self._changed

    def words(self) -> str:
        """What it has come to up to now, as a table."""
        assert self._image is not None
        return of_image(self._number, self._image)

    def draw(self) -> list[Drawing]:
        """All channels as far as they came."""
        assert self._image is not None
        self._stage = self._image.lines_done * STAGES // self._image.scan.lines
        self._changed = False
        return drawings(self._image)


def drawings(image: Image) -> list[Drawing]:
    """Every channel of an image, and friction and crosstalk if the lateral force is one of them."""
    made = [
        _drawing(picture_of(name, direction), image.data[name, direction], unit)
        for name, unit in image.units.items()
        for direction in DIRECTIONS
    ]
    if (unit := image.units.get("lateral")) is not None:
        made.append(_drawing(picture_of("friction"), image.friction(), unit))
        made.append(_drawing(picture_of("crosstalk"), image.crosstalk(), unit))
    return made


def _drawing(entity: str, values: NDArray[np.float64], unit: str) -> Drawing:
    _, factor = plotted(unit)
    thinned = -(-max(values.shape) // LARGEST)
    shown = (factor * values[::-1][::thinned, ::thinned]).astype(np.float32)
    measured = shown[np.isfinite(shown)]
    low, high = np.percentile(measured, _SHOWN) if len(measured) else (0.0, 0.0)
    # The viewer needs a width to spread its colours over.
    return Drawing(entity, shown, (float(low), float(high)) if high > low else (float(low) - 0.5, float(low) + 0.5))


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
        """Entities of the images that there are, and of the table beside them."""
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
        self._sink.columns(RESULT, np.array([self._time_ns]), document(self._growth.words()))
        new = {RESULT, *(drawing.entity for drawing in drawings)} - self.shown
        if new:
            self.shown |= new
            self._arrange()
