"""Who orders verbs of a run: told every block, and asked to look whenever an order is done."""

from collections.abc import Callable
from typing import Any, Protocol

from ..core.errors import VerbError
from ..instrument import Block, Instrument
from .course import Course
from .state import OVER, State

_STOPPED = (State.WITHDRAWN, State.RETRACTED)
"""The instrument has taken z away: what is being done cannot go on."""


class Attendant(Protocol):
    """Does what an instrument is asked for, order by order: `afm_model.microscope.operator.Operator` is one."""

    @property
    def busy(self) -> bool:
        """Whether something is being done."""
        ...

    def begin(self, verb: Any) -> None:
        """Begin something; raises VerbError."""
        ...

    def look(self) -> None:
        """Go on if the order in force is done."""
        ...

    def take(self, block: Block) -> None:
        """A recorded block, each in order."""
        ...

    def cancel(self, reason: str) -> None:
        """Bring what is being done to a safe end."""
        ...

    def give_up(self, reason: str) -> None:
        """End what is being done here and now: simulated time does not go on."""
        ...

    def outcome(self) -> Any:
        """How the last thing that was done has ended."""
        ...


Attending = Callable[[Instrument], Attendant]
"""Makes the attendant of an instrument that is at its start."""


class Attendance:
    """An attendant at a run.

    Parameters
    ----------
    course : Course
    make : Attending
    over : callable
        over(outcome): what was being done has come to its end.
    """

    def __init__(self, course: Course, make: Attending, over: Callable[[Any], None]) -> None:
        self._course, self._make, self._over = course, make, over
        self.attendant = make(course.instrument)
        """It is another one after a reset."""
        # In real time simulated time cannot stand still.
        if course.parameters.run.mode == "lockstep":
            course.idle = self._idle

    def _idle(self) -> bool:
        return not self.attendant.busy

    def look(self) -> None:
        """Go on with the next order if one is done: between two ticks."""
        if self._course.instrument.orders.done and self.attendant.busy:
            # What is next may depend on what was measured up to here.
            self._course.ticker.flush()
            self.attendant.look()
            if not self.attendant.busy:
                self._over(self.attendant.outcome())

    def state_changed(self, state: State, detail: str) -> None:
        """End what is being done if the run cannot go on with it."""
        if not self.attendant.busy:
            return
        if state in OVER:
            self._give_up(detail or f"the run is {state.title}")
        elif state in _STOPPED:
            self.attendant.cancel(f"stopped ({detail})")

    def refuse(self, state: State, detail: str) -> None:
        """Raise VerbError if nothing can be begun in this state of the run."""
        if state in OVER:
            raise VerbError(f"the run is {state.title}: call reset first")
        if state in (*_STOPPED, State.APPROACHING):
            raise VerbError(f"the run is {state.title}: {detail}")

    def begin(self, verb: Any) -> None:
        """Begin something; what needs no time, such as a move to where the scanner stands, is over at once."""
        self.attendant.begin(verb)
        if not self.attendant.busy:
            self._over(self.attendant.outcome())

    def reset(self) -> None:
        """Begin anew with the instrument, which has been reset."""
        if self.attendant.busy:
            self._give_up("the run was reset")
        self.attendant = self._make(self._course.instrument)

    def _give_up(self, why: str) -> None:
        self.attendant.give_up(why)
        self._over(self.attendant.outcome())
