"""Wait for the end of a run, for sessions and launches."""

import time
from collections.abc import Callable

from afm_msgs.msg import InstrumentStatus, RecorderStatus

from .monitor import Monitor

STALL_TIMEOUT = 10.0
"""Wall time for which a controller that has been reported may stay silent [s]."""
_RECORDER_TIMEOUT = 30.0
"""Wall time without anything new at the recorder after which it is no longer waited for [s]."""


_SAFE = (
    InstrumentStatus.STALLED,
    InstrumentStatus.RETRACTED,
    InstrumentStatus.HELD,
    InstrumentStatus.WITHDRAWN,
)
"""States that a run leaves only after an action from outside."""


class RunFailure(RuntimeError):
    """Why a run did not come to its end, in one sentence."""


def check_score(status: InstrumentStatus) -> None:
    """Raise RunError if there is nothing to score: a controller of which no drive was ever applied."""
    if status.mode == InstrumentStatus.REALTIME and status.drives_lost >= status.ticks:
        sender = " and ".join(status.controllers) or "the controller"
        raise RunFailure(
            f"no drive of {sender} was ever applied in {status.ticks} ticks; "
            f"{status.drives_refused} were refused as NaN or infinite"
        )


class Follower:
    """Follows one run.

    Parameters
    ----------
    monitor : Monitor
    stall_timeout : float
        Wall time for which a controller may stay silent after it was reported [s].
    """

    def __init__(self, monitor: Monitor, stall_timeout: float = STALL_TIMEOUT) -> None:
        self._monitor = monitor
        self._stall_timeout = stall_timeout
        self._silent_since: float | None = None

    def finished(self) -> bool:
        """Whether the run is finished and its score has arrived; call it repeatedly.

        Raises
        ------
        RunError
            If it has ended in a fault, or has been in a safe state for too long, since a session does not resume it.
        """
        status = self._monitor.status
        if status is None:
            return False
        if status.state == InstrumentStatus.FAULT:
            raise RunFailure(status.detail)
        # A controller that was only slow answers later; the score contains it.
        now = time.monotonic()
        if status.state not in _SAFE:
            self._silent_since = None
        elif self._silent_since is None:
            self._silent_since = now
        elif now >= self._silent_since + self._stall_timeout:
            detail = status.detail.removesuffix("; still waiting")
            if status.state in (InstrumentStatus.HELD, InstrumentStatus.WITHDRAWN):
                raise RunFailure(f"{detail}; that was {self._stall_timeout:g} s ago")
            raise RunFailure(f"{detail}, and not for {self._stall_timeout:g} s after that")
        return bool(status.state == InstrumentStatus.FINISHED) and self._monitor.score is not None

    def wait_until_recorded(self, check: Callable[[], bool]) -> None:
        """Wait until the recorder has received all that was published, or receives nothing more.

        Parameters
        ----------
        check : callable
            Called again and again; it raises to end the wait, or returns False.
        """
        before = -1

        def going_on() -> bool:
            return check() or self._recorded() or self._arrived() > before

        while not self._recorded() and self._monitor.spin_until(going_on, _RECORDER_TIMEOUT):
            before = self._arrived()

    def _arrived(self) -> int:
        _, recorder = self._known()
        return int(recorder.ticks + recorder.samples)

    def _recorded(self) -> bool:
        status, recorder = self._known()
        return bool(recorder.ticks >= status.ticks and recorder.samples >= status.samples)

    def missing_in_recording(self) -> str | None:
        """A message about data that has not arrived at the recorder; None if all has."""
        status, recorder = self._known()
        if recorder.ticks == status.ticks and recorder.samples == status.samples:
            return None
        return (
            f"the recording is incomplete: {recorder.ticks} of {status.ticks} ticks and {recorder.samples} of "
            f"{status.samples} samples arrived"
        )

    def _known(self) -> tuple[InstrumentStatus, RecorderStatus]:
        return self._monitor.status or InstrumentStatus(), self._monitor.recorder or RecorderStatus()
