"""Scans made up for the tests: an L low on the left, which no turn and no mirror leaves as it is."""

import numpy as np

from afm_model.microscope.image import DIRECTIONS, TRACE, Image, Line
from afm_model.microscope.results import TimeSeries
from afm_model.microscope.verbs import ForceCurve, Scan
from afm_model.microscope.verbs.force_curve import Curve
from afm_model.program.force_curve import APPROACH, DWELL, RETRACT

UNITS = {"height": "m", "error": "V", "lateral": "N"}
METADATA = {"Microscope": "a microscope of the tests", "Setpoint": "10 nN", "Law": "pid", "Probe": "P"}
STEP = 5e-9
"""Height of the L over the ground [m]."""


def shape(lines: int, pixels: int) -> np.ndarray:
    """1 on the L, 0 beside it, (lines, pixels), row 0 at the least y: a long bar upwards, a short one to the right."""
    found = np.zeros((lines, pixels))
    thick, left = max(1, lines // 8), pixels // 8
    found[lines // 8 : 7 * lines // 8, left : left + thick] = 1.0
    found[lines // 8 : lines // 8 + thick, left : left + pixels // 2] = 1.0
    return found


def line(scan: Scan, index: int, direction: str) -> Line:
    """One direction of a line over the L, with friction on it twice that beside it, tilt and a little noise."""
    row = Image(scan, UNITS, {}).row(index)
    on = shape(scan.lines, scan.pixels)[row]
    x, y = np.linspace(-0.5, 0.5, scan.pixels), row / scan.lines - 0.5
    noise = np.random.default_rng([index, DIRECTIONS.index(direction)]).standard_normal((3, scan.pixels))
    sign = 1.0 if direction == TRACE else -1.0
    channels = {
        "height": 1e-7 + STEP * on + 8e-9 * x + 3e-9 * y + 5e-11 * noise[0],
        "error": 2e-3 * noise[1],
        "lateral": 3e-10 + sign * (2e-9 + 2e-9 * on) + 5e-11 * noise[2],
    }
    return Line(index, direction, 0.5 + index + (0.0 if direction == TRACE else 0.5), channels)


def scanned(lines_done: int | None = None, **changes: object) -> Image:
    """A scan of so many lines; of all, if it is not given."""
    scan = Scan(**{"size_x": 200e-9, "pixels": 64, "lines": 64, "centre_x": 1e-7, "centre_y": -3e-7} | changes)
    image = Image.empty(scan, UNITS)
    image.start, image.line_rate, image.metadata = 0.5, 0.998, dict(METADATA)
    done = scan.lines if lines_done is None else lines_done
    for index in range(done):
        for direction in DIRECTIONS:
            image.put(line(scan, index, direction))
    image.complete = done == scan.lines
    return image


def curve(x: float = 0.0, y: float = 0.0, dwell: int = 100) -> Curve:
    """A force curve over 100 nm with a contact at 60 nm, 50 kHz."""
    there = np.linspace(0.0, 1e-7, 2001)
    z = np.concatenate([there, np.full(dwell, 1e-7), there[::-1]])
    deflection = 0.3 + np.where(z > 6e-8, z - 6e-8, 0.0) / 1e-7
    phase = np.concatenate([np.full(2001, APPROACH), np.full(dwell, DWELL), np.full(2001, RETRACT)]).astype(float)
    time = 12.5 + 2e-5 * np.arange(len(z))
    channels = {"z": z, "deflection_voltage": deflection, "lateral_voltage": 0.01 * z / 1e-7, "phase": phase}
    record = TimeSeries(time, channels, {"z": "m", "deflection_voltage": "V", "lateral_voltage": "V", "phase": "1"})
    verb = ForceCurve(ramp=1e-7, approach_rate=2.5e-6, retract_rate=2.5e-6, trigger_voltage=0.4, count=2)
    return Curve(record, True, x, y, 2.5e-6, 2.5e-6, 1e-7, 0.2, trigger=0.4, verb=verb)
