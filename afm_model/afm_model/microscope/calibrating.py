"""What a user calibrates: sensitivity of the deflection, spring constant, sensitivity of the lateral signal.

Nothing here looks into the simulated instrument: the functions of `afm_model.analysis` are given what was measured.
"""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..analysis import Estimate, deflection_sensitivity, means, spring_constant, wedge_by_flat
from ..analysis.wedge import WedgeCalibration
from ..core.errors import VerbError
from ..program.orders import Order
from .bench import Bench
from .collect import RecordCollector
from .jobs import Desk, Job, Task, going
from .plan import LinePlan, lines
from .results import Calibration
from .spectroscopy import Curving
from .tracing import recorder
from .verbs import CalibrateLateral, CalibrateSensitivity, ForceCurve, MoveTo, Scan, ThermalTune

_OVERSCAN = 0.1
_PLACES = 500
"""Samples in a line over the wedge."""
_SETTLING = 0.05
"""With feedback at a new setpoint [s]."""


class Tuning(Job):
    """ThermalTune."""

    verb: ThermalTune

    def __init__(self, verb: ThermalTune, bench: Bench, desk: Desk) -> None:
        super().__init__(verb, bench, desk)
        self._calibration: Calibration | None = None
        self._collector: RecordCollector | None = None

    def tasks(self) -> Iterator[Task]:
        """See `Job`."""
        self.total = self.verb.duration
        stay = self.bench.stay(self.verb.duration)
        yield Task(Order(stay), self.verb.duration, "listening to the cantilever", self._collect)

    def _collect(self, first: int) -> RecordCollector:
        self._collector = RecordCollector(self.bench.instrument, ["deflection_voltage"], first, 1)
        return self._collector

    def result(self) -> Calibration | None:
        """The spring constant [N/m]; None without a whole record.

        Raises
        ------
        VerbError
            If no resonance is found.
        """
        if self._collector is None:
            return None
        volts = self._collector.record().channels["deflection_voltage"]
        if volts.size * self.bench.sample_period < self.verb.duration * (1.0 - 1e-9):
            return None
        parameters = self.bench.parameters
        sensitivity = parameters.detector.deflection_sensitivity
        rate = 1.0 / self.bench.sample_period
        try:
            tune = spring_constant(volts, rate, sensitivity, self.verb.temperature, band=self.bench.resonance_band)
        except ValueError as error:
            raise VerbError(
                f"no spring constant comes out of the record of {self.verb.duration:g} s: {error}"
            ) from None
        details = {"f0_Hz": tune.f0.value, "Q": tune.Q.value, "rms_m": tune.rms, "floor_m_rtHz": tune.floor}
        return Calibration(tune.k, "N/m", details)


class CalibratingSensitivity(Curving):
    """CalibrateSensitivity: force curves, and what comes out of them."""

    def __init__(self, verb: CalibrateSensitivity, bench: Bench, desk: Desk) -> None:
        super().__init__(curves_of(verb), bench, desk)

    def tasks(self) -> Iterator[Task]:
        """See `Job`. Curves that nothing comes out of are a failure: the tip is withdrawn."""
        yield from super().tasks()
        if self.result() is None:
            raise VerbError(
                f"no sensitivity comes out of the curves: in none of them the deflection rose by trigger_voltage = "
                f"{self.trigger:g} V within ramp = {self.verb.ramp:g} m"
            )

    def result(self) -> Calibration | None:  # type: ignore[override]  # of the same curves another result
        """The sensitivity for vertical motion of the tip [m/V]; None without a whole curve.

        Raises
        ------
        VerbError
            If the curves have no slope to measure.
        """
        curves = [curve for curve in super().result() if curve.triggered]
        if not curves:
            return None
        try:
            records = [curve.record.channels for curve in curves]
            each = [deflection_sensitivity(read["z"], read["deflection"]) for read in records]
        except ValueError as error:
            raise VerbError(f"no sensitivity comes out of the curves: {error}") from None
        values = np.array([one.value for one in each])
        # What friction does to a curve is the same in all of them, and does not become less by more of them.
        common = float(np.mean([one.uncertainty for one in each]))
        scatter = float(values.std(ddof=1)) / math.sqrt(values.size) if values.size > 1 else 0.0
        return Calibration(Estimate(float(values.mean()), math.hypot(common, scatter)), "m/V", {"curves": values.size})


def curves_of(verb: CalibrateSensitivity) -> ForceCurve:
    """The force curves of a calibration."""
    return ForceCurve(
        lift=verb.lift,
        ramp=verb.ramp,
        approach_rate=verb.rate,
        retract_rate=verb.rate,
        trigger_voltage=verb.trigger_voltage,
        count=verb.count,
    )


def wedge_plan(verb: CalibrateLateral, bench: Bench) -> LinePlan:
    """Lines over flat and slope."""
    places = (verb.slope_from, verb.slope_to, verb.flat_from, verb.flat_to)
    scan = Scan(
        centre_x=0.5 * (min(places) + max(places)),
        centre_y=bench.place[1],
        size_x=max(places) - min(places),
        pixels=2,
        lines=verb.lines,
        line_rate=verb.line_rate,
        overscan=_OVERSCAN,
        slow_axis=False,
    )
    return lines(scan, bench)


class CalibratingLateral(Job):
    """CalibrateLateral."""

    verb: CalibrateLateral

    def __init__(self, verb: CalibrateLateral, bench: Bench, desk: Desk) -> None:
        super().__init__(verb, bench, desk)
        self._plan = wedge_plan(verb, bench)
        self._collectors: list[RecordCollector] = []
        self._loop = bench.parameters.onboard

    def tasks(self) -> Iterator[Task]:
        """See `Job`."""
        bench, verb, plan = self.bench, self.verb, self._plan
        duration = plan.motion.samples * bench.sample_period
        self.total = verb.setpoints * (duration + _SETTLING)
        for number, force in enumerate(np.linspace(verb.setpoint_from, verb.setpoint_to, verb.setpoints)):
            self.bench.set_loop(setpoint_force=float(force), setpoint_voltage=0.0)
            detail = f"setpoint {number + 1} of {verb.setpoints}"
            yield from going(self, *plan.begin, MoveTo().speed)
            yield Task(Order(bench.stay(_SETTLING)), _SETTLING, detail)
            yield Task(Order(plan.motion), duration, detail, self._collect)
        # Lines that nothing comes out of are a failure: the tip is withdrawn.
        self.result()

    def _collect(self, first: int) -> RecordCollector:
        motion, verb, bench = self._plan.motion, self.verb, self.bench
        # The first line is not used.
        begin = first + motion.turn + 2 * (motion.image + motion.turn)
        names = ["asked_x", "lateral_voltage", "deflection_voltage"]
        collector = recorder(bench, names, begin, _PLACES / (motion.image * bench.sample_period))
        collector.end = begin + 2 * (verb.lines - 1) * (motion.image + motion.turn)
        self._collectors.append(collector)
        return collector

    def leave(self) -> None:
        """See `Job`: the setpoint of before."""
        self.bench.set_loop(setpoint_force=self._loop.setpoint_force, setpoint_voltage=self._loop.setpoint_voltage)

    def result(self) -> Calibration | None:
        """The sensitivity of the lateral signal [N/V]; None unless there are all lines.

        Raises
        ------
        VerbError
            If none comes out of them.
        """
        if len(self._collectors) < self.verb.setpoints or not self._collectors[-1].over:
            return None
        try:
            found = self._wedge(np.array([self._row(each) for each in self._collectors]).T)
        except ValueError as error:
            raise VerbError(f"no lateral sensitivity comes out of the lines: {error}") from None
        return Calibration(found.sensitivity, "N/V", {"friction_slope": found.friction.value})

    def _row(self, collector: RecordCollector) -> tuple[float, ...]:
        """Of the lines at one setpoint: load and half-width on the flat, load and signal up and down the slope."""
        verb = self.verb
        x, lateral, volts = collector.record().channels.values()
        load = self.bench.vertical_stiffness * self.bench.vertical_sensitivity * volts
        trace, retrace = means(x, lateral, verb.flat_from, verb.flat_to)
        up, down = means(x, lateral, verb.slope_from, verb.slope_to)
        load_up, load_down = means(x, load, verb.slope_from, verb.slope_to)
        zero = 0.5 * (trace.value + retrace.value)
        flat_load = means(x, load, verb.flat_from, verb.flat_to)[0].value
        half = 0.5 * (trace.value - retrace.value)
        return flat_load, half, load_up.value, up.value - zero, load_down.value, down.value - zero

    def _wedge(self, columns: NDArray[np.float64]) -> WedgeCalibration:
        """By those setpoints at which the force across the slope is among those on the flat: as many as there are."""
        flat_load, half, load_up, up, load_down, down = columns
        count = flat_load.size
        refused = ValueError("there are no lines")
        for width in range(count, 0, -1):
            for begin in range(count - width + 1):
                part = slice(begin, begin + width)
                slope = load_up[part], up[part], load_down[part], down[part]
                try:
                    return wedge_by_flat(flat_load, half, slope[0], slope[1], slope[2], slope[3], self.verb.slope_angle)
                except ValueError as error:
                    refused = error
        raise refused
