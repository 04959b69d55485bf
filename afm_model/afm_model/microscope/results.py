"""What verbs bring back: arrays in SI units, with what is needed to understand them later."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..analysis import Estimate
from .verbs import FrictionLoop, Scan, ScanPath

_Array = NDArray[np.float64]
TRACE, RETRACE = "trace", "retrace"
DIRECTIONS = (TRACE, RETRACE)


@dataclass(frozen=True)
class Line:
    """One direction of one line of a scan, as soon as it is measured."""

    index: int  # from 0, in the order of measurement
    direction: str  # TRACE or RETRACE
    time: float  # when its first pixel began [s]
    channels: Mapping[str, _Array]
    """By name, (pixels,), SI units; pixel 0 is the leftmost, also in a retrace."""


@dataclass
class Image:
    """A scan, whole or as far as it came.

    Rows are ordered by place: row 0 is at the least y of the frame, whichever way the slow axis went. Pixel (i, j) is
    at `centre + R(angle) (x[j], y[i])`; with the slow axis off every line is at y = 0, and `y` only spreads them out.
    Lines that were not measured are NaN.
    """

    scan: Scan
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

    @classmethod
    def empty(cls, scan: Scan, units: Mapping[str, str]) -> "Image":
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
        if line.direction == RETRACE:
            self.lines_done = max(self.lines_done, line.index + 1)

    def friction(self) -> _Array:
        """Half the difference of trace and retrace of the lateral force (lines, pixels) [N]."""
        return 0.5 * (self.data["lateral", TRACE] - self.data["lateral", RETRACE])

    def crosstalk(self) -> _Array:
        """Half the sum of trace and retrace of the lateral force (lines, pixels) [N]."""
        return 0.5 * (self.data["lateral", TRACE] + self.data["lateral", RETRACE])


@dataclass(frozen=True)
class Standing:
    """Where the microscope stands, at the end of Approach, Withdraw and MoveTo."""

    time: float  # simulated [s]
    x: float  # place asked for [m]
    y: float
    z: float  # as driven, positive towards the sample [m]
    deflection: float  # [V]


@dataclass(frozen=True)
class Record:
    """Signals over time."""

    time: _Array  # of each sample, in simulated time [s]
    channels: Mapping[str, _Array]
    units: Mapping[str, str]


@dataclass(frozen=True)
class Curve:
    """One force curve: approach, dwell, retract."""

    record: Record
    """Channels `z` (as driven, positive towards the sample) [m], `deflection` [V], `lateral` [V], `phase`."""
    triggered: bool  # the approach ended by its trigger
    x: float  # place [m]
    y: float
    approach_rate: float  # [m/s]
    retract_rate: float
    deflection_sensitivity: float  # that the microscope believes [m/V]
    spring_constant: float  # for vertical forces, that it believes [N/m]
    trigger: float = 0.0  # rise of the deflection at which the approach was to end [V]; 0: none


@dataclass(frozen=True)
class Loop:
    """Lines to and fro."""

    verb: FrictionLoop
    position: _Array  # along the line, as asked for [m]
    lateral: _Array  # [N]
    deflection: _Array  # [m]
    time: _Array  # [s]


@dataclass(frozen=True)
class PathRecord:
    """What was measured along a path."""

    verb: ScanPath
    record: Record
    """Channels `x`, `y` (as asked for) [m], `height` [m], `error` [V], `lateral` [N]."""


@dataclass(frozen=True)
class Calibration:
    """A number that was measured, with its standard uncertainty and its unit."""

    estimate: Estimate
    unit: str
    details: Mapping[str, float] = field(default_factory=dict)
    """What else came out of it, by names that carry their units, as `f0_Hz`."""


COMPLETE, CANCELLED, FAILED = "complete", "cancelled", "failed"


@dataclass(frozen=True)
class Outcome:
    """How a verb has ended."""

    status: str  # COMPLETE, CANCELLED or FAILED
    message: str  # one sentence; of what is complete only where its result needs a remark
    result: Any
    """What was measured, as far as it came. Approach, Withdraw, MoveTo: Standing; ForceCurve: list of Curve; Scan:
    Image; FrictionLoop: Loop; ScanPath: PathRecord; ThermalTune, CalibrateSensitivity, CalibrateLateral:
    Calibration, or None.
    """


@dataclass(frozen=True)
class Progress:
    """How far a verb is."""

    fraction: float  # 0 to 1, of the time that it takes at most
    detail: str  # a clause
