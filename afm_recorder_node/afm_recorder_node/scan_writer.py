"""Draws the scans of one run: the image from time to time while it grows. Needs no ROS.

An image is far larger than a line, and drawn a few times in the course of its scan: a view grows by a bounded number
of copies of it.
"""

from collections.abc import Iterator

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from afm_model.microscope.image import DIRECTIONS, RETRACE, TRACE, Image

from .canvas import Canvas
from .layout import RESULT, plotted
from .pictures import picture_of
from .result_views import document, of_image
from .scan_lines import ScanLine
from .scene import Surface

STAGES = 16
"""Times that an image is drawn while it grows."""
LARGEST = 512
"""Pixels along an edge of a drawing at most; of a larger image one in several is drawn."""
_SHOWN = (1.0, 99.0)
"""Percentiles of the values that the colours span: a few pixels that stick out take no contrast from the others."""


class ScanWriter:
    """The scans of one run."""

    def __init__(self, canvas: Canvas) -> None:
        self.surface: Surface | None = None
        """The last image of the height, as it is drawn."""
        self._canvas = canvas
        self._number = 0
        self._image: Image | None = None
        self._stage, self._changed, self._time_ns = 0, False, 0

    def put(self, line: ScanLine) -> None:
        """Take a line, and draw the image if it has grown enough."""
        if self._image is None or line.number != self._number or line.scan != self._image.scan:
            self.finish()
            self._number, self._image, self._stage = line.number, Image.empty(line.scan, line.units), 0
            scan = line.scan
            self._canvas.event(
                line.time_ns,
                f"scan {line.number}: {scan.pixels} x {scan.lines} pixels, "
                f"{scan.size_x * 1e9:.4g} x {scan.height * 1e9:.4g} nm, {', '.join(line.units)}",
                "INFO",
            )
        self._image.put(line.line)
        self._changed, self._time_ns = True, line.time_ns
        stage = (line.line.index + 1) * STAGES // line.scan.lines
        if line.line.direction == RETRACE and stage > self._stage:
            self._draw(self._image)

    def finish(self) -> None:
        """Draw what has not been drawn yet: the scan was cancelled, or the run ends."""
        if self._image is not None and self._changed:
            self._draw(self._image)

    def _draw(self, image: Image) -> None:
        self._stage, self._changed = image.lines_done * STAGES // image.scan.lines, False
        time = np.array([self._time_ns])
        for entity, values, span in drawings(image):
            # The viewer draws NaN in the colour of the highest: what is not measured yet is as dark as the lowest.
            drawn = np.where(np.isfinite(values), values, np.float32(span[0]))
            tensor = rr.encodings.TensorData(array=drawn, dim_names=("row", "column"))
            self._canvas.rows(entity, time, rr.Tensor.columns(data=[tensor], value_range=[span]))
            if entity == picture_of("height", TRACE):
                self.surface = image.scan, drawn
        self._canvas.rows(RESULT, time, document(of_image(self._number, image)))


def drawings(image: Image) -> Iterator[tuple[str, NDArray[np.float32], tuple[float, float]]]:
    """Every channel of an image, and friction and crosstalk if the lateral force is one of them.

    Yields
    ------
    (str, ndarray, (float, float))
        Entity; values (rows, columns) in the unit of the plot, the first row at the largest y, NaN where nothing is
        measured yet; values that have the darkest and the brightest colour.
    """
    for name, unit in image.units.items():
        for direction in DIRECTIONS:
            yield picture_of(name, direction), *_drawn(image.data[name, direction], unit)
    if unit := image.units.get("lateral", ""):
        yield picture_of("friction"), *_drawn(image.friction(), unit)
        yield picture_of("crosstalk"), *_drawn(image.crosstalk(), unit)


def _drawn(values: NDArray[np.float64], unit: str) -> tuple[NDArray[np.float32], tuple[float, float]]:
    _, factor = plotted(unit)
    thinned = -(-max(values.shape) // LARGEST)
    shown = (factor * values[::-1][::thinned, ::thinned]).astype(np.float32)
    measured = shown[np.isfinite(shown)]
    low, high = map(float, np.percentile(measured, _SHOWN) if len(measured) else (0.0, 0.0))
    # The viewer needs a width to spread its colours over.
    return shown, ((low, high) if high > low else (low - 0.5, low + 0.5))
