"""The verb AmplitudeCurve: amplitude and phase of the driven cantilever over distance; docs/dynamic.md."""

import math
from collections.abc import Generator, Iterator
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Lt
from numpy.typing import NDArray
from pydantic import Field

from ...analysis.resonance import lag
from ...onboard.dynamic import frequency
from ...program import orders
from ...program.orders import Order, Step
from ..arrays import Arrays, Variable, attributes, variable
from ..collect import RecordCollector
from ..execution import Execution, Task
from ..quantities import Count, Length, Rest, Speed
from ..results import MicroscopeState
from ..verb import Verb, on_the_sample, too_fast, too_much
from ..view import InstrumentView

_MOTION = ["in_phase", "quadrature"]
_NAMES = ["z", *_MOTION, "deflection"]
_OF_LOOPS = {"frequency_shift": "Hz", "drive_amplitude": "m"}
"""Channels of loops that hold phase and amplitude, measured where there are such loops."""


class AmplitudeCurve(Verb):
    """Amplitude, phase and mean deflection on the way to the sample and back; the tip begins and ends off it.

    With loops that hold phase and amplitude also frequency shift and amplitude of the drive.
    """

    returns: ClassVar = Arrays

    begin: Length = Field(1e-9, description="z first goes towards the sample by this")
    ramp: Length = Field(100e-9, description="way of the curve from there, towards the sample and back")
    rate: Speed = Field(1e-6, description="velocity of z in the curve")
    begin_rate: Speed = Field(10e-6, description="velocity of z before and after the curve")
    settle: Rest = Field(20e-3, description="rest before the curve")
    points: Count = Field(500, description="means in each direction, at most")
    end_share: Annotated[float, Ge(0), Lt(1)] = Field(
        0.0, description="share of the amplitude before the curve, at which the way to the sample ends; 0: only at ramp"
    )

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        part = view.parameters.onboard
        if not hasattr(part, "drive_frequency"):
            yield f"AmplitudeCurve is not allowed with onboard.kind = {part.kind}, which has no drive: take dynamic"
            return
        if part.drive_amplitude == 0.0:
            yield "AmplitudeCurve is not allowed with onboard.drive_amplitude = 0: it must be > 0 m; tune sets it"
        if self.end_share > 0.0 and part.lock_in != "deflection":
            yield f"end_share = {self.end_share:g} is not allowed with onboard.lock_in = lateral: take deflection"
        yield from on_the_sample(self, state)
        yield from too_fast("rate", self.rate, 0.0, self.ramp, view)
        yield from too_fast("begin_rate", self.begin_rate, 0.0, self.begin, view)
        left = view.reach[1] - view.offset
        if self.begin + self.ramp > left:
            yield f"ramp = {self.ramp:g} m is not allowed here: z has {left - self.begin:.4g} m left after begin"
        if self.samples(view) < 1.0:
            yield f"points = {self.points} is not allowed: there are {self.points * self.samples(view):.4g} samples"
        yield from too_much(2.0 * len(_names(view)) * self.points, f"points = {self.points}")

    def samples(self, view: InstrumentView) -> float:
        """In a point."""
        return view.samples(self.ramp / self.rate) / self.points

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        view, start = run.view, run.view.offset
        run.state.near = True
        per = math.ceil(self.samples(view) - 1e-9)
        rate = 1.0 / (per * view.sample_period)
        both = [run.recorder(_names(view), rate, count=per * self.points) for _ in range(2)]
        run.result = lambda: self._found(view, both)
        way, there = self.ramp / self.rate, self.begin / self.begin_rate + self.settle
        run.total = 2.0 * (way + there)

        def move(target: float, rate: float, rest: float = 0.0, trigger: float = 0.0) -> Order:
            to = Step(orders.RAMP, target=start + target, rate=rate, trigger=trigger, watched=orders.AMPLITUDE)
            steps = to._replace(then=1), Step(orders.DWELL, duration=rest)
            return Order(view.stay(), steps if rest else (to,))

        yield Task(move(self.begin, self.begin_rate, self.settle), there, "on the way to the sample")
        trigger = self.end_share and self.end_share * (yield from self._free(run)) / view.deflection_sensitivity
        yield Task(move(self.begin + self.ramp, self.rate, trigger=trigger), way, "towards the sample", both[0])
        if run.triggered:
            # Back to the end of the last whole mean, so that those on the way back are at the same places.
            point = per * view.sample_period * self.rate
            whole = math.floor((view.offset - start - self.begin) / point + 1e-6)
            yield Task(move(self.begin + whole * point, self.rate), 1.0 / rate, "the amplitude has fallen to end_share")
            both[1] = run.recorder(_names(view), rate, count=per * whole)
        yield Task(move(self.begin, self.rate), way, "back", both[1])
        yield Task(move(0.0, self.begin_rate), there, "on the way back")
        run.state.near = False

    def _free(self, run: Execution) -> Generator[Task, None, float]:
        """The amplitude before the curve [m]."""
        duration = 4.0 * run.view.amplitude_lag
        recorder = run.recorder(_MOTION, 1.0 / (run.view.ticks(duration) * run.view.control_period))
        yield Task(Order(run.view.stay(duration)), duration, "measuring the free amplitude", recorder)
        x, y = (float(values[0]) for values in recorder.record().channels.values())
        return math.sqrt(x * x + y * y)

    def _found(self, view: InstrumentView, both: list[RecordCollector]) -> Arrays:
        """Both directions, from the far end on; what was not measured is NaN."""
        columns: dict[str, list[NDArray[np.float64]]] = {name: [] for name in (*_names(view), "amplitude", "phase")}
        records = [recorder.record().channels for recorder in both]
        longest = max(each["z"].size for each in records)
        for back, record in enumerate(records):
            read = {name: values[:: -1 if back else 1] for name, values in record.items()}
            response = read["in_phase"] - 1j * read["quadrature"]
            read["amplitude"], read["phase"] = np.abs(response), lag(response)
            for name, values in read.items():
                columns[name].append(np.pad(values, (0, longest - values.size), constant_values=np.nan))
        part = view.parameters.onboard
        told = {"drive_frequency_Hz": frequency(view.parameters), "drive_amplitude_m": part.drive_amplitude}
        over, units = ("direction", "point"), {"phase": "rad"} | _OF_LOOPS
        ways = Variable(("direction",), np.arange(2.0), {"units": "1", "flag_meanings": "approach retract"})
        return Arrays(
            {name: variable(over, np.stack(each), name, units.get(name, "m")) for name, each in columns.items()},
            {"direction": ways},
            attributes(self, told),
        )


def _names(view: InstrumentView) -> list[str]:
    """Channels that are measured."""
    return _NAMES + [name for name in _OF_LOOPS if hasattr(view.parameters.onboard, "phase_bandwidth")]
