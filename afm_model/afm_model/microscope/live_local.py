"""A microscope in this process that goes on by the clock, also between two verbs."""

import threading
import time

from ..parameters import ControllerParameters, SimParameters, changed
from ..run.context import RunContext
from ..run.law_inside import LawInside
from ..run.pacing import Pacing
from .local import Local
from .results import MicroscopeState
from .verb import Verb

_IDLE = 0.05
"""Wall time between two looks where nothing is due, and between two looks of who waits for the end of a verb [s]."""
_BREATH = 1e-4
"""Wall time that the run leaves to others between two pieces [s]: a lock that is taken again at once starves them."""


class Live(Local):
    """As `Local`, with a thread that makes the ticks when they are due.

    Simulated time is `run.real_time_factor` times as fast as the clock. Between two verbs the loop follows its
    setpoint, or the tip stays withdrawn. A machine that is too slow leaves periods out: simulated time then goes
    slower, and nothing else changes. Settings and `read_signals` may be used from any thread; one verb is done at a
    time.

    Parameters
    ----------
    parameters : SimParameters
        `run.real_time_factor` of them counts.
    controller : ControllerParameters
        The law that moves x and y.
    """

    def __init__(self, parameters: SimParameters, controller: ControllerParameters) -> None:
        self._lock = self._moved = threading.Condition(threading.RLock())
        self._clock = time.monotonic
        self._running = True
        super().__init__(changed(parameters, {"run.mode": "realtime"}), controller)
        self._thread = threading.Thread(target=self._run, name="afm_live", daemon=True)
        self._thread.start()

    def _pacing(self, context: RunContext) -> Pacing:
        parameters = context.instrument.parameters
        assert isinstance(parameters, SimParameters)
        return LawInside(context, parameters, self._controller)

    def _run(self) -> None:
        while self._running:
            with self._moved:
                # Whatever ends the run is `engine.error`, which `step` raises.
                if self._going.is_set() and self.engine.step():
                    self._moved.notify_all()
                due = self.engine.pacing.deadline if self.engine.ticking and self._going.is_set() else None
            time.sleep(_IDLE if due is None else min(max(due - time.monotonic(), _BREATH), _IDLE))

    @property
    def state(self) -> MicroscopeState:
        """See `Backend`."""
        with self._lock:
            return super().state

    def objection(self, verb: Verb) -> str:
        """See `Backend`."""
        with self._lock:
            return super().objection(verb)

    def step(self) -> None:
        """Wait until the run has gone on, for some time at most."""
        with self._moved:
            if self.engine.error is None and self.operator.busy:
                self._moved.wait(_IDLE)
            if self.engine.error is not None:
                raise self.engine.error

    def close(self) -> None:
        """See `Backend`; then time stands still."""
        if not self._running:
            return
        try:
            super().close()
        finally:
            self._running = False
            self._thread.join()
