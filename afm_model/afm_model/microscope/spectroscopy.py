"""Force curves."""

from collections.abc import Iterator

import numpy as np

from ..core.errors import VerbError
from ..program import orders
from ..program.force_curve import APPROACH, DWELL, LIFT, RETRACT, SETTLE
from ..program.orders import Order, Step
from .bench import Bench
from .collect import RecordCollector
from .jobs import Desk, Job, Task, landing
from .results import Curve, Record
from .verbs import ForceCurve

_PHASES = (LIFT, SETTLE, APPROACH, DWELL, RETRACT)
"""Of the steps of an order, in order."""
_NAMES = {"z": "z", "deflection_voltage": "deflection", "lateral_voltage": "lateral", "step": "phase"}
_AGAIN = 2.0
"""The tip goes back to the sample by so many times the way that it was lifted by, at most."""


class Curving(Job):
    """ForceCurve."""

    verb: ForceCurve

    def __init__(self, verb: ForceCurve, bench: Bench, desk: Desk) -> None:
        super().__init__(verb, bench, desk)
        self._curves: list[tuple[RecordCollector, bool]] = []
        self._collector: RecordCollector | None = None

    @property
    def trigger(self) -> float:
        """Rise of the deflection at which an approach ends [V]; 0: with the ramp."""
        verb, bench = self.verb, self.bench
        if verb.trigger_force > 0.0:
            return bench.volts(verb.trigger_force)
        return verb.trigger_voltage

    def tasks(self) -> Iterator[Task]:
        """See `Job`."""
        bench, verb = self.bench, self.verb
        self.desk.approached = False
        self.surface = bench.offset
        down = bench.offset - verb.lift
        top = down + verb.ramp
        one = verb.lift / verb.retract_rate + verb.settle + verb.dwell
        one += verb.ramp / verb.approach_rate + verb.ramp / verb.retract_rate
        back = 2.0 * verb.settle + _AGAIN * verb.lift / verb.approach_rate
        self.total = verb.count * one + back
        steps = (
            Step(orders.RAMP, target=down, rate=verb.retract_rate, then=1),
            Step(orders.REST, duration=verb.settle, then=2),
            Step(orders.RAMP, target=top, rate=verb.approach_rate, trigger=self.trigger, then=3, triggered=3),
            Step(orders.DWELL, duration=verb.dwell, then=4),
            Step(orders.RAMP, target=down, rate=verb.retract_rate),
        )
        for number in range(verb.count):
            detail = f"curve {number + 1} of {verb.count}"
            yield Task(Order(bench.stay(), steps), one, detail, self._collect)
            assert self._collector is not None
            self._curves.append((self._collector, bench.instrument.orders.program.fired != 0.0))
            self._collector = None
        target = min(down + _AGAIN * verb.lift, bench.reach[1])
        # A short lift does not leave the sample: the setpoint counts from where the deflection is.
        program = bench.instrument.orders.program
        rest = float(program["sum"] / program["samples"])
        again = landing(bench, target, verb.approach_rate, verb.settle, rest)
        yield Task(Order(bench.stay(), again), back, "back to the sample")
        if bench.instrument.orders.program.fired == 0.0:
            raise VerbError(
                f"behind the curves the sample was not found again: z went {target - down:.4g} m without the "
                f"deflection rising to the setpoint of {bench.setpoint:.4g} V; the tip is withdrawn"
            )
        self.desk.approached = True

    def _collect(self, first: int) -> RecordCollector:
        per = max(1, round(1.0 / (self.verb.sample_rate * self.bench.sample_period)))
        self._collector = RecordCollector(self.bench.instrument, list(_NAMES), first, per)
        return self._collector

    def result(self) -> list[Curve]:
        """The curves as far as they came; one that was broken off is the last one."""
        broken = [(self._collector, False)] if self._collector is not None else []
        return [self._curve(collector, fired) for collector, fired in (*self._curves, *broken)]

    def _curve(self, collector: RecordCollector, fired: bool) -> Curve:
        record, verb, bench = collector.record(), self.verb, self.bench
        step = np.rint(record.channels["step"]).astype(int)
        # Behind the last step the order is done: -1. A mean over its end would be some step between.
        step = np.maximum.accumulate(step)
        phase = np.array([*_PHASES, RETRACT], np.float64)[step]
        part = phase >= APPROACH
        values = {_NAMES[name]: values[part] for name, values in record.channels.items() if name != "step"}
        units = {_NAMES[name]: unit for name, unit in record.units.items()}
        x, y = bench.place
        return Curve(
            Record(record.time[part], values | {"phase": phase[part]}, units),
            triggered=fired,
            x=x,
            y=y,
            approach_rate=verb.approach_rate,
            retract_rate=verb.retract_rate,
            # Both are those of vertical motion: their product times the voltage is the vertical force.
            deflection_sensitivity=bench.vertical_sensitivity,
            spring_constant=bench.vertical_stiffness,
            trigger=self.trigger,
        )
