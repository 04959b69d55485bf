"""The states of a run, and what leads from one to the next."""

from collections.abc import Callable
from enum import Enum, IntEnum

from ..instrument import limits


class RunError(RuntimeError):
    """A change of state that there is not."""


class RunState(IntEnum):
    """State of a run. The numbers are those of afm_msgs/InstrumentStatus."""

    WAITING = 0
    RUNNING = 1
    PAUSED = 2
    STALLED = 3
    RETRACTED = 4
    FINISHED = 5
    FAULT = 6
    HELD = 7
    WITHDRAWN = 8
    APPROACHING = 9

    @property
    def title(self) -> str:
        """The state in a word, for a person."""
        return self.name.lower()


class Cause(Enum):
    """Why a state is left. The text is that of the arrow in docs/safe_states.md."""

    START = "all nodes are present"
    UNANSWERED = "no answer within run.lockstep_timeout"
    SILENT = "no drive for run.watchdog_timeout"
    ANSWERED = "a drive arrives"
    TRAVEL = "beyond safety.travel_limit"
    FORCE = "beyond safety.force_limit"
    CONTACT_LOST = "no contact for safety.contact_timeout"
    INVALID = "outside the validity of the plant"
    RESUME = "resume, or safety.resume_after is over"
    APPROACHED = "in contact for safety.settle_time"
    NOT_APPROACHED = "beyond safety.approach_force, or no contact within safety.approach_timeout"
    UNRECORDED = "the recorder cannot write"
    RECORDED = "the recorder writes again, or resume"
    BACK_WITHDRAWN = "continues after being withdrawn"
    BACK_APPROACHING = "continues after approaching"
    PAUSE = "pause, or the steps asked for are done"
    PLAY = "play or step"
    END = "the duration is over"
    ERROR = "drive refused in lockstep, motion diverged, part broken, or second simulator"
    RESET = "reset"


SAFE = frozenset({RunState.STALLED, RunState.RETRACTED, RunState.HELD, RunState.WITHDRAWN, RunState.APPROACHING})
"""The controller's drive is not in force, because something has gone wrong: the safe states."""
LIMITS = (Cause.TRAVEL, Cause.FORCE, Cause.CONTACT_LOST, Cause.INVALID)
"""What withdraws the sample."""
TICKING = frozenset({RunState.RUNNING, RunState.STALLED, RunState.RETRACTED, RunState.WITHDRAWN, RunState.APPROACHING})
"""The run goes on, or would with the next drive."""
OVER = frozenset({RunState.FINISHED, RunState.FAULT})
"""Nothing happens any more until a reset."""

_MOVING = (RunState.RUNNING, RunState.RETRACTED, RunState.WITHDRAWN, RunState.APPROACHING)
"""Simulated time goes on."""
_STANDING = (RunState.STALLED, RunState.PAUSED, RunState.HELD)
"""Simulated time stands still, and may go on."""

TRANSITIONS: dict[tuple[RunState, Cause], RunState] = {
    (RunState.WAITING, Cause.START): RunState.RUNNING,
    # No answer: simulated time stands still in lockstep; in realtime the sample is retracted.
    **{(state, Cause.UNANSWERED): RunState.STALLED for state in _MOVING if state != RunState.RETRACTED},
    (RunState.STALLED, Cause.ANSWERED): RunState.RUNNING,
    (RunState.RUNNING, Cause.SILENT): RunState.RETRACTED,
    (RunState.RETRACTED, Cause.ANSWERED): RunState.RUNNING,
    # Limits of the instrument: it takes the drive itself. A sample taken away is out of contact on purpose, and
    # an approach has a force limit of its own.
    **{(RunState.RUNNING, cause): RunState.WITHDRAWN for cause in LIMITS},
    **{(RunState.RETRACTED, cause): RunState.WITHDRAWN for cause in LIMITS if cause != Cause.CONTACT_LOST},
    (RunState.APPROACHING, Cause.TRAVEL): RunState.WITHDRAWN,
    (RunState.APPROACHING, Cause.INVALID): RunState.WITHDRAWN,
    (RunState.WITHDRAWN, Cause.RESUME): RunState.APPROACHING,
    (RunState.APPROACHING, Cause.APPROACHED): RunState.RUNNING,
    (RunState.APPROACHING, Cause.NOT_APPROACHED): RunState.WITHDRAWN,
    # Nothing is recorded: simulated time stands still.
    **{(state, Cause.UNRECORDED): RunState.HELD for state in _MOVING},
    (RunState.HELD, Cause.RECORDED): RunState.RUNNING,
    # Control of the run.
    **{(state, Cause.PAUSE): RunState.PAUSED for state in (*_MOVING, RunState.STALLED, RunState.HELD)},
    (RunState.PAUSED, Cause.PLAY): RunState.RUNNING,
    # A run that stood still returns to its state before: a pause does not bring a withdrawn sample back.
    **{(state, Cause.BACK_WITHDRAWN): RunState.WITHDRAWN for state in _STANDING},
    **{(state, Cause.BACK_APPROACHING): RunState.APPROACHING for state in _STANDING},
    **{(state, Cause.END): RunState.FINISHED for state in _MOVING},
    **{(state, Cause.ERROR): RunState.FAULT for state in (*_MOVING, *_STANDING)},
    **{(state, Cause.RESET): RunState.WAITING for state in RunState},
}
"""Every transition there is. docs/safe_states.md shows them as a picture, made from this table."""

REASONS: dict[RunState | Cause, str] = {
    RunState.STALLED: "silent controller",
    RunState.RETRACTED: "silent controller",
    RunState.HELD: "not recorded",
    Cause.TRAVEL: "travel limit",
    Cause.FORCE: "force limit",
    Cause.CONTACT_LOST: "contact lost",
    Cause.INVALID: "outside validity",
}
"""Reason of a safe state, by the state or by the limit that was exceeded: InstrumentStatus.reason."""


BACK = {
    RunState.WITHDRAWN: (Cause.BACK_WITHDRAWN, "the sample is still withdrawn"),
    RunState.APPROACHING: (Cause.BACK_APPROACHING, "the approach continues"),
}
"""State after a pause while a limit controls the drive."""
EVENTS = {
    limits.TRAVEL: Cause.TRAVEL,
    limits.FORCE: Cause.FORCE,
    limits.INVALID: Cause.INVALID,
    limits.CONTACT_LOST: Cause.CONTACT_LOST,
    limits.TOO_HARD: Cause.NOT_APPROACHED,
    limits.NO_CONTACT: Cause.NOT_APPROACHED,
    limits.RESUMED: Cause.RESUME,
    limits.APPROACHED: Cause.APPROACHED,
}
"""Why the drive has changed hands after a tick, as a cause."""


class Life:
    """The state of one run, and the only place where it changes.

    Parameters
    ----------
    changed : callable
        Called after every change of state or detail.
    """

    def __init__(self, changed: Callable[[], None]) -> None:
        self._state = RunState.WAITING
        self._detail = ""
        self._changed = changed

    @property
    def state(self) -> RunState:
        """State of the run."""
        return self._state

    @property
    def detail(self) -> str:
        """Message about this state; may be empty."""
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
