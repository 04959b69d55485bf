"""The same scan of a grating with other control: the z loop slow, right, too fast; x and y by three laws."""

import math
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np
from laboratory import CERAMIC
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from afm_model import Controller, ControllerParameters, Instrument, InstrumentParameters, build
from afm_model.analysis import edges
from afm_model.parameters import Value
from afm_model.plant.presets import LEVERS, SCANNERS

from . import style

_Array = NDArray[np.float64]
SIZE = 20e-6
"""Side of the frame, its middle at x = 0 [m]."""
PIXELS, LINE_RATE, PERIOD, SAMPLE = 250, 1.0, 5e-5, 1e-5
"""Pixels of a line; lines (trace and retrace) a second; control period and period of the ADC [s]."""
PITCH, TOP, STEP, ANGLE = 4e-6, 1.2e-6, 60e-9, 1.0
"""Of the grating: period, width of the ridges, height [m], angle of the slopes."""
CHANNELS = ("z_loop", "z_loop_error", "truth/contact")
FORCE = 10e-9
SENSITIVITY = {"piezo.sensitivity_x": 450e-9, "piezo.sensitivity_y": 450e-9, "piezo.sensitivity_z": 70e-9}
_LEVER, _SCANNER = LEVERS["ppp_lfmr"], SCANNERS["flexure_90um"]
INSTRUMENT: dict[str, Value] = {
    "plant.kind": "lever",
    "plant.lever": "ppp_lfmr",
    "plant.scanner": "flexure_90um",
    "plant.pair": "si_graphite",
    "plant.modes": 1,
    "plant.dt": 2.5e-6,
    "plant.control_period": PERIOD,
    "detector.sample_period": SAMPLE,
    "detector.channels": ", ".join(CHANNELS),
    **SENSITIVITY,
    **CERAMIC,
    "sample.kind": "grating",
    "sample.pitch": PITCH,
    "sample.top": TOP,
    "sample.step": STEP,
    "sample.angle": ANGLE,
    "onboard.kind": "pi",
    "onboard.setpoint_force": FORCE,
    "reference.z_r": FORCE / _LEVER.k,
    "reference.shape_x": "triangle",
    "reference.amplitude_x": 0.5 * SIZE,
    "reference.omega_x": 2.0 * math.pi * LINE_RATE,
    "reference.shape_y": "triangle",
}
TOLD: dict[str, Value] = {
    **{f"scanner.f_{axis}": getattr(_SCANNER, f"f_{axis}") for axis in "xyz"},
    **{f"scanner.xi_{axis}": 0.5 / _SCANNER.Q for axis in "xyz"},
    **SENSITIVITY,
    "cantilever.f_c": _LEVER.f0,
    "cantilever.xi_c": 0.5 / _LEVER.Q,
    "cantilever.m_c": _LEVER.k / (2.0 * math.pi * _LEVER.f0) ** 2,
    "scanner.mass_ratio": _SCANNER.k_x / _LEVER.k * (_LEVER.f0 / _SCANNER.f_x) ** 2,
}
"""What the laws know of the instrument."""
LAWS: dict[str, dict[str, Value]] = {
    "open loop": {"law.kind": "open_loop"},
    "the paper's law": {"law.kind": "tanh"},
    "pid": {"law.kind": "pid", "law.period": PERIOD},
    "observer": {"law.kind": "observer", "law.period": PERIOD},
    "load": {"law.kind": "load", "law.period": PERIOD},
}
MOST = 1e-8 * 2.0 * math.pi * _SCANNER.f_z / _SCANNER.Q
"""Integral gain of the z loop at which the scanner's resonance makes it oscillate [m/(V s)], docs/microscope.md."""
GAINS = {"slow": 0.05 * MOST, "right": 0.5 * MOST, "too fast": 1.1 * MOST}
"""Integral gains; half of the limit is a gain margin of 2."""


@dataclass(frozen=True)
class Picture:
    """Height, trace and retrace: (lines, PIXELS) [m], left to right, the first line that of the least y."""

    trace: _Array
    retrace: _Array
    error: float  # of the deflection, rms over all samples but those of the first line [m]
    free: float  # share of their time in which the tip does not touch


@dataclass(frozen=True)
class Faults:
    """How far an image is from the sample."""

    height: float  # rms error of the height [m]
    width: float  # of the edges, from 10 % to 90 % of the height, median [m]
    largest: float  # displacement of an edge from its place [m]
    apart: float  # rms distance of trace and retrace [m]


def scan(law: str, gain: str, lines: int) -> Picture:
    """Scan so many lines, upwards from y = 0, with a law for x and y and a gain of the z loop."""
    slow = {"reference.amplitude_y": 0.5 * SIZE, "reference.omega_y": 0.5 * math.pi * LINE_RATE / (lines + 2)}
    parameters = build(InstrumentParameters, INSTRUMENT | slow | {"onboard.integral_gain": GAINS[gain]})
    told = TOLD | LAWS[law]
    if law == "open loop":
        # It sends the drive of a scanner at rest if it takes the resonance for the unit of frequency.
        told = SENSITIVITY | LAWS[law] | {f"scanner.f_{axis}": parameters.scales.w0 / (2.0 * math.pi) for axis in "xyz"}
    controller = Controller(build(ControllerParameters, told))
    half = round(0.5 / LINE_RATE / PERIOD)
    scope = Instrument(parameters, 2 * half, hashed=False)
    row, volts, contact = ([each.name for each in scope.channels].index(name) for name in CHANNELS)
    # From the middle to the right and back to the left: there the first line begins.
    scope.close_loop(controller, half // 2)
    scope.skip_block()
    scope.close_loop(controller, half)
    scope.skip_block()
    images, squares, touching = np.empty((lines, 2, PIXELS)), np.empty(lines), np.empty(lines)
    for line in range(lines):
        scope.close_loop(controller, 2 * half)
        samples = scope.take_block().samples
        # The z loop moves the sample away from the tip where it is high.
        images[line] = -samples[row].reshape(2, PIXELS, -1).mean(axis=2)
        squares[line] = np.mean(np.square(samples[volts] * parameters.detector.deflection_sensitivity))
        touching[line] = samples[contact].mean()
    error, free = math.sqrt(squares[1:].mean()), 1.0 - float(touching[1:].mean())
    return Picture(images[:, 0], images[:, 1, ::-1], error, free)


def places() -> _Array:
    """x of the pixels [m]."""
    return (np.arange(PIXELS) + 0.5) / PIXELS * SIZE - 0.5 * SIZE


def true_edges() -> _Array:
    """Places where the path of the tip passes half the height of the grating [m]."""
    head = 0.5 * (PITCH - TOP) - _LEVER.tip_radius * math.tan(0.5 * ANGLE)
    middle = head - 0.5 * STEP / math.tan(ANGLE)
    ridges = PITCH * np.arange(-3, 4)
    found = np.sort(np.concatenate([ridges - middle, ridges + middle]))
    return found[np.abs(found) < 0.5 * SIZE]


def truth() -> _Array:
    """Height of the sample at the pixels [m]; an edge lies within a pixel."""
    fine = (np.arange(50 * PIXELS) + 0.5) / (50 * PIXELS) * SIZE - 0.5 * SIZE
    inside = np.searchsorted(true_edges(), fine) % 2
    # The ridges are where the first edge from the left has been passed, if the frame begins in a valley.
    begins_high = abs((0.5 * SIZE) % PITCH - 0.5 * PITCH) < 0.5 * TOP
    high = (inside == 1) != begins_high
    return np.asarray(STEP * high.reshape(PIXELS, 50).mean(axis=1))


def faults(picture: Picture) -> Faults:
    """Of the trace, but for the first line."""
    x, true, wanted = places(), truth(), true_edges()
    left, far, wide = [], [math.nan], [math.nan]
    for line in picture.trace[1:]:
        error = line - true
        left.append(error - np.median(error))
        try:
            found = edges(x, line)
        except ValueError:
            # The line has no two levels.
            continue
        far.extend(float(np.abs(wanted - edge.place).min()) for edge in found)
        wide.extend(edge.width for edge in found)
    apart = picture.trace[1:] - picture.retrace[1:]
    known = np.isfinite(wide).any()
    return Faults(
        height=float(np.sqrt(np.mean(np.square(left)))),
        width=float(np.nanmedian(wide)) if known else math.nan,
        largest=float(np.nanmax(far)) if known else math.nan,
        apart=float(np.sqrt(np.mean(np.square(apart - np.median(apart))))),
    )


CASES = (
    ("observer", "slow"),
    ("observer", "right"),
    ("observer", "too fast"),
    ("open loop", "right"),
    ("the paper's law", "right"),
)
"""Law of x and y, gain of z: what the figure shows."""


def draw(pictures: dict[tuple[str, str], Picture]) -> Figure:
    """Images of all cases, and lines of them over the sample."""
    figure, axes = plt.subplot_mosaic(
        [["slow", "right", "too fast"], ["open", "paper", "x"], ["z", "z", "z"]],
        figsize=(style.WIDTH, 6.4),
        layout="constrained",
        height_ratios=[1.0, 1.0, 0.8],
    )
    titles = (
        ("slow", "z loop slow; x, y by observer"),
        ("right", "z loop right; x, y by observer"),
        ("too fast", "z loop too fast; x, y by observer"),
        ("open", "x, y in open loop; z loop right"),
        ("paper", "x, y by the paper's law; z right"),
    )
    corner, side = -0.5e6 * SIZE, 0.5e6 * SIZE
    lines = next(iter(pictures.values())).trace.shape[0]
    top = side * lines / (lines + 2)
    for (name, title), case in zip(titles, CASES, strict=True):
        ax: Axes = axes[name]
        shown = 1e9 * (pictures[case].trace - _zero(pictures[case].trace))
        extent = (corner, -corner, 0.0, top)
        drawn = ax.imshow(
            shown, extent=extent, origin="lower", cmap="cividis", aspect="auto", vmin=-10.0, vmax=70.0,
            interpolation="nearest",
        )  # fmt: skip
        ax.set_title(title, fontsize=7.5)
        ax.set(xlabel="x asked for [µm]", xticks=np.arange(-10, 11, 5), yticks=[0, 4, 8])
        if name in ("slow", "open"):
            ax.set_ylabel("y asked for [µm]")
        ax.grid(False)
    figure.colorbar(drawn, ax=[axes["too fast"], axes["x"]], label="height [nm]", ticks=[0, 30, 60], shrink=0.7)
    x, line = 1e6 * places(), lines // 2
    ax = axes["x"]
    ax.plot(x, 1e9 * truth(), **style.REFERENCE, label="sample")
    for case, look, label in (
        (CASES[3], style.THIRD, "open loop"),
        (CASES[4], style.SECOND, "paper's law"),
        (CASES[1], style.MOTION, "observer"),
    ):
        ax.plot(x, 1e9 * (pictures[case].trace[line] - _zero(pictures[case].trace[line])), **look, label=label)
    ax.set(xlim=(-4.0, 4.0), ylim=(-12, 105), xlabel="x asked for [µm]", ylabel="height [nm]", yticks=[0, 30, 60])
    ax.set_title("law of x and y", fontsize=7.5)
    ax.legend(loc="upper center", ncols=2, fontsize=6, handlelength=1.5, columnspacing=0.8)
    ax = axes["z"]
    for case, look, label in (
        (CASES[2], style.DENSE, "too fast"),
        (CASES[0], style.THIRD, "slow"),
        (CASES[1], style.MOTION, "right"),
    ):
        ax.plot(x, 1e9 * (pictures[case].trace[line] - _zero(pictures[case].trace[line])), **look, label=label)
    ax.plot(x, 1e9 * truth(), **style.REFERENCE, label="sample")
    ax.set(xlim=(corner, -corner), ylim=(-25, 100), xlabel="x asked for [µm]", ylabel="height [nm]")
    ax.set_title("gain of the z loop", fontsize=7.5)
    ax.legend(loc="upper right", ncols=4)
    return figure


def _zero(heights: _Array) -> float:
    """Height of the valleys: the middle of the lower half."""
    low = heights[heights < np.median(heights) + 1e-12]
    return float(np.median(low))


def table(pictures: dict[tuple[str, str], Picture]) -> list[str]:
    """Rows of a table of the page."""
    rows = [
        "| z loop | x, y | height, rms error [nm] | width of edges [nm] | largest displacement of an edge [nm] "
        "| trace less retrace, rms [nm] | deflection error, rms of all samples [nm] | tip free of the sample |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for (law, gain), picture in pictures.items():
        told = faults(picture)
        numbers = (told.height, told.width, told.largest, told.apart, picture.error)
        cells = [*map(_nanometres, numbers), f"{100.0 * picture.free:.2g} %"]
        rows.append(f"| {gain} | {law} | {' | '.join(cells)} |")
    return rows


def _nanometres(length: float) -> str:
    return "none found" if math.isnan(length) else f"{1e9 * length:.2g}" if length < 1e-7 else f"{1e9 * length:.0f}"
