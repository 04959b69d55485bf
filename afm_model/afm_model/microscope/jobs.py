"""How a verb is done: orders one after the other, what is collected meanwhile, what comes out.

A job yields tasks; each is begun when the order of the one before is done. Its `result` can be asked for at any time:
it is what has been measured up to there. One that cannot be brought to its end raises VerbError.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from ..core.errors import VerbError
from ..core.records import place
from ..parts.signals import Measurement
from ..program import orders
from ..program.orders import END, Order, Step
from .bench import Bench
from .collect import Collector
from .results import Line, Standing
from .verbs import Approach, MoveTo, Withdraw

TOUCH = 1e-3
"""Least trigger of a landing over the setpoint: for a tip that has not left the sample."""


@dataclass
class Task:
    """One order."""

    order: Order
    duration: float  # that it takes at most [s]
    detail: str  # a clause for whoever waits
    collect: Callable[[int], Collector] | None = None
    """Number of the first sample -> what collects from it on, to the end of the order."""
    goes_on: bool = False
    """What the order before has collected is collected further."""


@dataclass
class Desk:
    """Where the microscope stands."""

    approached: bool = False
    """The loop follows the sample."""
    feedback: str = "on"
    """What the loop does when approached: on, hold, off, external."""
    setpoint: float = 0.0  # of the deflection [V]
    proportional_gain: float = 0.0  # [m/V]
    integral_gain: float = 0.0  # [m/(V s)]
    place: tuple[float, float] = (0.0, 0.0)
    """Asked for [m]."""
    near: bool = False
    """The tip may touch the sample."""
    doing: str = ""
    """Name of the verb that is being done."""


class Job:
    """A verb being done.

    Parameters
    ----------
    verb : Verb
    bench : Bench
    desk : Desk
    """

    total: float = 0.0
    """What it takes at most, as far as known [s]."""
    surface: float = math.inf
    """Offset of z at which the tip was on the sample before the verb opened the loop [m]; infinite: not known."""
    on_line: Callable[[Line], None]

    def __init__(self, verb: Any, bench: Bench, desk: Desk) -> None:
        self.verb, self.bench, self.desk = verb, bench, desk

    def tasks(self) -> Iterator[Task]:
        """What is to be done, in order; looked at between two ticks, when the order before is done."""
        raise NotImplementedError

    def result(self) -> Any:
        """What came out, as far as it is measured."""
        return standing(self.bench)

    def leave(self) -> None:
        """Called at its end, however that comes: put back what was changed."""

    @property
    def remark(self) -> str:
        """What is to be known of a result that is whole, a sentence; mostly nothing."""
        return ""

    @property
    def detail(self) -> str:
        """How far it is, a clause; empty: what the task says."""
        return ""


def standing(bench: Bench) -> Standing:
    """Where everything is."""
    x, y = bench.place
    deflection = float(bench.instrument.measurement[place(Measurement, "deflection_voltage")])
    return Standing(bench.instrument.time, x, y, bench.z, deflection)


def withdrawing(
    bench: Bench, distance: float, rate: float, surface: float = math.inf
) -> tuple[tuple[Step, ...], float]:
    """Steps that open the loop and move z away, as far as its range goes, and how long they take [s].

    `distance` counts from where z is, or from `surface` if z has gone beyond it towards the sample.
    """
    offset = bench.offset
    target = max(min(offset, surface) - distance, bench.reach[0])
    return (Step(orders.RAMP, target=target, rate=rate),), abs(offset - target) / rate


def landing(bench: Bench, target: float, rate: float, settle: float, rest: float = 0.0) -> tuple[Step, ...]:
    """Steps that go to the sample until the deflection has risen to the setpoint, and close the loop there.

    Without a sample on the way to `target` (an offset of z) the loop stays open. `rest` is the deflection that there
    is before it already [V].
    """
    trigger = max(bench.setpoint - rest, TOUCH * bench.setpoint)
    return (
        Step(orders.REST, duration=settle, then=1),
        Step(orders.RAMP, target=target, rate=rate, trigger=trigger, then=END, triggered=2),
        Step(orders.FOLLOW, duration=settle),
    )


class Approaching(Job):
    """Approach."""

    verb: Approach

    def tasks(self) -> Iterator[Task]:
        """See `Job`."""
        bench, verb = self.bench, self.verb
        before = bench.offset
        target = min(before + verb.range, bench.reach[1])
        self.total = 2.0 * verb.settle + (target - before) / verb.rate
        steps = landing(bench, target, verb.rate, verb.settle)
        yield Task(Order(bench.stay(), steps), self.total, "on the way to the sample")
        if bench.instrument.orders.program.fired != 0.0:
            self.desk.approached = True
            return
        away = Step(orders.RAMP, target=before, rate=max(verb.rate, Withdraw().rate))
        yield Task(Order(bench.stay(), (away,)), (target - before) / away.rate, "no sample found, withdrawing")
        self.desk.near = False
        raise VerbError(
            f"no sample within range = {verb.range:g} m: z went {target - before:.4g} m without the deflection rising "
            f"to the setpoint of {bench.setpoint:.4g} V; the tip is withdrawn again"
        )


class Withdrawing(Job):
    """Withdraw."""

    verb: Withdraw
    _left: float = math.inf
    """Way that z has left to go away [m]."""

    def tasks(self) -> Iterator[Task]:
        """See `Job`."""
        bench, verb = self.bench, self.verb
        self._left = bench.offset - bench.reach[0]
        steps, self.total = withdrawing(bench, verb.distance, verb.rate)
        self.desk.approached = False
        yield Task(Order(bench.stay(), steps), self.total, "withdrawing")
        self.desk.near = False

    @property
    def remark(self) -> str:
        """See `Job`."""
        if self._left >= self.verb.distance:
            return ""
        return (
            f"z went {self._left:.4g} m, not distance = {self.verb.distance:g} m: its range ends there, and the tip "
            f"may still touch the sample"
        )


class Moving(Job):
    """MoveTo."""

    verb: MoveTo

    def tasks(self) -> Iterator[Task]:
        """See `Job`."""
        yield from going(self, self.verb.x, self.verb.y, self.verb.speed)


def going(job: Job, x: float, y: float, speed: float) -> Iterator[Task]:
    """Move to a place from rest to rest."""
    bench = job.bench
    motion = bench.move(x, y, speed)
    duration = motion.ticks * bench.control_period
    job.total = max(job.total, duration)
    if motion.ticks:
        yield Task(Order(motion), duration, "moving")
