"""The life of a run: when it starts, goes on, stops and ends. No ROS, no sleeping, no clock of its own."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import VerbError
from ..fault import acted, active
from ..instrument import Block, Instrument
from ..parameters import SimParameters
from .attendance import Attendance, Attending
from .counts import Counts, Snapshot
from .course import Course, Pacing
from .law_inside import LawInside
from .link import Link
from .listeners import Listeners
from .lockstep import Lockstep
from .realtime import Realtime
from .state import BACK, OVER, TICKING, Cause, Life, State
from .ticker import Ticker
from .timing import Delays, Stopwatch


class Run:
    """One instrument, run in lockstep or in real time.

    Call `step` again and again; it never waits. Whoever calls it may wait in between: until `deadline`, or where that
    is None, until a drive arrives. Only the methods of this class change the state.

    Parameters
    ----------
    parameters : SimParameters
    link : Link
    clock : callable
        Steady wall time [s]; any origin.
    listeners : Listeners
    block_ticks : int
        Control ticks in a block.
    attend : Attending, optional
        Makes who orders verbs of the instrument. In lockstep simulated time then stands still while none is done.
    in_pieces : bool
        What a block takes besides its ticks is left to `ticker.do_one`; False: it is done with the last of them.

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
        attend: Attending | None = None,
        *,
        in_pieces: bool = False,
    ) -> None:
        self._listeners = listeners or Listeners()
        self._life = Life(self._on_change)
        self._watch = Stopwatch(clock)
        self._held = parameters.run.start_paused
        self.instrument = Instrument(parameters, block_ticks)
        """To read from; it is ticked here."""
        self.ticker = Ticker(
            self.instrument,
            block_ticks,
            parameters.total_ticks,
            self._on_block,
            in_pieces=in_pieces,
            on_stop=self._on_stop,
        )
        """Ends blocks, and hands them on."""
        self._course = Course(
            parameters=parameters,
            instrument=self.instrument,
            ticker=self.ticker,
            link=link,
            clock=clock,
            life=self._life,
            counts=Counts(),
            finish=self._finish,
            fail=self._fail,
        )
        self._record_anyway = False
        self._attendance = Attendance(self._course, attend, self._listeners.verb_over) if attend is not None else None
        self._pacing = self._choose_pacing()
        self._period_ns = parameters.plant.control_period * 1e9
        self.step: Callable[[], bool] = self._start_when_ready
        """One look at the link or the clock; True if something was done. Another function in another state: after
        `changed` take it anew. At this rate a function that only chooses would be felt."""

    @property
    def state(self) -> State:
        """Where the run stands."""
        return self._life.state

    @property
    def deadline(self) -> float | None:
        """When the next tick is due by the clock [s]; None: when a drive arrives, or not at all (see `ticking`)."""
        return self._pacing.deadline if self.ticking else None

    @property
    def ticking(self) -> bool:
        """Whether the run goes on, or would with the next drive."""
        return self._life.state in TICKING

    @property
    def stamp_ns(self) -> int:
        """Simulated time of the next control tick [ns]."""
        return round(self.instrument.ticks * self._period_ns)

    def snapshot(self) -> Snapshot:
        """The run as it is now."""
        course, instrument = self._course, self.instrument
        run = course.parameters.run
        return Snapshot(
            state=self._life.state,
            detail=self._life.detail,
            ticks=instrument.ticks,
            time=instrument.time,
            stamp_ns=self.stamp_ns,
            samples=instrument.ticks * instrument.samples_per_tick,
            elapsed=self._watch.elapsed,
            wanted_factor=run.real_time_factor if run.mode == "realtime" else None,
            in_contact=instrument.in_contact,
            counts=replace(
                course.counts,
                drives_clipped=instrument.drives_clipped,
                drives_steep=instrument.drives_steep,
                **instrument.guard.counts(),
            ),
            refusal=course.refusal,
            reason=course.reason,
            unreadable=course.unreadable,
            faults=", ".join(active(instrument.parameters, instrument.ticks)) if instrument.has_faults else "",
            faults_acted=", ".join(acted(instrument.parameters, instrument.ticks)) if instrument.has_faults else "",
        )

    def delays(self) -> Delays:
        """Wall times of the ticks handed on up to now; some ten microseconds."""
        return self._course.ticker.delays()

    @property
    def attendant(self) -> Any:
        """Who orders verbs; another one after a reset. None: nobody does."""
        return None if self._attendance is None else self._attendance.attendant

    # What somebody outside may ask for.

    def begin(self, verb: Any) -> None:
        """Begin a verb between two ticks; `Listeners.verb_over` tells its end.

        Raises
        ------
        VerbError
            If it cannot be begun.
        """
        if self._attendance is None:
            raise VerbError("this instrument takes no orders: start it with reference.kind = verbs")
        self._attendance.refuse(self.state, self._life.detail)
        self._attendance.begin(verb)
        if self.ticking and self._course.parameters.run.mode == "lockstep":
            self._pacing.resume()
            self._watch.start()

    def play(self) -> str:
        """Start as soon as everybody is there, or go on after a pause; why not, or an empty string."""
        if self._course.stop_at is not None:
            self._course.stop_at = None
            self._on_change()
        return self._go_on()

    def step_by(self, ticks: int) -> str:
        """Make so many ticks and pause again; why not, or an empty string.

        A run that has been told not to start before `play` starts with them.
        """
        if ticks < 1:
            return f"{ticks} ticks are not allowed: it must be 1 at least"
        if self.state != State.PAUSED and not (self.state == State.WAITING and self._held):
            return f"the run is {self.state.title}: it must be paused"
        if self._course.idle():
            return "no verb is being done: simulated time stands still until one is"
        self._course.stop_at = self.instrument.ticks + ticks
        return self._go_on()

    @property
    def steps_left(self) -> int:
        """Ticks that `step_by` has asked for and that are not made yet."""
        return 0 if self._course.stop_at is None else self._course.stop_at - self.instrument.ticks

    @property
    def stepping(self) -> bool:
        """Whether there are any."""
        return self._course.stop_at is not None

    @property
    def waits_for_play(self) -> bool:
        """Whether a run that has not started does not start before `play`."""
        return self._held

    def _go_on(self) -> str:
        self._held = False
        if self.state == State.PAUSED:
            self._course.go_on(Cause.PLAY)
            self._pacing.resume()
        return "the run is over: call reset first" if self.state in OVER else ""

    def pause(self) -> str:
        """Stop between two ticks, or do not start before `play`; why not, or an empty string."""
        waited, self._course.stop_at = self.stepping, None
        if self.state == State.WAITING:
            self._held = True
            if waited:
                self._on_change()
        elif self.ticking or self.state == State.HELD:
            self._life.go(Cause.PAUSE)
        return "the run is over: there is nothing to pause" if self.state in OVER else ""

    def resume(self) -> str:
        """Bring a withdrawn sample back to the tip, or go on without a recording; why not, or an empty string."""
        if self.state == State.WITHDRAWN:
            if problem := self.instrument.guard.bring_back():
                return problem
            self._course.look_at_limits()
            return ""
        if self.state == State.HELD:
            self._record_anyway = True
            self._leave_hold()
            return ""
        if self.state == State.PAUSED and self._course.phase in BACK:
            return "the run is paused: call play first"
        return f"the run is {self.state.title}: there is nothing to resume"

    def tell_recorder(self, problem: str) -> None:
        """Say why the recorder cannot write its file; empty: it can."""
        if not problem:
            self._record_anyway = False
            if self.state == State.HELD:
                self._leave_hold()
        elif self.ticking and self.state != State.STALLED and self._course.parameters.safety.unrecorded:
            if not self._record_anyway:
                self._life.go(Cause.UNRECORDED, f"{problem}: the run is held (safety.unrecorded)")

    def _leave_hold(self) -> None:
        self._course.go_on(Cause.RECORDED)
        self._pacing.resume()

    def reset(self) -> None:
        """Go back to the start: same state, same random numbers. Whatever was recorded is handed on before.

        A run that was paused waits for `play`.
        """
        course = self._course
        course.ticker.flush()
        course.ticker.reset()
        if self._attendance is not None:
            self._attendance.reset()
        course.counts, course.refusal, course.unreadable = Counts(), "", ""
        # A run that was stepped was paused between the steps.
        paused = self.state == State.PAUSED or self._course.stop_at is not None
        self._held = course.parameters.run.start_paused or paused
        self._course.stop_at = None
        self._record_anyway = False
        self._watch = Stopwatch(course.clock)
        self._life.go(Cause.RESET)

    def exchange(self, parameters: SimParameters) -> None:
        """Go on with another instrument, from its start: another sample, another cantilever.

        Raises
        ------
        ParameterError
            If there can be no such instrument; nothing changes then.
        """
        course = self._course
        # What was recorded of the one before is handed on while it is there.
        course.ticker.flush()
        self.instrument.exchange(parameters)
        course.parameters = parameters
        self._pacing = self._choose_pacing()
        self.reset()

    def tell_why_waiting(self, detail: str) -> None:
        """Say what a run that has not started waits for, where that needs a word; empty: nothing special."""
        if self.state == State.WAITING:
            self._life.tell(detail)

    def fail(self, sentence: str) -> None:
        """End a run that has started, because what it brings cannot be trusted any more."""
        if self.state != State.WAITING and self.state not in OVER:
            self._fail(sentence)

    def flush(self) -> None:
        """Hand on all that was recorded up to now."""
        self._course.ticker.flush()

    def adapt(self, parameters: SimParameters) -> None:
        """Follow a change of `run.real_time_factor` or of a timeout, or other faults from the next tick on.

        Raises
        ------
        ParameterError
            If the instrument takes no other faults.
        """
        if parameters.fault != self.instrument.parameters.fault:
            self.instrument.set_faults(parameters)
        self._course.parameters = parameters
        self._pacing.adapt()

    def warm_up(self) -> None:
        """Compile or load the kernels by one tick, before the run has started."""
        self.instrument.tick(self.instrument.drive)
        self.ticker.warm_up()
        self.ticker.reset()

    def _choose_pacing(self) -> Pacing:
        parameters = self._course.parameters
        if parameters.controller_inside is not None:
            return LawInside(self._course)
        return Lockstep(self._course) if parameters.run.mode == "lockstep" else Realtime(self._course)

    # The life.

    def _start_when_ready(self) -> bool:
        link = self._course.link
        if self._held or not link.ready():
            return False
        if reason := link.objection():
            self._life.tell(reason)
            return False
        self._life.go(Cause.START)
        self._pacing.start()
        return True

    def _finish(self) -> None:
        if reason := self._course.link.objection():
            self._fail(reason)
            return
        self._watch.stop()
        self._course.ticker.flush()
        self._listeners.ended()
        self._life.go(Cause.END)

    def _fail(self, sentence: str) -> None:
        self._course.ticker.flush()
        self._life.go(Cause.ERROR, sentence)

    def _on_change(self) -> None:
        state = self._life.state
        if state in TICKING:
            self._watch.start()
            step = self._pacing.step if self._attendance is None else self._step_attended
            self.step = step if self._course.stop_at is None else self._step_to_the_stop
        else:
            self._watch.stop()
            self.step = self._start_when_ready if state == State.WAITING else self._rest
        if state in OVER:
            self._course.stop_at = None
        if self._attendance is not None:
            self._attendance.state_changed(state, self._life.detail)
        self._listeners.changed()

    def _on_stop(self) -> None:
        self._course.look_at_limits()
        if self._attendance is not None:
            self._attendance.look()

    def _on_block(self, block: Block, round_trips: NDArray[np.float32]) -> None:
        if self._attendance is not None:
            self._attendance.attendant.take(block)
        self._listeners.block(block, round_trips)

    def _step_attended(self) -> bool:
        """A step while something is being done; else time stands still, in lockstep."""
        if self._course.idle():
            self._watch.stop()
            return False
        return self._pacing.step()

    def _step_to_the_stop(self) -> bool:
        """One of the steps asked for; behind the last one the run is paused."""
        done = self._pacing.step() if self._attendance is None else self._step_attended()
        if self.ticking and self.steps_left == 0 and self._course.stop_at is not None:
            self._course.stop_at = None
            self._life.go(Cause.PAUSE)
        return done

    def _rest(self) -> bool:
        """Nothing to do."""
        return False
