"""The verbs Approach, Withdraw and MoveTo: to the sample, away from it, along it."""

from collections.abc import Iterator
from typing import Annotated

from annotated_types import Gt, Le
from pydantic import Field

from ...core.errors import VerbError
from ...core.schema import Unit
from ...program import orders
from ...program.orders import Order, Step
from ..execution import Execution, Task, landing, withdrawing
from ..results import MicroscopeState
from ..verb import Length, Metre, Speed, Verb, outside, saturating, too_fast
from ..view import InstrumentView

_PRESSED = 0.1
"""From a deflection of this part of the setpoint on, an approach that failed has met the sample."""


class Withdraw(Verb):
    """Switch the feedback off and move z away from the sample."""

    distance: Length = Field(500e-9, description="way of z")
    rate: Speed = Field(10e-6, description="velocity of z")

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        view = run.view
        left = view.offset - view.reach[0]
        steps, run.total = withdrawing(view, self.distance, self.rate)
        run.state.approached = False
        if left < self.distance:
            run.remark = (
                f"z went {left:.4g} m, not distance = {self.distance:g} m: its range ends there, and the tip may still "
                f"touch the sample"
            )
        yield Task(Order(view.stay(), steps), run.total, "withdrawing")
        run.state.near = False
        run.state.feedback = "off"


class Approach(Verb):
    """Move z to the sample until the deflection reaches the setpoint, then switch the feedback on."""

    rate: Speed = Field(1e-6, description="velocity of z towards the sample")
    range: Length = Field(5e-6, description="way of z at most; without a sample within it the tip is withdrawn again")
    settle: Annotated[float, Gt(0), Le(1e4), Unit("s")] = Field(
        20e-3, description="rest before it, whose mean deflection is the zero, and with feedback behind it"
    )

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        if state.approached:
            yield "Approach is not allowed: the tip is on the sample already; withdraw it first"
        if not view.setpoint > 0.0:
            yield f"Approach is not allowed with a setpoint of {view.setpoint:g} V: it must be > 0 V"
        yield from saturating("the setpoint", view.setpoint, view)
        yield from too_fast("rate", self.rate, view.setpoint, self.range, view)

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        view, before = run.view, run.view.offset
        run.state.near = True
        if "feedback" in view.loop.settings:
            view.set_loop(feedback="on")
        run.state.feedback = "on"
        target = min(before + self.range, view.reach[1])
        run.total = 2.0 * self.settle + (target - before) / self.rate
        steps = landing(view, target, self.rate, self.settle)
        yield Task(Order(view.stay(), steps), run.total, "on the way to the sample")
        if run.triggered:
            run.state.approached = True
            return
        rise = run.standing().deflection_voltage - run.rest
        away = Step(orders.RAMP, target=before, rate=max(self.rate, Withdraw().rate))
        yield Task(Order(view.stay(), (away,)), (target - before) / away.rate, "no sample found, withdrawing")
        run.state.near = False
        went = f"z went {target - before:.4g} m without the deflection rising to the setpoint of {view.setpoint:.4g} V"
        if rise > _PRESSED * view.setpoint:
            raise VerbError(
                f"the tip was pressed into the sample: {went}, at the end it was {rise:.4g} V over its rest; the tip "
                f"is withdrawn again: take a lower setpoint, or a larger range"
            )
        raise VerbError(f"no sample within range = {self.range:g} m: {went}; the tip is withdrawn again")


class MoveTo(Verb):
    """Move the scanner along x and y on a straight line; the feedback stays as it is."""

    x: Metre = Field(0.0, description="place to go to")
    y: Metre = Field(0.0, description="place to go to")
    speed: Speed = Field(10e-6, description="velocity along the line")

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        yield from outside(view, "", [(self.x, self.y)])

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        yield from run.going(self.x, self.y, self.speed)
