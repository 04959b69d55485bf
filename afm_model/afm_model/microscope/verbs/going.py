"""The verbs Approach, Withdraw and MoveTo: to the sample, away from it, along it."""

import math
from collections.abc import Iterator
from typing import Annotated

from annotated_types import Gt, Le
from pydantic import Field

from ...core.errors import VerbError
from ...core.schema import Unit
from ...parameters import changed
from ...program import orders
from ...program.orders import Order, Step
from ..execution import Execution, Task, landing, withdrawing
from ..quantities import Length, Metre, Speed
from ..results import MicroscopeState
from ..verb import Verb, outside, saturating, too_fast
from ..view import InstrumentView

_PRESSED = 0.1
"""From a deflection of this part of the setpoint on, an approach that failed has met the sample."""
_SETTLED = 12.0
"""Lags of the amplitude after which it is settled."""


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
        run.state.withdrawn()


class Approach(Verb):
    """Move z to the sample until deflection, or amplitude of a tip that taps, is at the setpoint; then feedback on."""

    rate: Speed = Field(1e-6, description="velocity of z towards the sample")
    range: Length = Field(5e-6, description="way of z at most; without a sample within it the tip is withdrawn again")
    settle: Annotated[float, Gt(0), Le(1e4), Unit("s")] = Field(
        20e-3,
        description="rest before it, whose mean deflection is the zero (amplitude of a tip that taps: the free one), "
        "and another one after it with feedback",
    )

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        if state.approached:
            yield "Approach is not allowed: the tip is on the sample already; withdraw it first"
        if view.taps:
            if view.parameters.onboard.drive_amplitude == 0.0:
                yield (
                    "Approach is not allowed with onboard.drive_amplitude = 0: nothing drives the tip, whose amplitude "
                    "is to fall; it must be > 0 m; tune sets it"
                )
            yield from self._too_late(view)
            return
        if not view.setpoint > 0.0:
            yield f"Approach is not allowed with a setpoint of {view.setpoint:g} V: it must be > 0 V"
        yield from saturating("the setpoint", view.setpoint, view)
        yield from too_fast("rate", self.rate, view.setpoint, self.range, view)

    def _too_late(self, view: InstrumentView) -> Iterator[str]:
        """A rate at which z would go further than the setpoint of the amplitude before this is seen."""
        metres, late = view.setpoint * view.parameters.detector.deflection_sensitivity, view.amplitude_lag
        if metres > 0.0 and self.rate > metres / late:
            yield (
                f"rate = {self.rate:g} m/s is not allowed: the amplitude is {late:.2g} s late, in which z would go "
                f"further than the setpoint of {metres:.4g} m; it must be <= {metres / late:.3g} m/s"
            )

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        view, before = run.view, run.view.offset
        target = min(before + self.range, view.reach[1])
        run.total = 2.0 * self.settle + (target - before) / self.rate
        if view.taps:
            run.total += self.settle + _SETTLED * view.amplitude_lag
            yield from self._free(run)
        run.state.near = True
        if "feedback" in view.loop.settings:
            view.set_loop(feedback="on")
        run.state.feedback = "on"
        steps = landing(view, target, self.rate, self.settle)
        yield Task(Order(view.stay(), steps), run.total, "on the way to the sample")
        if run.triggered:
            run.state.approached = True
            return
        went = f"z went {target - before:.4g} m without"
        told = (self._missed_by_amplitude if view.taps else self._missed)(run, went)
        away = Step(orders.RAMP, target=before, rate=max(self.rate, Withdraw().rate))
        yield Task(Order(view.stay(), (away,)), (target - before) / away.rate, "no sample found, withdrawing")
        run.state.withdrawn()
        raise VerbError(told)

    def _free(self, run: Execution) -> Iterator[Task]:
        """Measure the free amplitude, and have the loop know it."""
        view = run.view
        recorder = run.recorder(["in_phase", "quadrature"], 1.0 / (view.ticks(self.settle) * view.control_period))
        settle = _SETTLED * view.amplitude_lag
        yield Task(Order(view.stay(settle)), settle, "waiting for the amplitude to settle")
        yield Task(Order(view.stay(self.settle)), self.settle, "measuring the free amplitude", recorder)
        x, y = (float(values[0]) for values in recorder.record().channels.values())
        # Not hypot: a setpoint follows from it, and is to be the same on every machine.
        free, part = math.sqrt(x * x + y * y), view.parameters.onboard
        if part.setpoint_amplitude >= free:
            raise VerbError(
                f"the free amplitude is {free:.4g} m, the setpoint {part.setpoint_amplitude:.4g} m: it must be lower; "
                f"take a lower setpoint, or a larger drive (tune with free_amplitude sets it)"
            )
        view.instrument.set_onboard(changed(view.parameters, {"onboard.free_amplitude": free}))
        for sentence in self._too_late(view):
            raise VerbError(sentence)

    def _missed(self, run: Execution, went: str) -> str:
        """Why the deflection has not risen to the setpoint."""
        rise, setpoint = run.standing().deflection_voltage - run.rest, run.view.setpoint
        without = f"{went} the deflection rising to the setpoint of {setpoint:.4g} V"
        if rise > _PRESSED * setpoint:
            return (
                f"the tip was pressed into the sample: {without}, at the end it was {rise:.4g} V over its rest; the "
                f"tip is withdrawn again: take a lower setpoint, or a larger range"
            )
        return f"no sample within range = {self.range:g} m: {without}; the tip is withdrawn again"

    def _missed_by_amplitude(self, run: Execution, went: str) -> str:
        """The same of a tip that taps."""
        view, metres = run.view, run.view.parameters.detector.deflection_sensitivity
        free, setpoint = view.free_amplitude, view.setpoint
        last = view.instrument.orders.onboard.amplitude
        without = f"{went} the amplitude falling to the setpoint of {metres * setpoint:.4g} m"
        if free - last > _PRESSED * (free - setpoint):
            return (
                f"{without}, at the end it was {metres * last:.4g} m, free {metres * free:.4g} m; the tip is withdrawn "
                f"again: take a larger range"
            )
        return f"no sample within range = {self.range:g} m: {without}; the tip is withdrawn again"


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
