"""The states of a run, and what leads from one to the next."""

from collections.abc import Callable
from enum import Enum, IntEnum


class RunError(RuntimeError):
    """A change of state that there is not."""


class State(IntEnum):
    """Where a run stands. The numbers are those of afm_msgs/InstrumentStatus."""

    WAITING = 0
    RUNNING = 1
    PAUSED = 2
    STALLED = 3
    RETRACTED = 4
    FINISHED = 5
    FAULT = 6

    @property
    def title(self) -> str:
        """The state in a word, for a person."""
        return self.name.lower()


class Cause(Enum):
    """Why a state is left. The text stands beside the arrow in docs/topics.md."""

    START = "everybody is there"
    UNANSWERED = "no answer within run.lockstep_timeout"
    SILENT = "no drive for run.watchdog_timeout"
    ANSWERED = "a drive arrives"
    PAUSE = "pause"
    PLAY = "play"
    END = "the duration is over"
    ERROR = "drive refused in lockstep, motion diverged, part broken, or second simulator"
    RESET = "reset"


TICKING = frozenset({State.RUNNING, State.STALLED, State.RETRACTED})
"""The run goes on, or would with the next drive."""
OVER = frozenset({State.FINISHED, State.FAULT})
"""Nothing happens any more until a reset."""

TRANSITIONS: dict[tuple[State, Cause], State] = {
    (State.WAITING, Cause.START): State.RUNNING,
    (State.RUNNING, Cause.UNANSWERED): State.STALLED,
    (State.RUNNING, Cause.SILENT): State.RETRACTED,
    (State.STALLED, Cause.ANSWERED): State.RUNNING,
    (State.RETRACTED, Cause.ANSWERED): State.RUNNING,
    (State.RUNNING, Cause.PAUSE): State.PAUSED,
    (State.STALLED, Cause.PAUSE): State.PAUSED,
    (State.RETRACTED, Cause.PAUSE): State.PAUSED,
    (State.PAUSED, Cause.PLAY): State.RUNNING,
    (State.RUNNING, Cause.END): State.FINISHED,
    (State.RETRACTED, Cause.END): State.FINISHED,
    (State.RUNNING, Cause.ERROR): State.FAULT,
    (State.STALLED, Cause.ERROR): State.FAULT,
    (State.RETRACTED, Cause.ERROR): State.FAULT,
    (State.PAUSED, Cause.ERROR): State.FAULT,
    **{(state, Cause.RESET): State.WAITING for state in State},
}
"""Every transition there is."""


class Life:
    """The state of one run, and the only place where it changes.

    Parameters
    ----------
    changed : callable
        Called after every change of state or detail.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        self._state = State.WAITING
        self._detail = ""
        self._changed = changed

    @property
    def state(self) -> State:
        """Where the run stands."""
        return self._state

    @property
    def detail(self) -> str:
        """One sentence for a person about this state; empty if there is nothing to tell."""
        return self._detail

    def go(self, cause: Cause, detail: str = "") -> None:
        """Change the state.

        Raises
        ------
        RunError
            If this cause leads nowhere from here.
        """
        target = TRANSITIONS.get((self._state, cause))
        if target is None:
            raise RunError(f"a run that is {self._state.title} cannot change by {cause.name} ({cause.value})")
        self._state, self._detail = target, detail
        self._changed()

    def tell(self, detail: str) -> None:
        """Say something else about the same state."""
        if detail != self._detail:
            self._detail = detail
            self._changed()
