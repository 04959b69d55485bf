"""An image of a grating, scanned in open loop with a piezo that has hysteresis and creep, beside the ideal one."""

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from afm_model import Instrument, InstrumentParameters, build
from afm_model.parameters import Value

from . import style

_Array = NDArray[np.float64]
SIZE, OFFSET = 40e-6, -20e-6
"""Side of the frame, and where its middle is along x and y [m]: the scan begins at the middle of the range."""
LINE_RATE = 2.0
"""Lines, trace and retrace, a second."""
APPROACH = 0.05
"""Time in which the scanner goes to the first corner [s]."""
PERIOD = 1e-4
"""Control period [s]."""
PITCH = 8e-6
"""Of the grating, twice the distance between two edges [m]."""
STROKE, OPENING, CREEP = 90e-6, 0.12, 0.02
MICROSCOPE: dict[str, Value] = {
    "plant.kind": "lever",
    "plant.modes": 1,
    "plant.dt": 4e-6,
    "plant.control_period": PERIOD,
    "detector.sample_period": PERIOD,
    "piezo.sensitivity_x": 450e-9,
    "piezo.sensitivity_y": 450e-9,
    "sample.kind": "grating",
    "sample.pitch": PITCH,
    "sample.top": 0.5 * PITCH,
    "sample.step": 20e-9,
    # The cantilever is pressed on and z stays as it is: the deflection follows the height without the lag of a z loop,
    # times 1 / cos(tilt), since the tip slides.
    "reference.z_r": 80e-9,
}
CERAMIC: dict[str, Value] = {
    "piezo.kind": "ceramic",
    "piezo.hysteresis_x": OPENING,
    "piezo.hysteresis_y": OPENING,
    "piezo.stroke_x": STROKE,
    "piezo.stroke_y": STROKE,
    "piezo.creep": CREEP,
}


@dataclass(frozen=True)
class Scan:
    """One frame; trace and retrace are lines by pixels, the first line that of the least y."""

    asked: _Array  # x asked for, over time [m]
    time: _Array  # [s]
    deflection: _Array  # over time [m]
    lines: int

    def image(self, *, retrace: bool = False) -> _Array:
        """Deflection of trace or retrace against the position asked for, left to right [m]."""
        start, half = round(APPROACH / PERIOD), round(0.5 / LINE_RATE / PERIOD)
        halves = self.deflection[start : start + 2 * half * self.lines].reshape(self.lines, 2, half)
        return halves[:, 1, ::-1] if retrace else halves[:, 0]

    def edges(self, line: int, *, retrace: bool = False) -> _Array:
        """Positions asked for where a line passes half the height of the grating, left to right [m]."""
        start, half = round(APPROACH / PERIOD), round(0.5 / LINE_RATE / PERIOD)
        begin = start + half * (2 * line + retrace)
        x, z = self.asked[begin : begin + half], self.deflection[begin : begin + half]
        z = z - 0.5 * (z.min() + z.max())
        k = np.flatnonzero(z[1:] * z[:-1] < 0.0)
        places = x[k] - z[k] * (x[k + 1] - x[k]) / (z[k + 1] - z[k])
        return np.sort(places)


def asked(lines: int) -> tuple[_Array, _Array]:
    """x and y asked for at the control ticks [m]: to the corner, then line by line."""
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.arange(0.0, 1.0, PERIOD / APPROACH))
    corner = OFFSET - 0.5 * SIZE
    half = round(0.5 / LINE_RATE / PERIOD)
    there = SIZE * np.arange(half) / half
    x = np.concatenate([corner * ramp, np.tile(np.concatenate([corner + there, corner + SIZE - there]), lines)])
    y = np.concatenate([corner * ramp, corner + SIZE * np.linspace(0.0, 1.0, 2 * half * lines)])
    return x, y


def scan(values: dict[str, Value], lines: int) -> Scan:
    """Scan a frame of so many lines with `values` besides MICROSCOPE."""
    parameters = build(InstrumentParameters, MICROSCOPE | values)
    x, y = asked(lines)
    scope = Instrument(parameters, len(x), hashed=False)
    drive = np.tile(scope.drive, (len(x), 1))
    drive[:, 0] += x / parameters.piezo.sensitivity_x
    drive[:, 1] += y / parameters.piezo.sensitivity_y
    for volts in drive:
        scope.tick(volts)
    return Scan(x, PERIOD * np.arange(len(x)), scope.take_block().measurements.deflection.copy(), lines)


def shifts(distorted: Scan, line: int) -> _Array:
    """How far edges in the trace of a line are to the right of the same ones in its retrace, in parts of the scan.

    A shift is less than an edge's distance to the next; at the ends of the line an edge may be in one of them alone.
    """
    trace, retrace = distorted.edges(line), distorted.edges(line, retrace=True)
    apart = trace[:, None] - retrace[None, :]
    return np.asarray(apart[(apart > -0.1 * PITCH) & (apart < 0.4 * PITCH)] / SIZE)


def draw(lines: int) -> Figure:
    """Ideal image, trace and retrace of the distorted one, a line of both."""
    ideal, real = scan({}, lines), scan(CERAMIC, lines)
    figure, axes = plt.subplots(2, 2, figsize=(style.WIDTH, 5.0), layout="constrained")
    corner = 1e6 * (OFFSET - 0.5 * SIZE)
    extent = (corner, corner + 1e6 * SIZE, corner, corner + 1e6 * SIZE)
    pictures = (
        (axes[0, 0], ideal.image(), "ideal piezo, trace"),
        (axes[0, 1], real.image(), "hysteresis and creep, trace"),
        (axes[1, 0], real.image(retrace=True), "the same, retrace"),
    )
    for ax, picture, title in pictures:
        heights = 1e9 * (picture - picture.min())
        ax.imshow(heights, extent=extent, origin="lower", cmap="cividis", aspect="auto", vmin=0.0, vmax=20.0)
        ax.set(title=title, xlabel="x asked for [µm]", ylabel="y asked for [µm]")
        ax.grid(False)
    ax = axes[1, 1]
    x = np.linspace(corner, corner + 1e6 * SIZE, real.image().shape[1])
    for picture, look, label in (
        (real.image(), style.SECOND, "trace"),
        (real.image(retrace=True), style.THIRD, "retrace"),
    ):
        line = picture[lines // 2]
        ax.plot(x, 1e9 * (line - line.min()), **look, label=label)
    ax.set(title="line in the middle", xlabel="x asked for [µm]", ylabel="deflection [nm]")
    ax.set(xlim=(corner + 10, corner + 30), xticks=np.arange(corner + 10, corner + 31, 5), ylim=(-6, 22))
    ax.legend(loc="lower right", ncols=2)
    return figure
