"""The verb Lift: each line once more, at a height above what was measured; docs/scan.md."""

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...core.elementary import sincos
from ...program import orders
from ...program.orders import Order, Step
from ..collect import LineCollector, signals
from ..execution import Execution, Task
from ..image import RETRACE, TRACE, Image, Line
from ..plan import LinePlan, lines
from ..quantities import Length, Speed
from ..results import MicroscopeState
from ..verb import too_much
from ..view import InstrumentView
from .scan import Scan, notes

ABOVE = "_lift"
"""Ending of the name of a channel that is measured in the second pass."""
_PRESSED, _TAPPED = "deflection", "amplitude, phase"
_SETTLED = 12.0
"""Lags of the amplitude after which it is settled."""
_BACK = 5e-3
"""On the sample again before the next line, with feedback [s]."""


class Lift(Scan):
    """An image of which each line, trace and retrace, is measured twice: on the sample, and at a height above it.

    In the second pass z goes the way of the first one, less the lift: of a pressed tip less its deflection too, so that
    the lift is the distance from the sample of a cantilever that is not bent.
    """

    slides: ClassVar = False

    lift: Length = Field(50e-9, description="height of the second pass above the line measured in the first")
    lift_rate: Speed = Field(1e-6, description="velocity of z between the passes; fast, it may land in another branch")
    channels_above: str = Field(
        "",
        description="what is measured in the second pass, as channels, `_lift` after each name; empty: deflection, of "
        "a tip that taps amplitude, phase",
    )

    @property
    def names_above(self) -> list[str]:
        """Of the second pass, each once."""
        return list(dict.fromkeys(name.strip() for name in self.channels_above.split(",") if name.strip()))

    def spelled(self, view: InstrumentView) -> "Lift":
        """See `Scan`."""
        scan = super().spelled(view)
        assert isinstance(scan, Lift)
        above = _TAPPED if view.taps else _PRESSED
        return scan if scan.channels_above else scan.model_copy(update={"channels_above": above})

    def of_channels(self, names: Sequence[str]) -> "Lift":
        """See `Scan`."""
        own = super().of_channels([name for name in names if not name.endswith(ABOVE)])
        assert isinstance(own, Lift)
        above = [name.removesuffix(ABOVE) for name in names if name.endswith(ABOVE)]
        return own if own.channels_above else own.model_copy(update={"channels_above": ", ".join(above)})

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        yield from super().refusals(view, state)
        if state.feedback != "on":
            yield f"Lift is not allowed with feedback = {state.feedback}: it must be on"
        scan = self.spelled(view)
        above = scan.model_copy(update={"channels": scan.channels_above})
        yield from Scan.refusals(above, view, state)
        names = len(scan.channel_names) + len(scan.names_above)
        yield from too_much(2.0 * self.pixels * self.lines * names, f"a lift of {names} channels")
        if self.lift > (left := view.z - view.z_range[0]):
            yield f"lift = {self.lift:g} m is not allowed here: z has {left:.4g} m left"

    def empty(self, view: InstrumentView) -> Image:
        """See `Scan`."""
        scan = self.spelled(view)
        units = {name: each.unit for name, each in signals(view.instrument, scan.channel_names).items()}
        units |= {name + ABOVE: each.unit for name, each in signals(view.instrument, scan.names_above).items()}
        return Image.empty(scan, units)

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        view, image = run.view, self.empty(run.view)
        scan, whole = self.spelled(view), lines(self, view)
        image.metadata, image.line_rate = notes(view.parameters), whole.line_rate
        image.metadata["Lift"] = f"second pass {self.lift:.6g} m above the first, channels with {ABOVE}"
        put = self.putter(run, image)
        run.result = lambda: image
        touched = 0
        plans = [self._line(index, view) for index in range(self.lines)]
        each = 2.0 * plans[0].motion.samples * view.sample_period + 2.0 * self.lift / self.lift_rate + self._rest(view)
        run.total = view.move(*plans[0].begin, self.speed).ticks * view.control_period + self.lines * each
        for index, plan in enumerate(plans):
            told = f"line {index + 1} of {self.lines}"
            yield from run.going(*plan.begin, self.speed)
            first = _Pass(run, scan.channel_names, plan)
            if index == 0:
                image.start = (view.next_sample + plan.motion.turn) * view.sample_period
            yield Task(Order(plan.motion), plan.motion.samples * view.sample_period, told, first)
            yield from run.going(*plan.begin, self.speed)
            second = _Pass(run, scan.names_above, plan)
            yield from self._above(run, plan, first.way - self.lift - view.z, second, f"{told}, above it")
            touched += second.touching
            if touched and not view.taps:
                run.remark = (
                    f"{view.stays_in_contact('lift', self.lift)}; the second pass was in contact in {touched} of "
                    f"{index + 1} lines"
                )
            for way in (TRACE, RETRACE):
                above = {name + ABOVE: values for name, values in second.found[way].channels.items()}
                one = first.found[way]
                put(Line(index, way, one.time, {**one.channels, **above}))

    def _above(
        self, run: Execution, plan: LinePlan, way: NDArray[np.float64], above: "_Pass", told: str
    ) -> Iterator[Task]:
        """The second pass, along offsets of z from where it is [m], and back to the sample."""
        view, time = run.view, plan.motion.samples * run.view.sample_period
        run.state.approached = False
        up = Step(orders.RAMP, target=float(way[0]), rate=self.lift_rate)
        yield Task(Order(view.stay(), (up,)), time, told)
        fly = Step(orders.PROFILE, profile=way, period=view.sample_period)
        yield Task(Order(plan.motion, (fly,)), time, told, above)
        above.touching = view.touching
        yield from run.going(*plan.begin, self.speed)
        down = (
            Step(orders.RAMP, target=0.0, rate=self.lift_rate, then=1),
            Step(orders.DWELL, duration=self._rest(view) - _BACK, then=2),
            Step(orders.FOLLOW, duration=_BACK),
        )
        yield Task(Order(view.stay(), down), time, told)
        run.state.approached = True

    def _rest(self, view: InstrumentView) -> float:
        """On the sample again, before the next line [s]."""
        return _BACK + (_SETTLED * view.amplitude_lag if view.taps else view.control_period)

    def _line(self, index: int, view: InstrumentView) -> LinePlan:
        """One line of the image."""
        motion = lines(self, view).motion
        along = motion.first + index * motion.step
        sine, cosine = sincos(self.angle)
        place = {"centre_x": self.centre_x - sine * along, "centre_y": self.centre_y + cosine * along}
        return lines(self.model_copy(update={**place, "lines": 1, "slow_axis": False}), view)


class _Pass(LineCollector):
    """Trace and retrace of one line, and the way of z at each sample.

    Parameters
    ----------
    run : Execution
    names : list of str
    plan : LinePlan
    """

    def __init__(self, run: Execution, names: list[str], plan: LinePlan) -> None:
        self.touching = False
        """Whether the tip was on the sample at its end."""
        self._way = ["z"] if run.view.taps else ["z", "deflection_voltage"]
        super().__init__(run.view.instrument, list(dict.fromkeys([*names, *self._way])), plan, self._take_line)
        self._names, self.found = names, dict[str, Line]()
        # The vertical motion of the tip, also of a tilted cantilever.
        self._vertical = run.view.vertical_sensitivity
        self._parts: list[NDArray[np.float64]] = []

    def _add(self, values: Any, at: int) -> None:
        super()._add(values, at)
        rows = [list(self.signals).index(name) for name in self._way]
        z, *volts = (values * self._factors)[rows]
        self._parts.append(z - self._vertical * volts[0] if volts else z)

    def _take_line(self, line: Line) -> None:
        kept = {name: line.channels[name].copy() for name in self._names}
        self.found[line.direction] = Line(line.index, line.direction, line.time, kept)

    @property
    def way(self) -> NDArray[np.float64]:
        """Of z at each sample, of a pressed tip less its deflection [m]; z is driven a sample after it is asked for."""
        way = np.concatenate(self._parts)
        return np.append(way[1:], way[-1])
