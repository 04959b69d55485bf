"""The verb FrictionLoop."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...core.elementary import sincos
from ...program.orders import Order
from ..arrays import Arrays, attributes, variable
from ..execution import Execution, Task
from ..plan import LinePlan
from ..quantities import Angle, Length, LineCount, Rate, SampleRate
from ..results import MicroscopeState
from ..verb import Verb, too_much
from ..view import InstrumentView
from .going import MoveTo
from .scan import OVERSCAN, frame, to_and_fro

_TURNING = 0.625
"""The scanner goes 5/16 of speed times time of a turn beyond a line, at both ends."""


@dataclass(frozen=True)
class Loop:
    """Lines to and fro."""

    verb: "FrictionLoop"
    position: NDArray[np.float64]  # along the line, as asked for [m]
    lateral: NDArray[np.float64]  # [N]
    deflection: NDArray[np.float64]  # [m]
    time: NDArray[np.float64]  # [s]
    deflection_sensitivity: float  # with which it was computed, across the cantilever [m/V]
    lateral_sensitivity: float  # [N/V]

    def arrays(self) -> Arrays:
        """Over time: `position`, `lateral`, `deflection`."""
        units = {"position": "m", "lateral": "N", "deflection": "m"}
        variables = {name: variable(("time",), getattr(self, name), name, unit) for name, unit in units.items()}
        used = {name: getattr(self, name) for name in ("deflection_sensitivity", "lateral_sensitivity")}
        return Arrays(variables, {"time": variable(("time",), self.time, "time", "s")}, attributes(self.verb, used))


class FrictionLoop(Verb):
    """Lines to and fro through the place where the scanner stands, with feedback."""

    returns: ClassVar = Loop
    on_sample: ClassVar = True
    presses: ClassVar = True
    slides: ClassVar = True

    length: Length = Field(10e-9, description="of the line, whose middle is where the scanner stands")
    angle: Angle = Field(0.0, description="of the line against x, counterclockwise")
    line_rate: Rate = Field(10.0, description="lines a second; a line is trace and retrace")
    count: LineCount = Field(2, description="lines; the first one begins in the middle and is not part of the result")
    sample_rate: SampleRate = Field(50e3, description="samples of the result; each is a mean over samples of the ADC")

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        if self.count < 2:
            yield f"count = {self.count} is not allowed: the first line is not part of the result; it must be >= 2"
        yield from too_much(
            4.0 * view.samples(self.count / self.line_rate, self.sample_rate),
            f"count = {self.count} at line_rate = {self.line_rate:g} Hz and sample_rate = {self.sample_rate:g} Hz",
        )
        yield from frame(self._plan(view), view)

    def _plan(self, view: InstrumentView) -> LinePlan:
        """Lines whose turning points are `length` apart, through the place where the scanner is asked to be."""
        x, y = view.place
        size = self.length / (1.0 + _TURNING * OVERSCAN)
        return to_and_fro(view, (x, y), size, self.count, self.line_rate, self.angle)

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`. What is measured goes from the first turn to the right to the last one, both of them whole."""
        plan = self._plan(run.view)
        motion = plan.motion
        count = motion.turn + 2 * (self.count - 1) * (motion.image + motion.turn)
        names = ["asked_x", "asked_y", "lateral", "deflection"]
        recorder = run.recorder(names, self.sample_rate, motion.turn + motion.image, count)

        def result() -> Loop:
            record = recorder.record()
            x, y, lateral, deflection = record.channels.values()
            s, c = sincos(motion.angle)
            along = (x - motion.x) * c + (y - motion.y) * s
            return Loop(self, along, lateral, deflection, record.time, *recorder.factors("deflection", "lateral"))

        run.result = result
        run.total = motion.samples * run.view.sample_period
        yield from run.going(*plan.begin, MoveTo().speed)
        yield Task(Order(motion), motion.samples * run.view.sample_period, "sliding", recorder)
        yield from run.going(motion.x, motion.y, MoveTo().speed)
