"""The verbs MoveZ and Hold: z with its loop held or off."""

from collections.abc import Iterator
from typing import ClassVar

from pydantic import Field

from ...program import orders
from ...program.orders import Order, Step
from ..execution import Execution, Task
from ..quantities import Metre, Rest, Speed
from ..results import MicroscopeState
from ..verb import Verb
from ..view import InstrumentView


def _outside(view: InstrumentView, z: float, what: str) -> Iterator[str]:
    """Why z cannot go to a place [m]; `what` begins the sentence."""
    low, high = view.z_range
    if not low <= z <= high:
        yield f"{what} = {z:g} m is not allowed: z must be within {low:g} m and {high:g} m"


def _moved(view: InstrumentView, z: float, rate: float) -> tuple[tuple[Step, ...], float]:
    """Steps to a z [m], after which the loop is as it was before, and how long they take [s]."""
    origin, held = view.z - view.offset, view.follows
    to = Step(orders.RAMP, target=z - origin, rate=rate, then=1 if held else orders.END)
    # With this step z is the loop's again, whose feedback is held.
    return (to, Step(orders.FOLLOW)) if held else (to,), abs(z - view.z) / rate


class MoveZ(Verb):
    """Move z to a place. The feedback must be held or off, or the tip withdrawn."""

    z: Metre = Field(0.0, description="as driven, positive towards the sample")
    rate: Speed = Field(1e-6, description="velocity of z")

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        if view.follows and state.feedback not in ("hold", "off"):
            yield f"MoveZ is not allowed with feedback = {state.feedback}: set it to hold first"
        yield from _outside(view, self.z, "z")

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        steps, run.total = _moved(run.view, self.z, self.rate)
        if self.z > run.view.z:
            run.state.near = True
        yield Task(Order(run.view.stay(), steps), run.total, "moving z")
        run.state.approached &= run.view.touching


class Hold(Verb):
    """Hold z where the loop has kept it: at its mean over a time, raised by a lift. `set_feedback` on ends it."""

    on_sample: ClassVar = True
    slides: ClassVar = True

    delay: Rest = Field(0.0, description="time of the mean, in which the loop goes on; 0: where z is")
    lift: Metre = Field(0.0, description="then z goes away from the sample by this")
    rate: Speed = Field(1e-6, description="velocity of z meanwhile")

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        yield from _outside(view, view.z - self.lift, "z less lift")

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        view, z = run.view, run.view.z
        run.total = self.delay + abs(self.lift) / self.rate
        if self.delay > 0.0:
            ticks = view.ticks(self.delay)
            recorder = run.recorder(["z"], count=ticks * view.samples_per_tick)
            yield Task(Order(view.stay(self.delay)), self.delay, "taking the mean of z", recorder)
            z = float(recorder.record().channels["z"].mean())
        if "feedback" in view.loop.settings:
            view.set_loop(feedback="hold")
        run.state.feedback = "hold"
        low, high = view.z_range
        steps, duration = _moved(view, min(max(z - self.lift, low), high), self.rate)
        yield Task(Order(view.stay(), steps), duration, "lifting the tip")
        run.state.approached &= view.touching
