"""The verb CalibrateLateral."""

from collections.abc import Iterator
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray
from pydantic import Field

from ...analysis import means, wedge_by_flat
from ...analysis.wedge import WedgeCalibration
from ...core.elementary import square, tan
from ...core.errors import VerbError
from ...core.schema import Positive, Unit
from ...program.orders import Order
from ..collect import RecordCollector
from ..execution import Execution, Task
from ..plan import LinePlan
from ..quantities import LineCount, Metre, Rate
from ..results import Calibration, MicroscopeState
from ..verb import Verb, saturating, too_much
from ..view import InstrumentView
from .going import MoveTo
from .scan import frame, to_and_fro

_PLACES = 500
"""Samples in a line over the wedge."""
_SETTLING = 0.05
"""With feedback at a new setpoint [s]."""
_HELD = 0.3
"""Part of the setpoint by which the load may deviate from it, rms."""
_ANGLE = 0.1
"""Part of the rise of the slope by which slope and flat may differ from what they should be."""
_ORDERED = (("slope_from", "slope_to", "m"), ("flat_from", "flat_to", "m"), ("setpoint_from", "setpoint_to", "N"))


class CalibrateLateral(Verb):
    """Lines over a wedge at several setpoints, and from them the sensitivity of the lateral signal [N/V].

    The sample is a grating whose slope rises towards +x, with a flat stretch next to it. The tip is on it, the scanner
    anywhere: places are given.
    """

    returns: ClassVar = Calibration
    on_sample: ClassVar = True
    presses: ClassVar = True

    slope_from: Metre = Field(0.0, description="where the slope begins, along x")
    slope_to: Metre = Field(100e-9, description="where the slope ends")
    flat_from: Metre = Field(-100e-9, description="where the flat stretch begins")
    flat_to: Metre = Field(0.0, description="where the flat stretch ends")
    slope_angle: Annotated[float, Gt(0), Le(1.4), Unit("rad")] = Field(0.4363, description="of the slope, 25 degrees")
    setpoint_from: Annotated[Positive, Unit("N")] = Field(10e-9, description="least setpoint")
    setpoint_to: Annotated[Positive, Unit("N")] = Field(40e-9, description="largest setpoint")
    setpoints: Annotated[int, Ge(2), Le(100)] = Field(4, description="in even steps")
    line_rate: Rate = Field(1.0, description="lines a second; a line is trace and retrace")
    lines: LineCount = Field(2, description="at each setpoint; the first one is not used")

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        if state.feedback != "on":
            yield f"CalibrateLateral is not allowed with feedback = {state.feedback}: it must be on"
        for low, high, unit in _ORDERED:
            if getattr(self, low) >= getattr(self, high):
                yield (
                    f"{low} = {getattr(self, low):g} {unit} is not allowed: it must be < {high} = "
                    f"{getattr(self, high):g} {unit}"
                )
        if self.lines < 2:
            yield f"lines = {self.lines} is not allowed: the first line is not used; it must be >= 2"
        yield from too_much(6.0 * _PLACES * self.lines * self.setpoints, f"lines = {self.lines}")
        kinds = view.parameters.plant.kind, view.parameters.onboard.kind
        if view.spring_constant == 0.0:
            yield f"CalibrateLateral is not allowed with plant.kind = {kinds[0]}, which has no spring constant"
        if not {"setpoint_force", "setpoint_voltage"} <= view.loop.settings.keys():
            yield f"CalibrateLateral is not allowed with onboard.kind = {kinds[1]}, which takes no setpoint as force"
        yield from saturating("a setpoint", view.volts(self.setpoint_to), view)
        yield from frame(self._plan(view), view)

    def _plan(self, view: InstrumentView) -> LinePlan:
        """Lines over flat and slope."""
        places = (self.slope_from, self.slope_to, self.flat_from, self.flat_to)
        middle = 0.5 * (min(places) + max(places)), view.place[1]
        return to_and_fro(view, middle, max(places) - min(places), self.lines, self.line_rate)

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`. Lines that nothing comes out of are a failure: the tip is withdrawn."""
        view, plan = run.view, self._plan(run.view)
        motion, recorders = plan.motion, list[RecordCollector]()
        before = {name: view.setting(name) for name in ("setpoint_force", "setpoint_voltage")}
        duration = motion.samples * view.sample_period
        run.total = self.setpoints * (duration + _SETTLING)
        run.result = lambda: self._found(view, recorders)
        # The first line is not used.
        skip = motion.turn + 2 * (motion.image + motion.turn)
        count = 2 * (self.lines - 1) * (motion.image + motion.turn)
        names, rate = (
            ["asked_x", "lateral_voltage", "deflection_voltage", "height"],
            _PLACES / (motion.image * view.sample_period),
        )
        try:
            for number, force in enumerate(self._forces):
                view.set_loop(setpoint_force=float(force), setpoint_voltage=0.0)
                detail = f"setpoint {number + 1} of {self.setpoints}"
                yield from run.going(*plan.begin, MoveTo().speed)
                yield Task(Order(view.stay(_SETTLING)), _SETTLING, detail)
                recorders.append(run.recorder(names, rate, skip, count))
                yield Task(Order(motion), duration, detail, recorders[-1])
            run.result()
        finally:
            view.set_loop(**before)

    def _found(self, view: InstrumentView, recorders: list[RecordCollector]) -> Calibration | None:
        """The sensitivity of the lateral signal [N/V]; None unless there are all lines."""
        if len(recorders) < self.setpoints or not recorders[-1].over:
            return None
        for recorder, force in zip(recorders, self._forces, strict=True):
            self._check_surface(view, recorder, force)
        try:
            found = self._wedge(np.array([self._row(view, each) for each in recorders]).T)
        except ValueError as error:
            raise VerbError(f"no lateral sensitivity comes out of the lines: {error}") from None
        used = {"spring_constant_N_m": view.spring_constant, "deflection_sensitivity_m_V": view.deflection_sensitivity}
        return Calibration(*found.sensitivity, "N/V", {"friction_slope": found.friction.value} | used)

    @property
    def _forces(self) -> NDArray[np.float64]:
        """Setpoints [N]."""
        return np.linspace(self.setpoint_from, self.setpoint_to, self.setpoints)

    def _check_surface(self, view: InstrumentView, recorder: RecordCollector, force: float) -> None:
        """Raise VerbError if the load was not the setpoint, or flat and slope are not where they are said to be."""
        x, _, volts, height = recorder.record().channels.values()
        load = view.vertical_stiffness * view.vertical_sensitivity * volts
        stretches = {"slope": (self.slope_from, self.slope_to), "flat": (self.flat_from, self.flat_to)}
        for name, (low, high) in stretches.items():
            within = (x >= low) & (x <= high)
            deviation = float(np.sqrt(np.mean(square(load[within] - force))))
            if deviation > _HELD * force:
                raise VerbError(
                    f"no lateral sensitivity: on the {name} the load deviates from the setpoint of {force:.3g} N by "
                    f"{deviation:.3g} N rms: the line is too fast for the z loop, or an edge lies between {name}_from "
                    f"= {low:g} m and {name}_to = {high:g} m; use a lower line_rate or other places"
                )
            away = x[within] - np.mean(x[within])
            rise = float(np.sum(away * height[within]) / np.sum(square(away)))
            slope = tan(self.slope_angle)
            meant = slope if name == "slope" else 0.0
            if abs(rise - meant) > _ANGLE * slope:
                raise VerbError(
                    f"no lateral sensitivity: between {name}_from = {low:g} m and {name}_to = {high:g} m the surface "
                    f"rises by {1e3 * rise:.3g} nm per um, not by {1e3 * meant:.3g}: give the places of the {name} and "
                    f"slope_angle as an image shows them"
                )

    def _row(self, view: InstrumentView, recorder: RecordCollector) -> tuple[float, ...]:
        """Of the lines at one setpoint: load and half-width on the flat, load and signal up and down the slope."""
        x, lateral, volts, _ = recorder.record().channels.values()
        load = view.vertical_stiffness * view.vertical_sensitivity * volts
        trace, retrace = means(x, lateral, self.flat_from, self.flat_to)
        up, down = means(x, lateral, self.slope_from, self.slope_to)
        load_up, load_down = means(x, load, self.slope_from, self.slope_to)
        zero = 0.5 * (trace.value + retrace.value)
        flat_load = means(x, load, self.flat_from, self.flat_to)[0].value
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
                    return wedge_by_flat(flat_load, half, slope[0], slope[1], slope[2], slope[3], self.slope_angle)
                except ValueError as error:
                    refused = error
        raise refused
