"""The verb Scan. What it brings back is an `afm_model.microscope.image.Image`."""

from collections.abc import Callable, Iterator, Sequence
from difflib import get_close_matches
from typing import Any, ClassVar

import numpy as np

from ...core.prefix import text
from ...onboard.bimodal import second_frequency
from ...onboard.by_amplitude import setpoint, taps
from ...onboard.dynamic import frequency
from ...program.orders import Order
from ..collect import LineCollector, signals
from ..execution import Execution, Task
from ..image import Image, Line
from ..plan import LinePlan, lines
from ..raster import PRESSED, Raster
from ..results import MicroscopeState
from ..verb import Verb, outside, too_much
from ..view import CALIBRATIONS, InstrumentView, sensitivities, z_loop

TAPPED = ("height", "amplitude_error", "phase")
"""Channels of a scan of a tip that taps and that names none."""
OVERSCAN = 0.1
"""Of lines that are no image."""
_AT_THE_END = 1e-12
"""Mean over a pixel this close to the end of the range of z [m]: z was there all the time."""
_FREE = 0.9
"""From this part of the free amplitude less setpoint on, a tip that taps is off the sample (mean over a pixel)."""
_MANY = 0.01
"""Fraction of all pixels with the tip off the sample, from which on a warning is given."""


class Scan(Raster, Verb):
    """An image, line by line, trace and retrace."""

    returns: ClassVar = Image
    on_sample: ClassVar = True
    slides: ClassVar = True

    def spelled(self, view: InstrumentView) -> "Scan":
        """The same with all channels by their names."""
        return self.of_channels(TAPPED if view.taps else PRESSED)

    def of_channels(self, names: Sequence[str]) -> "Scan":
        """The same with those channels that are measured, where it names none."""
        return self if self.channels else self.model_copy(update={"channels": ", ".join(names)})

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        names = self.spelled(view).channel_names
        if not names:
            yield "channels is empty: it must name one at least, such as height"
        yield from unknown(view, self.channels, names)
        yield from too_much(
            2.0 * self.pixels * self.lines * len(names),
            f"a scan of pixels = {self.pixels}, lines = {self.lines} and {len(names)} channels",
        )
        yield from frame(lines(self, view), view)

    def empty(self, view: InstrumentView) -> Image:
        """The image before its first line."""
        scan = self.spelled(view)
        units = {name: signal.unit for name, signal in signals(view.instrument, scan.channel_names).items()}
        return Image.empty(scan, units)

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        view, plan, image = run.view, lines(self, run.view), self.empty(run.view)
        image.metadata, image.line_rate = notes(view.parameters), plan.line_rate
        put = self.putter(run, image)
        run.result = lambda: image
        duration = plan.motion.samples * view.sample_period
        run.total = view.move(*plan.begin, self.speed).ticks * view.control_period + duration
        yield from run.going(*plan.begin, self.speed)
        image.start = (view.next_sample + plan.motion.turn) * view.sample_period
        collector = LineCollector(view.instrument, image.scan.channel_names, plan, put)
        yield Task(Order(plan.motion), duration, lambda: f"line {collector.line + 1} of {self.lines}", collector)

    def putter(self, run: Execution, image: Image) -> Callable[[Line], None]:
        """What is done with each line: it goes into the image and to who listens, and its remarks to those of the run,
        and to the notes, so that files keep them.
        """
        remarks = Remarks(run.view, self)

        def put(line: Line) -> None:
            image.put(line)
            if told := remarks.of(line):
                run.remark = image.metadata["Remark"] = told
            run.on_line(line)

        return put


def unknown(view: InstrumentView, channels: str, names: Sequence[str]) -> Iterator[str]:
    """What of the names in `channels` there is not."""
    try:
        signals(view.instrument, names)
    except KeyError as error:
        missing, known = error.args
        near = dict.fromkeys(each for name in missing for each in get_close_matches(name, known, n=1))
        meant = f" (did you mean {', '.join(near)}?)" if near else ""
        yield (
            f"channels = {channels} is not allowed: there is no {', '.join(missing)}{meant}; there are "
            f"{', '.join(known)}"
        )


class Remarks:
    """What is to be known of a scan, by its lines: z at the end of its range, a tip that taps off the sample.

    Parameters
    ----------
    view : InstrumentView
    scan : Scan
    """

    def __init__(self, view: InstrumentView, scan: Scan) -> None:
        self._view, self._scan = view, scan
        self._saturated: set[int] = set()
        self._free = 0

    def of(self, line: Line) -> str:
        """Of all lines up to this one, sentences; empty if there is nothing."""
        low, high = self._view.z_range
        if "height" in line.channels:
            z = -line.channels["height"]
            if z.min() <= low + _AT_THE_END or z.max() >= high - _AT_THE_END:
                self._saturated.add(line.index)
        if self._view.taps and "amplitude_error" in line.channels:
            volts = self._view.free_amplitude - self._view.setpoint
            most = _FREE * volts * self._view.parameters.detector.deflection_sensitivity
            self._free += int(np.count_nonzero(line.channels["amplitude_error"] > most)) if most > 0.0 else 0
        return "; ".join(self._told())

    def _told(self) -> Iterator[str]:
        if self._saturated:
            yield (
                f"z was at the end of its range in {len(self._saturated)} of {self._scan.lines} lines: the height is "
                f"not that of the sample there"
            )
        if (share := self._free / (2.0 * self._scan.lines * self._scan.pixels)) >= _MANY:
            yield (
                f"the tip was off the sample in {100.0 * share:.2g} % of the pixels, trace and retrace (parachuting): "
                f"the height is not that of the sample there; scan slower, take a lower setpoint or a larger "
                f"integral gain"
            )


def to_and_fro(
    view: InstrumentView, centre: tuple[float, float], size: float, count: int, rate: float, angle: float = 0.0
) -> LinePlan:
    """Lines at one place, trace and retrace, without pixels."""
    place = {"centre_x": centre[0], "centre_y": centre[1], "size_x": size, "angle": angle, "slow_axis": False}
    return lines(Scan(**place, pixels=2, lines=count, line_rate=rate, overscan=OVERSCAN), view)


def frame(plan: LinePlan, view: InstrumentView) -> Iterator[str]:
    """What of the lines of a scan is beyond the travel of the scanner."""
    yield from outside(view, "with its turns the scan goes too far: ", plan.corners)


def notes(parameters: Any) -> dict[str, str]:
    """Names and texts of what a later reader of a scan needs to know of the microscope.

    Parameters
    ----------
    parameters : InstrumentParameters
        As they are when the scan begins.

    Returns
    -------
    dict of str to str
        What the microscope does not have is left out.
    """
    plant, loop = parameters.plant, z_loop(parameters)
    scanner = f", scanner {plant.scanner}" if hasattr(plant, "scanner") else ""
    words = {"Microscope": f"virtual atomic force microscope, plant {plant.kind}{scanner}"}
    numbers = plant.cantilever_numbers
    if numbers is not None:
        k = plant.spring_constant(parameters)
        own = ", ".join(name for name in numbers._fields if getattr(plant, name))
        words["Cantilever"] = (
            f"{plant.lever}{' but for ' if own else ''}{own}, k = {k:.6g} N/m, f0 = {text(numbers.f0, 'Hz')}, "
            f"tip radius {text(numbers.tip_radius, 'm')}"
        )
    words["Cantilever axis"] = "y; the lateral force is that along x of the scanner"
    force, voltage = (loop.setting(parameters, f"setpoint_{name}", 0.0) for name in ("force", "voltage"))
    if taps(parameters):
        words |= _tapping(parameters)
    elif force or voltage:
        words["Setpoint"] = text(force or voltage, "N" if force else "V", 6)
    else:
        words["Setpoint"] = f"deflection of {text(parameters.reference.z_r, 'm', 6)}"
    gains = {"P": ("proportional_gain", "m/V"), "I": ("integral_gain", "m/(V s)")}
    if told := [
        f"{letter} = {loop.setting(parameters, name):.6g} {unit}"
        for letter, (name, unit) in gains.items()
        if name in loop.settings
    ]:
        words["Gains"] = ", ".join(told)
    deflection, lateral = sensitivities(parameters)
    words["Deflection sensitivity"] = f"{deflection:.6g} m/V"
    words["Lateral sensitivity"] = f"{lateral:.6g} N/V"
    if used := [name.replace("_", " ") for name in CALIBRATIONS if getattr(parameters.calibration, name)]:
        words["Calibrated"] = ", ".join(used)
    words["Sample"] = parameters.sample.kind
    return words


def _tapping(parameters: Any) -> dict[str, str]:
    """Notes of a tip that taps: setpoint, drive, lock-in."""
    part, metres = parameters.onboard, parameters.detector.deflection_sensitivity
    share = metres * setpoint(parameters) / part.free_amplitude if part.free_amplitude else 0.0
    of_free = f", {share:.4g} of the free amplitude of {text(part.free_amplitude, 'm')}" if share else ""
    tones = [(frequency(parameters), part.drive_amplitude)]
    if second := getattr(part, "second_drive_amplitude", 0.0):
        tones.append((second_frequency(parameters), second))
    drive = " and ".join(f"{text(f, 'Hz', 6)}, {text(amplitude, 'm')}" for f, amplitude in tones)
    offset = f", phase offset {part.phase_offset:.4g} rad" if part.phase_offset else ""
    return {
        "Setpoint": f"amplitude of {text(metres * setpoint(parameters), 'm', 6)}{of_free}",
        "Drive": f"{drive} ({part.drive})",
        "Lock-in": f"{part.filter_order} low-passes of {text(part.time_constant, 's')}{offset}",
    }
