"""A run and its commands. No ROS, no sleeping, no clock inside."""

from collections.abc import Callable
from dataclasses import replace

from ..fault import acted, active
from ..instrument import Instrument
from ..parameters import SimParameters
from .context import RunContext
from .counts import Snapshot
from .engine import Engine, VerbOperator
from .law_inside import LawInside
from .link import Link, Listeners
from .lockstep import Lockstep, Wired
from .pacing import Pacing
from .realtime import Realtime
from .state import BACK, OVER, Cause, RunState
from .timing import Delays


class Run(Engine):
    """One instrument in lockstep or in real time, with the commands from outside.

    Who calls `step` may wait in between: until `deadline`, or without a deadline until a drive arrives. Only the
    methods of this class and of `Engine` change the state.

    Parameters
    ----------
    parameters : SimParameters
    link : Link
    clock : callable
        Steady wall time [s]; any origin.
    listeners, block_ticks, operate, in_pieces
        As of `Engine`.

    Raises
    ------
    ParameterError
        As `Instrument` does.
    """

    def __init__(
        self,
        parameters: SimParameters,
        link: Link,
        clock: Callable[[], float],
        listeners: Listeners | None = None,
        block_ticks: int = 500,
        operate: Callable[[Instrument], VerbOperator] | None = None,
        *,
        in_pieces: bool = False,
    ) -> None:
        self._parameters, self._block_ticks = parameters, block_ticks
        super().__init__(
            parameters,
            self._choose_pacing,
            parameters.total_ticks,
            link=link,
            clock=clock,
            listeners=listeners,
            block_ticks=block_ticks,
            operate=operate,
            in_pieces=in_pieces,
        )
        self.held = parameters.run.start_paused
        self._record_anyway = False
        self._period_ns = parameters.plant.control_period * 1e9

    def _choose_pacing(self, context: RunContext) -> Pacing:
        parameters = self._parameters
        if parameters.controller_inside is not None:
            return LawInside(context, parameters)
        if parameters.run.mode == "realtime":
            return Realtime(context, parameters)
        wire = context.link.wire
        return Lockstep(context, parameters) if wire is None else Wired(context, parameters, wire)

    @property
    def deadline(self) -> float | None:
        """When the next tick is due by the clock [s]; None: when a drive arrives, or not at all (see `ticking`)."""
        return self.pacing.deadline if self.ticking else None

    @property
    def stamp_ns(self) -> int:
        """Simulated time of the next control tick [ns]."""
        return round(self.instrument.ticks * self._period_ns)

    def snapshot(self) -> Snapshot:
        """The run as it is now."""
        instrument = self.instrument
        run = self._parameters.run
        return Snapshot(
            run_id=self.run_id,
            state=self.life.state,
            detail=self.life.detail,
            ticks=instrument.ticks,
            time=instrument.time,
            stamp_ns=self.stamp_ns,
            samples=instrument.ticks * instrument.samples_per_tick,
            elapsed=self.watch.elapsed,
            wanted_factor=run.real_time_factor if run.mode == "realtime" else None,
            in_contact=instrument.in_contact,
            samples_saturated=instrument.samples_saturated,
            time_outside=instrument.time_outside,
            counts=replace(
                self.counts,
                drives_clipped=instrument.drives_clipped,
                drives_steep=instrument.drives_steep,
                **instrument.guard.counts(),
            ),
            refusal=self._context.refusal,
            reason=self.reason,
            scored_ticks_held=self.pacing.scored_ticks_held,
            unreadable=self._context.unreadable,
            faults=tuple(active(instrument.parameters, instrument.ticks)) if instrument.has_faults else (),
            faults_acted=tuple(acted(instrument.parameters, instrument.ticks)) if instrument.has_faults else (),
        )

    def delays(self) -> Delays:
        """Wall times of the ticks handed on up to now; some ten microseconds."""
        return self.blocks.delays()

    def play(self) -> str:
        """Start as soon as everybody is there, or go on after a pause; why not, or an empty string."""
        if self.stepping:
            self.stop_at(None)
            self._on_change()
        return self._go_on()

    def step_by(self, ticks: int) -> str:
        """Make so many ticks and pause again; why not, or an empty string.

        A run that is configured not to start before `play` starts with them.
        """
        if ticks < 1:
            return f"{ticks} ticks are not allowed: it must be 1 at least"
        if self.state != RunState.PAUSED and not (self.state == RunState.WAITING and self.held):
            return f"the run is {self.state.title}: it must be paused"
        if self.idle:
            return "no verb is being done: simulated time stands still until one is"
        self.stop_at(self.instrument.ticks + ticks)
        return self._go_on()

    def _go_on(self) -> str:
        self.held = False
        if self.state == RunState.PAUSED:
            self._context.go_on(Cause.PLAY)
            self.pacing.resume()
        return "the run is over: call reset first" if self.state in OVER else ""

    def pause(self) -> str:
        """Stop between two ticks, or do not start before `play`; why not, or an empty string."""
        waited = self.stepping
        self.stop_at(None)
        if self.state == RunState.WAITING:
            self.held = True
            if waited:
                self._on_change()
        elif self.ticking or self.state == RunState.HELD:
            self.life.go(Cause.PAUSE)
        return "the run is over: there is nothing to pause" if self.state in OVER else ""

    def resume(self) -> str:
        """Bring a withdrawn sample back to the tip, or go on without a recording; why not, or an empty string."""
        if self.state == RunState.WITHDRAWN:
            return self.bring_back()
        if self.state == RunState.HELD:
            self._record_anyway = True
            self._leave_hold()
            return ""
        if self.state == RunState.PAUSED and self.phase in BACK:
            return "the run is paused: call play first"
        return f"the run is {self.state.title}: there is nothing to resume"

    def tell_recorder(self, problem: str) -> None:
        """Say why the recorder cannot write its file; empty: it can."""
        if not problem:
            self._record_anyway = False
            if self.state == RunState.HELD:
                self._leave_hold()
        elif self.ticking and self.state != RunState.STALLED and self._parameters.safety.unrecorded:
            if not self._record_anyway:
                self.life.go(Cause.UNRECORDED, f"{problem}: the run is held (safety.unrecorded)")

    def _leave_hold(self) -> None:
        self._context.go_on(Cause.RECORDED)
        self.pacing.resume()

    def _begin_again(self) -> None:
        """As of `Engine`. A run that was paused waits for `play`."""
        # A run that was stepped was paused between the steps.
        paused = self.state == RunState.PAUSED or self.stepping
        self.held = self._parameters.run.start_paused or paused
        self._record_anyway = False
        super()._begin_again()

    def exchange(self, parameters: SimParameters) -> None:
        """Go on with another instrument, from its start: another sample, another cantilever.

        Raises
        ------
        ParameterError
            If there can be no such instrument; nothing changes then.
        """
        instrument = Instrument(parameters, self._block_ticks)
        # While the instrument before is there.
        self._leave()
        self._parameters = parameters
        self._context.instrument = self.blocks.instrument = instrument
        self.pacing = self._choose_pacing(self._context)
        self._begin_again()

    def tell_why_waiting(self, detail: str) -> None:
        """Say what a run that has not started waits for, where that needs a word; empty: nothing special."""
        if self.state == RunState.WAITING:
            self.life.tell(detail)

    def flush(self) -> None:
        """Hand on all that was recorded up to now."""
        self.blocks.flush()

    def adapt(self, parameters: SimParameters) -> None:
        """Follow a change of `run.real_time_factor` or of a timeout, or other faults from the next tick on.

        Raises
        ------
        ParameterError
            If the instrument takes no other faults.
        """
        if parameters.fault != self.instrument.parameters.fault:
            self.instrument.set_faults(parameters)
        self._parameters = parameters
        self.pacing.adapt(parameters)

    def warm_up(self) -> None:
        """Compile or load the kernels by one tick, before the run has started."""
        self.instrument.tick(self.instrument.drive)
        self.blocks.warm_up()
        self.instrument.reset()
        self.blocks.reset()
