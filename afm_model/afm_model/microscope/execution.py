"""A verb that is being done: orders one after the other, what is collected meanwhile, what comes out."""

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from ..compiled.records import place
from ..parts.signals import Measurement
from ..program import orders
from ..program.orders import END, Order, Step
from .collect import Collector, RecordCollector
from .image import Line
from .results import MicroscopeState, Standing
from .view import InstrumentView

TOUCH = 1e-3
"""Least trigger of a landing over the setpoint: for a tip that has not left the sample."""


class Task(NamedTuple):
    """One order."""

    order: Order
    duration: float
    """That it takes at most [s]."""
    detail: str | Callable[[], str]
    """What is being done, a clause for whoever waits."""
    collect: Collector | None = None
    """Collects from its first sample to its last; if the task before has the same one it goes on."""


class Execution:
    """What a verb's tasks know, and what they report.

    Parameters
    ----------
    view : InstrumentView
    state : MicroscopeState
        The microscope's own, to be changed.
    on_line : callable
        Called with every line of a scan.
    """

    def __init__(self, view: InstrumentView, state: MicroscopeState, on_line: Callable[[Line], object]) -> None:
        self.view, self.state, self.on_line = view, state, on_line
        self.total = 0.0
        """What it takes at most, as far as known [s]."""
        self.surface = math.inf
        """Offset of z at which the tip was on the sample before the verb opened the loop [m]; infinite: not known."""
        self.back: Callable[[], tuple[tuple[Step, ...], float]] | None = None
        """Of a verb that opens the loop: steps that bring the tip back to its setpoint, and how long they take [s]."""
        self.of_lift = ""
        """What is to be known of a lift after which the tip still touches the sample, a sentence."""
        self.remark = ""
        """What is to be known of a result that is whole, a sentence."""
        self.result: Callable[[], Any] = self.standing
        """What has been measured up to now; may be asked for at any time, and raise VerbError if nothing comes out."""

    def standing(self) -> Standing:
        """Where everything is."""
        instrument, (x, y) = self.view.instrument, self.view.place
        deflection = float(instrument.measurement[place(Measurement, "deflection_voltage")])
        return Standing(instrument.time, x, y, self.view.z, deflection)

    def recorder(
        self, names: list[str], sample_rate: float = math.inf, skip: int = 0, count: int | None = None
    ) -> RecordCollector:
        """Collects means at this rate [Hz], or at that of the virtual ADC if it is lower; see `Collector`."""
        per = max(1, round(1.0 / (sample_rate * self.view.sample_period)))
        return RecordCollector(self.view.instrument, names, per, skip, count)

    def going(self, x: float, y: float, speed: float) -> Iterator[Task]:
        """Move to a place [m] from rest to rest, `speed` [m/s] at most."""
        motion = self.view.move(x, y, speed)
        duration = motion.ticks * self.view.control_period
        self.total = max(self.total, duration)
        if motion.ticks:
            yield Task(Order(motion), duration, "moving")

    @property
    def rest(self) -> float:
        """Mean deflection in the last rest of an order [V]; 0 if there was none."""
        program = self.view.instrument.orders.program
        return float(program["total"] / program["samples"]) if program["samples"] else 0.0

    @property
    def triggered(self) -> bool:
        """Whether a step of the last order has ended by its trigger."""
        return bool(self.view.instrument.orders.program.fired != 0.0)


def withdrawing(
    view: InstrumentView, distance: float, rate: float, surface: float = math.inf
) -> tuple[tuple[Step, ...], float]:
    """Steps that open the loop and move z away, as far as its range goes, and how long they take [s].

    `distance` counts from where z is, or from `surface` if z has gone beyond it towards the sample.
    """
    offset = view.offset
    target = max(min(offset, surface) - distance, view.reach[0])
    return (Step(orders.RAMP, target=target, rate=rate),), abs(offset - target) / rate


def after(first: Step, steps: tuple[Step, ...]) -> tuple[Step, ...]:
    """Steps with another one before them."""
    later = [
        step._replace(**{name: to + 1 for name in ("then", "triggered") if (to := getattr(step, name)) != END})
        for step in steps
    ]
    return (first._replace(then=1), *later)


def landing(view: InstrumentView, target: float, rate: float, settle: float, rest: float = 0.0) -> tuple[Step, ...]:
    """Steps that go to the sample until the deflection has risen to the setpoint, and close the loop there.

    Without a sample on the way to `target` (an offset of z) the loop stays open. `rest` is the deflection that there
    is before it already [V]. Of a tip that taps, until the amplitude has fallen to the setpoint.
    """
    if view.taps:
        to = Step(orders.RAMP, target=target, rate=rate, trigger=view.setpoint, watched=orders.AMPLITUDE, triggered=1)
        return to, Step(orders.FOLLOW, duration=settle)
    trigger = max(view.setpoint - rest, TOUCH * view.setpoint)
    return (
        Step(orders.REST, duration=settle, then=1),
        Step(orders.RAMP, target=target, rate=rate, trigger=trigger, then=END, triggered=2),
        Step(orders.FOLLOW, duration=settle),
    )
