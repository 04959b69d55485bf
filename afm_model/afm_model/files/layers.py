"""The layers of a scan, every channel in each direction and combinations of trace and retrace, and its notes."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..core.prefix import text
from ..microscope.image import DIRECTIONS, MADE, TRACE, Image, as_image

if TYPE_CHECKING:
    import xarray

_Array = NDArray[np.float64]
TITLES = {"height": "Height", "error": "Deflection Error", "lateral": "Lateral Force", "x": "X", "y": "Y"}
TITLES |= {"amplitude_error": "Amplitude Error", "amplitude": "Amplitude", "phase": "Phase"}
"""Of channels, as programs show them; that of another channel is its name."""


@dataclass(frozen=True)
class Layer:
    """One picture of a scan."""

    name: str
    """As in the name of a file: `height_trace`, `friction`."""
    title: str
    """As programs show it: `Height`, `Height Retrace`, `Friction`."""
    unit: str
    values: _Array
    """(lines, pixels), row 0 at the least y, NaN where nothing is measured."""

    @property
    def measured(self) -> NDArray[np.bool_]:
        """Where there is a value (lines, pixels)."""
        return np.isfinite(self.values)


def layers(image: "Image | xarray.Dataset") -> list[Layer]:
    """Every layer of a scan, in order of measurement; friction and crosstalk last, if the lateral force is in it."""
    image = as_image(image)
    found = []
    for channel, unit in image.units.items():
        for direction in DIRECTIONS:
            title = TITLES.get(channel, channel) + ("" if direction == TRACE else " Retrace")
            name = f"{channel.replace('/', '_')}_{direction}"
            found.append(Layer(name, title, unit, image.data[channel, direction]))
    if "lateral" in image.units:
        found += [Layer(name, name.capitalize(), image.units["lateral"], getattr(image, name)()) for name in MADE]
    return found


def layer(image: "Image | xarray.Dataset", name: str) -> Layer:
    """The layer of this name.

    Raises
    ------
    ValueError
        If the scan has none of this name; the message lists those that it has.
    """
    every = {each.name: each for each in layers(image)}
    if name not in every:
        raise ValueError(f"the scan has no layer {name!r}: it must be one of {', '.join(every)}")
    return every[name]


def description(image: Image) -> dict[str, str]:
    """Names and texts, as programs list them: the frame, how it was scanned, how far it came, and the scan's own notes.

    Parameters
    ----------
    image : Image

    Returns
    -------
    dict of str to str
        Without line breaks. Numbers in base units are in the files besides; these are to be read by people.
    """
    scan = image.scan
    slow = (
        f"{scan.direction}, from the {'least' if scan.direction == 'up' else 'largest'} y" if scan.slow_axis else "off"
    )
    words = {
        "Scan size": f"{text(scan.size_x, 'm')} x {text(scan.height, 'm')}",
        "Scan centre": f"x = {text(scan.centre_x, 'm')}, y = {text(scan.centre_y, 'm')}",
        "Scan angle": f"{math.degrees(scan.angle):.6g} deg, of the fast direction against x, counterclockwise",
        "Pixels": f"{scan.pixels} x {scan.lines}",
        "Line rate": f"{image.line_rate or scan.line_rate:.6g} Hz, a line is trace and retrace",
        "Overscan": f"{scan.overscan:.6g}",
        "Slow axis": slow,
        "Lines measured": f"{image.lines_done} of {scan.lines}",
        "Start": f"{image.start:.9g} s of simulated time",
    }
    return words | {str(name): " ".join(str(value).split()) for name, value in image.metadata.items()}
