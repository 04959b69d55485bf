"""The loop of every run: makes the ticks and handles the events after them, for every pacing."""

import math
from collections.abc import Callable
from typing import Any, Protocol

from ..core.errors import DivergenceError, DriveError, PartError, VerbError
from ..core.run_id import next_run_id
from ..instrument import Block, Instrument
from ..instrument.block import Layouts
from ..parameters import InstrumentParameters
from .blocks import Blocks
from .context import RunContext
from .counts import Counts
from .link import Link, Listeners
from .pacing import Pacing
from .state import EVENTS, OVER, TICKING, Cause, Life, RunState
from .timing import Stopwatch, VirtualClock

_TAKEN_AWAY = (RunState.WITHDRAWN, RunState.RETRACTED)
"""The instrument has taken z away: what is being done cannot go on."""


class VerbOperator(Protocol):
    """Does what an instrument is asked for, order by order: `afm_model.microscope.operator.Operator` is one."""

    @property
    def busy(self) -> bool:
        """Whether something is being done."""

    def begin(self, verb: Any) -> None:
        """Begin something; raises VerbError."""

    def look(self) -> None:
        """Go on if the order in force is done."""

    def take(self, block: Block) -> None:
        """A recorded block, each in order."""

    def cancel(self, reason: str) -> None:
        """Bring what is being done to a safe end."""

    def withdrawn(self) -> None:
        """Note that the instrument has withdrawn the tip while nothing was being done."""

    def give_up(self, reason: str) -> None:
        """End what is being done here and now: simulated time does not go on."""

    def outcome(self) -> Any:
        """How the last thing that was done has ended."""


class Engine:
    """An instrument that runs.

    Call `step` again and again; it never waits.

    Parameters
    ----------
    parameters : InstrumentParameters
    pacing : callable
        Makes the pacing of a run whose instrument is there.
    total_ticks : int
        Ticks of the whole run; 0: endless.
    link : Link, optional
        To who answers.
    clock : callable, optional
        Steady wall time [s]; any origin.
    listeners : Listeners, optional
    block_ticks : int
        Control ticks in a block.
    operate : callable, optional
        Makes who orders verbs of an instrument that is at its start. Simulated time then stands still while none is
        done, unless it goes by the clock.
    in_pieces, hashed, sampled, layouts
        As of `Blocks` and `Instrument`.

    Raises
    ------
    ParameterError
        As `Instrument` does.
    """

    def __init__(
        self,
        parameters: InstrumentParameters,
        pacing: Callable[[RunContext], Pacing],
        total_ticks: int = 0,
        *,
        link: Link | None = None,
        clock: Callable[[], float] | None = None,
        listeners: Listeners | None = None,
        block_ticks: int = 500,
        operate: Callable[[Instrument], VerbOperator] | None = None,
        in_pieces: bool = False,
        hashed: bool = True,
        sampled: bool = True,
        layouts: Layouts | None = None,
    ) -> None:
        self.run_id = next_run_id()
        """Name of the present run: another one after each reset."""
        self.error: Exception | None = None
        """What has ended the run."""
        self.held = False
        """Whether a run that has not started does not start."""
        self.ticking = False
        """Whether the run is going on, or waits for a drive only."""
        self._stop_at: int | None = None  # tick at which the run pauses by itself
        self._listeners = listeners or Listeners()
        self._operate, self._total_ticks = operate, total_ticks
        self.link, self.clock = link or Link(), clock or VirtualClock()
        self.watch = Stopwatch(self.clock)
        self.life = Life(self._on_change)
        instrument = Instrument(parameters, block_ticks, hashed=hashed, sampled=sampled, layouts=layouts)
        heard = operate is not None or self._listeners.block is not None
        self.blocks = Blocks(instrument, self._on_block if heard else None, in_pieces=in_pieces)
        self._context = RunContext(instrument, self.link, self.clock, self.blocks, self.life)
        # An `VerbOperator`, of any further type.
        self.operator: Any = operate(instrument) if operate is not None else None
        """Executes verbs; a new one after a reset. None: there are no verbs."""
        self.pacing = pacing(self._context)
        self._find_look()
        self.link.name_run(self.run_id)

    @property
    def state(self) -> RunState:
        """State of the run."""
        return self.life.state

    @property
    def instrument(self) -> Instrument:
        """To read from; it is ticked here. Another one after `exchange`."""
        return self._context.instrument

    @property
    def counts(self) -> Counts:
        """What has been counted since the last reset."""
        return self._context.counts

    @property
    def phase(self) -> RunState:
        """State that says which of controller and limits has the drive."""
        return self._context.phase

    @property
    def reason(self) -> str:
        """Why the controller's drive is not in force, in two words; empty if it is."""
        return self._context.reason

    @property
    def idle(self) -> bool:
        """Whether simulated time stands still until something is ordered."""
        return self.operator is not None and not self.pacing.by_clock and not self.operator.busy

    def step(self, made: Callable[[], bool] | None = None) -> bool:
        """Make the ticks that are due; True if something was done.

        `made` concludes ticks of a law that are made already, `wanted` at most, as `Instrument.close_loop` does.
        """
        if not self.ticking:
            return self.life.state == RunState.WAITING and self._start_when_ready()
        if self.operator is not None and self.idle:
            self.watch.stop()
            return False
        pacing, context = self.pacing, self._context
        instrument = context.instrument
        try:
            ticks = pacing.next()
            if not ticks:
                return ticks is not None
            if ticks < 0:
                stopped: bool | None = True
            elif pacing.law is None:
                self.blocks.round_trips.append(pacing.round_trip)
                stopped = instrument.tick(pacing.drive, pacing.sequence)
            elif made is not None:
                stopped = made()
            else:
                stopped = instrument.close_loop(pacing.law, min(ticks, self.wanted))
        except DriveError as error:
            context.refuse(str(error), instrument.ticks, pacing.answering)
            self.fail(context.refusal, DriveError(context.refusal))
            return True
        except (DivergenceError, PartError) as error:
            self.fail(pacing.explain(error), error)
            return True
        if stopped or instrument.ticks >= context.look_at:
            self._look()
        else:
            pacing.made()
        return True

    @property
    def wanted(self) -> int:
        """Ticks up to the next after which there is something to look at."""
        return self._context.look_at - self.instrument.ticks

    def stop_at(self, tick: int | None) -> None:
        """Pause by itself after this tick; None: do not."""
        self._stop_at = tick
        self._find_look()

    @property
    def stepping(self) -> bool:
        """Whether it is on the way to such a tick."""
        return self._stop_at is not None

    @property
    def steps_left(self) -> int:
        """Ticks up to there."""
        return 0 if self._stop_at is None else self._stop_at - self.instrument.ticks

    def _look(self) -> None:
        """What came of the ticks: a full block, a limit, an order that is done, the end."""
        instrument = self.instrument
        if instrument.block_full:
            self.blocks.end_block()
        self.follow_limits()
        if self.operator is not None:
            self._look_at_orders(self.operator)
        if instrument.ticks == self._total_ticks:
            self._finish()
            return
        self.pacing.made()
        if instrument.ticks == self._stop_at:
            self._stop_at = None
            self.life.go(Cause.PAUSE)
        self._find_look()

    def _find_look(self) -> None:
        """Find the next tick after which there is something to look at, whatever comes of those before."""
        ends = (self.instrument.block_end, self._total_ticks or math.inf, self._stop_at or math.inf)
        self._context.look_at = int(min(ends))

    def follow_limits(self) -> None:
        """Report who has the instrument's drive, if that has changed."""
        guard, life, phase = self.instrument.guard, self.life, self.phase
        if phase == life.state or guard.event not in EVENTS:
            return
        cause = EVENTS[guard.event]
        if phase == RunState.WITHDRAWN:
            life.go(cause, f"{guard.clause(guard.event)}: the sample is withdrawn")
        elif phase == RunState.APPROACHING:
            life.go(cause, f"the sample is brought back to the tip (after: {self.reason})")
        else:
            life.go(cause, "the tip is withdrawn" if cause == Cause.RESUME else "")
            if cause == Cause.RESUME:
                life.go(Cause.APPROACHED)

    def _look_at_orders(self, operator: VerbOperator) -> None:
        """Go on with the next order if one is done: between two ticks."""
        if operator.busy and self.instrument.orders.done:
            # What is next may depend on what was measured up to here.
            self.blocks.flush()
            operator.look()
            if not operator.busy:
                self._listeners.verb_over(operator.outcome())

    def begin(self, verb: Any) -> None:
        """Begin a verb between two ticks; `Listeners.verb_over` is called at its end.

        Raises
        ------
        VerbError
            If it cannot be begun.
        """
        state, operator = self.state, self.operator
        if operator is None:
            raise VerbError("this instrument takes no orders: start it with reference.kind = verbs")
        if state in OVER:
            raise VerbError(f"the run is {state.title}: call reset first")
        if state in (*_TAKEN_AWAY, RunState.APPROACHING):
            raise VerbError(f"the run is {state.title}: {self.life.detail}")
        operator.begin(verb)
        if not operator.busy:
            # A verb without duration, such as a move to the present place.
            self._listeners.verb_over(operator.outcome())
        if self.ticking and not self.pacing.by_clock:
            self.pacing.resume()
            self.watch.start()

    def bring_back(self) -> str:
        """Bring a withdrawn sample back to the tip; why not, or an empty string: not while a limit is still passed."""
        problem = self.instrument.guard.bring_back()
        self.follow_limits()
        return problem

    def fail(self, sentence: str, error: Exception | None = None) -> None:
        """End a run that has started: what it brings cannot be trusted any more."""
        if self.state == RunState.WAITING or self.state in OVER:
            return
        self.error = error
        self.blocks.flush()
        self.life.go(Cause.ERROR, sentence)

    def reset(self) -> None:
        """Go back to the start: same state, same random numbers. Whatever was recorded is handed on before."""
        self._leave()
        self._begin_again()

    def _leave(self) -> None:
        """Hand on what the present run has brought, and end it."""
        self.blocks.flush()
        self._give_up("the run was reset")
        self._listeners.left()

    def _begin_again(self) -> None:
        """Begin another run, from the start of the instrument."""
        self.instrument.reset()
        self.blocks.reset()
        if self._operate is not None:
            self.operator = self._operate(self.instrument)
        context = self._context
        context.counts, context.refusal, context.unreadable, self.error = Counts(), "", "", None
        self._stop_at = None
        self._find_look()
        self.watch = Stopwatch(self.clock)
        self.run_id = next_run_id()
        self.link.name_run(self.run_id)
        self.life.go(Cause.RESET)

    def _start_when_ready(self) -> bool:
        if self.held or not self.link.ready():
            return False
        if reason := self.link.objection():
            self.life.tell(reason)
            return False
        self.life.go(Cause.START)
        self.pacing.start()
        return True

    def _finish(self) -> None:
        if reason := self.link.objection():
            self.fail(reason)
            return
        self.watch.stop()
        self.blocks.flush()
        self._listeners.ended()
        self.life.go(Cause.END)

    def _on_change(self) -> None:
        state = self.life.state
        self.ticking = state in TICKING
        if self.ticking:
            self.watch.start()
        else:
            self.watch.stop()
        if state in OVER:
            self._stop_at = None
            self._give_up(self.life.detail or f"the run is {state.title}")
        elif state in _TAKEN_AWAY and self.operator is not None:
            if self.operator.busy:
                self.operator.cancel(f"stopped ({self.life.detail})")
            elif state == RunState.WITHDRAWN:
                self.operator.withdrawn()
        self._listeners.changed()

    def _give_up(self, why: str) -> None:
        """End what is being done: the run cannot go on with it."""
        if self.operator is not None and self.operator.busy:
            self.operator.give_up(why)
            self._listeners.verb_over(self.operator.outcome())

    def _on_block(self, block: Block, round_trips: Any) -> None:
        if self.operator is not None:
            self.operator.take(block)
        if self._listeners.block is not None:
            self._listeners.block(block, round_trips)
