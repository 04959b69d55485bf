"""A scan: its lines, and the image that they make. Simulator, recorder and client all put lines into an `Image`."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..core import registry
from ..core.elementary import sincos
from ..core.schema import build, python_value
from .arrays import Arrays, Variable, attributes, variable
from .raster import Raster

if TYPE_CHECKING:
    import xarray


_Array = NDArray[np.float64]
TRACE, RETRACE = "trace", "retrace"
DIRECTIONS = (TRACE, RETRACE)
_MEASURED = "measured_"
MADE = ("friction", "crosstalk")
"""Layers that are made of the others."""
_NUMBERS = ("start", "line_rate_reached", "lines_done", "complete", "verb")


@dataclass(frozen=True)
class Line:
    """One direction of one line of a scan, as soon as it is measured."""

    index: int  # from 0, in the order of measurement
    direction: str  # TRACE or RETRACE
    time: float  # when its first pixel began [s]
    channels: Mapping[str, _Array]
    """By name, (pixels,), SI units; pixel 0 is the leftmost, also in a retrace."""

    @property
    def number(self) -> int:
        """Among all lines of the scan, trace and retrace, from 0."""
        return 2 * self.index + (self.direction == RETRACE)

    def arrays(self) -> Arrays:
        """Its channels over its pixels from left to right."""
        values = {name: Variable(("pixel",), each, {"long_name": name}) for name, each in self.channels.items()}
        return Arrays(values, {}, {"index": self.index, "direction": self.direction, "start": self.time})


@dataclass
class Image:
    """A scan, whole or as far as it came.

    Rows are ordered by place: row 0 is at the least y of the frame, whichever way the slow axis went. Pixel (i, j) is
    at `centre + R(angle) (x[j], y[i])`; with the slow axis off every line is at y = 0, and `y` only spreads them out.
    Lines that were not measured are NaN.
    """

    scan: Raster
    units: dict[str, str]
    """SI unit of each channel, in the order of measurement."""
    data: dict[tuple[str, str], _Array]
    """By (channel, direction): (lines, pixels)."""
    start: float = 0.0  # simulated time at which the first line began [s]
    line_rate: float = 0.0  # reached; that asked for, rounded to whole samples a pixel [Hz]
    lines_done: int = 0
    complete: bool = False
    metadata: dict[str, str] = field(default_factory=dict)
    """What else is to be kept with it: microscope, setpoint, gains, law, in words with units."""
    times: dict[int, float] = field(default_factory=dict)
    """When each line that was put in began [s], by `Line.number`."""

    @classmethod
    def empty(cls, scan: Raster, units: Mapping[str, str]) -> "Image":
        """An image of which nothing is measured yet."""
        shape = (scan.lines, scan.pixels)
        data = {(name, way): np.full(shape, np.nan) for name in units for way in DIRECTIONS}
        return cls(scan, dict(units), data)

    @property
    def x(self) -> _Array:
        """Places of the pixels along the fast direction, from the centre [m], (pixels,)."""
        scan = self.scan
        return (np.arange(scan.pixels) + 0.5) / scan.pixels * scan.size_x - 0.5 * scan.size_x

    @property
    def y(self) -> _Array:
        """Places of the rows along the slow direction, from the centre [m], (lines,)."""
        scan = self.scan
        return (np.arange(scan.lines) + 0.5) / scan.lines * scan.height - 0.5 * scan.height

    def row(self, index: int) -> int:
        """Row of the line measured as number `index`."""
        return index if self.scan.direction == "up" else self.scan.lines - 1 - index

    def put(self, line: Line) -> None:
        """Take over one direction of a line."""
        for name, values in line.channels.items():
            self.data[name, line.direction][self.row(line.index)] = values
        self.times[line.number] = line.time
        if line.direction == RETRACE:
            self.lines_done = max(self.lines_done, line.index + 1)
        self.complete = len(self.times) == len(DIRECTIONS) * self.scan.lines

    @property
    def notes(self) -> dict[str, Any]:
        """Line rate and start as attributes of its arrays, and how far it came."""
        found = {"start": self.start, "line_rate_reached": self.line_rate, "lines_done": self.lines_done}
        return found | {"complete": self.complete}

    def take_notes(self, attributes: Mapping[str, Any]) -> None:
        """The inverse: from attributes of its arrays."""
        own = (*type(self.scan).model_fields, *_NUMBERS)
        self.start, self.line_rate = attributes["start"], attributes["line_rate_reached"]
        self.lines_done, self.complete = attributes["lines_done"], bool(attributes["complete"])
        self.metadata = {name: str(value) for name, value in attributes.items() if name not in own}

    def missing(self, lines_done: int) -> int:
        """How many lines of so many, trace and retrace counted each, were not put in."""
        return len(set(range(2 * lines_done)) - set(self.times))

    def date(self) -> None:
        """Take line rate and start from the times of its lines, where nothing else is known of them."""
        starts = {number // 2: time for number, time in self.times.items() if number % 2 == 0}
        if starts:
            first, last = min(starts), max(starts)
            # Lines are equally long: from one and another the rate, and the start of one that was not recorded.
            duration = (starts[last] - starts[first]) / (last - first) if last > first else 0.0
            self.line_rate = 1.0 / duration if duration > 0.0 else self.scan.line_rate
            self.start = starts[first] - first * duration

    def friction(self) -> _Array:
        """Half the difference of trace and retrace of the lateral force (lines, pixels) [N]."""
        return 0.5 * (self.data["lateral", TRACE] - self.data["lateral", RETRACE])

    def crosstalk(self) -> _Array:
        """Half the sum of trace and retrace of the lateral force (lines, pixels) [N]."""
        return 0.5 * (self.data["lateral", TRACE] + self.data["lateral", RETRACE])

    def arrays(self) -> Arrays:
        """Its channels over (direction, y, x); friction and crosstalk over (y, x).

        x and y are places in the frame, from its centre; the coordinates `place_x` and `place_y` are those on the
        sample. A channel x or y, which is no coordinate, is called `measured_x`, `measured_y`.
        """
        scan, x, y = self.scan, self.x, self.y
        sine, cosine = sincos(scan.angle)
        # With the slow axis off every line is at the middle of the frame.
        slow = y if scan.slow_axis else np.zeros_like(y)
        places = {
            "place_x": scan.centre_x + cosine * x[None, :] - sine * slow[:, None],
            "place_y": scan.centre_y + sine * x[None, :] + cosine * slow[:, None],
        }
        variables = {}
        for name in sorted(self.units, key=lambda name: name in ("x", "y")):
            values = np.stack([self.data[name, way] for way in DIRECTIONS])
            made = variable(("direction", "y", "x"), values, name, self.units[name])
            if name in ("x", "y"):
                name = f"{_MEASURED}{name}"
                made = made._replace(attributes={**made.attributes, "long_name": f"{name[-1]} as measured"})
            variables[name] = made
        if "lateral" in self.units:
            for name in MADE:
                variables[name] = variable(("y", "x"), getattr(self, name)(), name, self.units["lateral"])
        along = "along the {} direction, from the centre of the frame"
        coordinates = {
            "direction": Variable(("direction",), np.array(DIRECTIONS), {}),
            "x": Variable(("x",), x, {"units": "m", "long_name": along.format("fast")}),
            "y": Variable(("y",), y, {"units": "m", "long_name": along.format("slow")}),
            **{
                name: Variable(("y", "x"), each, {"units": "m", "long_name": f"{name[-1]} on the sample, as asked for"})
                for name, each in places.items()
            },
        }
        return Arrays(variables, coordinates, attributes(scan, self.notes | self.metadata))


def _kind(title: str) -> type[Raster] | None:
    """Return the verb of this class name if its result is an image."""
    name = next((each for each in registry.names("verb") if each.replace("_", "") == title.lower()), None)
    verb: Any = None if name is None else registry.find("verb", name)
    return verb if verb is not None and issubclass(verb, Raster) else None


def as_image(scan: "Image | xarray.Dataset") -> Image:
    """A scan as `Image`, from that or from its labelled arrays.

    Raises
    ------
    ValueError
        If it is something else.
    """
    if isinstance(scan, Image):
        return scan
    given: Mapping[str, Any] = getattr(scan, "attrs", {})
    kind = _kind(str(given.get("verb")))
    if kind is None:
        raise ValueError(f"{type(scan).__name__} is not a scan: it must be an Image or the labelled arrays of one")
    notes = {str(name): python_value(value) for name, value in given.items()}
    variables = {str(name): values for name, values in scan.data_vars.items() if name not in MADE}
    units = {name.removeprefix(_MEASURED): values.attrs["units"] for name, values in variables.items()}
    data = {
        (name.removeprefix(_MEASURED), way): np.asarray(values.sel(direction=way), dtype=np.float64)
        for name, values in variables.items()
        for way in DIRECTIONS
    }
    image = Image(build(kind, {name: notes[name] for name in kind.model_fields}), units, data)
    image.take_notes(notes)
    return image
