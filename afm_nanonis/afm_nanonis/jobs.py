"""Do what takes time, one thing after the other, in a separate thread, so that commands are answered meanwhile."""

import queue
import threading
import time
from collections.abc import Callable

from afm_model.core.errors import VerbError

from .codec import ProtocolError

APPROACH, MOVE, Z, WITHDRAW, SCAN, SPECTRUM = (
    "an approach",
    "a move",
    "a motion of Z",
    "a withdrawal",
    "a scan",
    "a spectrum",
)
PASSING = (APPROACH, MOVE, Z, WITHDRAW)
"""Another one waits for the end of these; a scan or a spectrum must be stopped first."""
_AGAIN = 0.05
"""Wall time between two requests to stop what is just being begun [s]."""
_PATIENCE, _PASSING = 60.0, 20.0
"""Wall time for which a stop waits for the end of what was stopped, and a start for that of what passes [s]."""
SOON = 0.1
"""Wall time after which a stop is answered that clients do not wait for longer: some of them wait 0.25 s [s]."""
Work = Callable[[], object]


class Jobs:
    """Does one job at a time.

    Parameters
    ----------
    stop : callable
        Ends the verb that is being done, with the tip where it is.
    """

    def __init__(self, stop: Callable[[], object]) -> None:
        self._stop = stop
        self._changed = threading.Condition()
        self.doing = ""
        """What is being done, one of the above; empty: nothing."""
        self.stopped = False
        """Whether what is being done was stopped: it is to begin nothing more."""
        self.error = ""
        """Why the job before has ended early, a sentence; empty: it has not."""
        self._begun = self._done = 0
        self._work: queue.SimpleQueue[Work | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="afm_nanonis_jobs", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while (work := self._work.get()) is not None:
            error = ""
            try:
                work()
            except VerbError as refused:
                error = str(refused)
            except Exception as failed:
                # Whatever a job raises, the next one is done.
                error = f"{type(failed).__name__}: {failed}"
            with self._changed:
                self.error, self.doing = error, ""
                self._done += 1
                self._changed.notify_all()

    def start(self, what: str, prepare: Callable[[], Work]) -> int:
        """Begin a job; its number, for `wait`.

        Parameters
        ----------
        what : str
        prepare : callable
            Called once nothing else is being done; makes what is to be done, and may refuse it.

        Raises
        ------
        ProtocolError
            If a scan or a spectrum is running, or `prepare` raises it.
        """
        with self._changed:
            limit = time.monotonic() + _PASSING
            while self.doing:
                if not (self.stopped or self.doing in PASSING) or time.monotonic() > limit:
                    raise ProtocolError(f"{self.doing} is running: stop it first")
                if self.stopped:
                    self._stop()
                self._changed.wait(_AGAIN)
            work = prepare()
            self.doing, self.stopped = what, False
            self._begun += 1
            self._work.put(work)
            return self._begun

    def wait(self, number: int, timeout: float | None = None) -> bool:
        """Wait for the end of a job; False if it has not ended within `timeout` of wall time [s]."""
        with self._changed:
            return self._changed.wait_for(lambda: self._done >= number, timeout)

    def finish(self, number: int) -> None:
        """Wait for the end of a job; ProtocolError if it has failed."""
        self.wait(number)
        if self.error:
            raise ProtocolError(self.error)

    def stop(self, *kinds: str, soon: bool = False) -> None:
        """End what is being done, if it is of these kinds (none: of any), and wait for its end.

        With `soon` not for longer than `SOON`: it is then ending, and the next start waits for its end.
        """
        with self._changed:
            number, limit = self._begun, time.monotonic() + (SOON if soon else _PATIENCE)
            while self.doing and self._done < number and (not kinds or self.doing in kinds):
                self.stopped = True
                # A verb that has just been begun knows of no stop before.
                self._stop()
                self._changed.wait(_AGAIN)
                if time.monotonic() > limit:
                    if soon:
                        return
                    raise ProtocolError(f"{self.doing} does not end")

    def close(self) -> None:
        """End what is being done, and the thread."""
        self.stop()
        self._work.put(None)
        self._thread.join()
