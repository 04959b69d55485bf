"""From recorded blocks to means over pixels: by sample number, the same bytes however the blocks are cut."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import kernel
from ..compiled.records import place
from ..core.errors import ParameterError
from ..instrument import Block, Instrument
from ..onboard.by_amplitude import taps
from ..parts.signals import Measurement
from .image import RETRACE, TRACE, Line
from .plan import LinePlan
from .results import TimeSeries
from .view import sensitivities

_Array = NDArray[np.float64]


class Signal(NamedTuple):
    """What is measured: a channel of the virtual ADC, or a number of the measurement of a control tick."""

    unit: str
    row: int  # of Block.samples; -1: of the measurement
    field: str  # of the measurement
    axis: int
    factor: float


class Reading(NamedTuple):
    """A signal at one moment."""

    value: float
    unit: str


def _known(instrument: Instrument) -> dict[str, Signal]:
    parameters = instrument.parameters
    own = {
        channel.name: Signal(channel.unit, row, "", 0, channel.scale(parameters))
        for row, channel in enumerate(instrument.channels)
    }
    found = dict(own)
    # z grows towards the tip, so that the loop lowers a hill: its height is what z has gone down.
    short = {
        "height": ("z_loop", "m", -1.0),
        "z": ("z_loop", "m", 1.0),
        # What is regulated less its setpoint: z goes to the sample with a deflection too low, an amplitude too large.
        "error": ("z_loop_error", "V", 1.0 if taps(parameters) else -1.0),
        "step": ("verb_step", "1", 1.0),
    }
    if taps(parameters):
        short["amplitude_error"] = ("z_loop_error", "m", parameters.detector.deflection_sensitivity)
    for name, (channel, unit, factor) in short.items():
        if channel in own:
            found[name] = own[channel]._replace(unit=unit, factor=factor)
    for name, factor in zip(("deflection", "lateral_force"), sensitivities(parameters), strict=True):
        found[name] = own[name]._replace(factor=factor)
    found["lateral"] = found["lateral_force"]
    found["lateral_voltage"] = own["lateral_force"]._replace(unit="V", factor=1.0)
    found["deflection_voltage"] = own["deflection"]._replace(unit="V", factor=1.0)
    for axis, name in enumerate("xy"):
        found[name] = Signal("m", -1, "position", axis, 1.0)
        found[f"asked_{name}"] = Signal("m", -1, "reference_position", axis, 1.0)
    return found


def signals(instrument: Instrument, names: Sequence[str]) -> dict[str, Signal]:
    """What is measured, by name: height [m], error (deflection less setpoint, or amplitude) [V], lateral [N], x, y (of
    the sensors) [m], z [m], of a tip that taps amplitude_error [m], and every channel that is sampled.

    Raises
    ------
    KeyError
        If a name is not that of a signal; the arguments are a list of such names and a list of those that exist.
    """
    known = _known(instrument)
    if missing := [name for name in names if name not in known]:
        raise KeyError(missing, sorted(known))
    return {name: known[name] for name in names}


def newest(instrument: Instrument, names: Sequence[str]) -> dict[str, Reading]:
    """Read signals as they are now, by name, see `signals`; at any moment, from any thread.

    Raises
    ------
    ParameterError
        If a signal does not exist; the message names those that do.
    """
    try:
        found = signals(instrument, names)
    except KeyError as error:
        missing, known = error.args
        raise ParameterError(f"there is no signal {', '.join(missing)}; there are {', '.join(known)}") from None
    read = {}
    for name, signal in found.items():
        at = place(Measurement, signal.field) + signal.axis if signal.row < 0 else 0
        value = float(instrument.measurement[at]) if signal.row < 0 else instrument.newest(signal.row)
        read[name] = Reading(signal.factor * value, signal.unit)
    return read


def names_of_signals(instrument: Instrument) -> list[str]:
    """Names of all signals, in order of the alphabet."""
    return sorted(_known(instrument))


@kernel
def accumulate(values: Any, begin: int, end: int, per: int, sums: Any, count: int, out: Any) -> int:
    """Add columns of values (channels, samples) to sums, and write means of `per` samples into out (channels, ...).

    Returns how many samples are in the sums at the end; they are the same whatever pieces the samples come in.
    """
    column = 0
    for j in range(begin, end):
        for i in range(values.shape[0]):
            sums[i] += values[i, j]
        count += 1
        if count == per:
            for i in range(values.shape[0]):
                out[i, column] = sums[i] / per
                sums[i] = 0.0
            count = 0
            column += 1
    return count


class Collector:
    """Takes samples from when it is started on, until it is stopped.

    Parameters
    ----------
    instrument : Instrument
    names : sequence of str
        What is collected; see `signals`.
    skip : int
        Samples after the start that are not taken.
    count : int, optional
        Samples that are taken at most.
    """

    def __init__(self, instrument: Instrument, names: Sequence[str], skip: int = 0, count: int | None = None) -> None:
        self.signals = signals(instrument, names)
        self.sample_period = instrument.parameters.detector.sample_period
        self.first = self.taken = 0
        """Number of its first sample, and of the one after its last."""
        self._skip, self._count = skip, count
        self._end: int | None = 0
        self._per_tick = instrument.samples_per_tick
        self._factors = np.array([signal.factor for signal in self.signals.values()])[:, None]

    def start(self, sample: int) -> None:
        """Begin `skip` samples after this one."""
        self.first = self.taken = sample + self._skip
        self._end = None if self._count is None else self.first + self._count

    def stop(self, sample: int) -> None:
        """Take no more from this sample on."""
        self._end = sample if self._end is None else min(self._end, sample)

    @property
    def over(self) -> bool:
        """Whether all samples of `count` are there."""
        return self._count is not None and self.taken - self.first >= self._count

    @property
    def units(self) -> dict[str, str]:
        """Units by name."""
        return {name: signal.unit for name, signal in self.signals.items()}

    def factors(self, *names: str) -> tuple[float, ...]:
        """What of these was measured is multiplied with."""
        return tuple(self.signals[name].factor for name in names)

    def take(self, block: Block) -> None:
        """Take what a block has of it."""
        count = block.samples.shape[1]
        begin = max(self.taken - block.first_sample, 0)
        end = count if self._end is None else min(self._end - block.first_sample, count)
        if end <= begin:
            return
        values = np.empty((len(self.signals), end - begin))
        for number, signal in enumerate(self.signals.values()):
            if signal.row >= 0:
                values[number] = block.samples[signal.row, begin:end]
            else:
                # Sensors are read at control ticks; from one to the next the place goes on as it is asked to.
                tick, late = np.divmod(np.arange(begin, end), self._per_tick)
                at, speed = (block.measurements[name][:, signal.axis] for name in (signal.field, "reference_velocity"))
                values[number] = at[tick] + late * self.sample_period * speed[tick]
        self._add(values, self.taken - self.first)
        self.taken = block.first_sample + end

    def _add(self, values: _Array, at: int) -> None:
        """Samples (channels, n), the first of which has number `at` from the first one of all."""
        raise NotImplementedError


class RecordCollector(Collector):
    """Means of `per` samples, one after the other; what is left at the end is no mean and not kept."""

    def __init__(
        self, instrument: Instrument, names: Sequence[str], per: int, skip: int = 0, count: int | None = None
    ) -> None:
        super().__init__(instrument, names, skip, count)
        self._per = per
        self._sums, self._count_in = np.zeros(len(self.signals)), 0
        self._parts: list[_Array] = []

    def _add(self, values: _Array, at: int) -> None:
        out = np.empty((len(values), (self._count_in + values.shape[1]) // self._per))
        self._count_in = accumulate(values, 0, values.shape[1], self._per, self._sums, self._count_in, out)
        self._parts.append(out * self._factors)

    def record(self) -> TimeSeries:
        """What is there up to now."""
        parts = self._parts or [np.empty((len(self.signals), 0))]
        values = np.concatenate(parts, axis=1)
        middle: _Array = self.first + 0.5 * (self._per - 1) + np.arange(values.shape[1], dtype=np.float64) * self._per
        return TimeSeries(middle * self.sample_period, dict(zip(self.signals, values, strict=True)), self.units)


class LineCollector(Collector):
    """Lines of a scan, each direction handed on as soon as its last pixel is there.

    Parameters
    ----------
    instrument, names
        As of Collector; it is started with the lead-in.
    plan : LinePlan
    put : callable
        Called with every line.
    """

    def __init__(
        self, instrument: Instrument, names: Sequence[str], plan: LinePlan, put: Callable[[Line], None]
    ) -> None:
        super().__init__(instrument, names)
        self._pixels, self._per = plan.pixels, plan.per_pixel
        self._turn, self._lines, self._image = plan.motion.turn, plan.motion.lines, plan.motion.image
        self._put = put
        self._pixel_values = np.empty((len(self.signals), self._pixels))
        self._sums, self._count_in = np.zeros(len(self.signals)), 0

    @property
    def line(self) -> int:
        """Line that is measured now, from 0."""
        return min(max(self.taken - self.first - self._turn, 0) // (2 * (self._image + self._turn)), self._lines - 1)

    def _add(self, values: _Array, at: int) -> None:
        half = self._image + self._turn
        done, count = 0, values.shape[1]
        while done < count:
            number, late = divmod(at + done - self._turn, half)
            if number < 0 or late >= self._image or number >= 2 * self._lines:
                # To the next begin of an image part; behind the last one there is none.
                done += -(at + done - self._turn) if number < 0 else half - late
                continue
            end = min(count, done + self._image - late)
            pixel = late // self._per
            self._count_in = accumulate(
                values, done, end, self._per, self._sums, self._count_in, self._pixel_values[:, pixel:]
            )
            if late + end - done == self._image:
                self._hand_on(number)
            done = end

    def _hand_on(self, number: int) -> None:
        line, back = divmod(number, 2)
        values = self._pixel_values * self._factors
        if back:
            values = values[:, ::-1]
        begin = self.first + self._turn + number * (self._image + self._turn)
        # To a nanosecond, as a stamp has it: over topics it is the same.
        time = round(begin * self.sample_period, 9)
        channels = dict(zip(self.signals, values, strict=True))
        self._put(Line(line, RETRACE if back else TRACE, time, channels))
