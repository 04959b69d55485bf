"""Ctrl-C between two steps, not within one: an instrument is never left in the middle of a tick."""

import signal
import threading
from types import FrameType, TracebackType
from typing import Any

from .results import Outcome


class Interrupted(KeyboardInterrupt):
    """Ctrl-C was pressed; the tip is withdrawn, and `outcome` has what was measured."""

    def __init__(self, outcome: Outcome) -> None:
        super().__init__(outcome.message)
        self.outcome = outcome


class Interrupts:
    """Keeps Ctrl-C back as long as it is entered.

    In another thread than the main one nothing is kept back: it gets no signals.
    """

    def __init__(self) -> None:
        self.there = False
        """Whether somebody has pressed it."""
        self.times = 0
        """How often."""
        self._before: Any = None

    def __enter__(self) -> "Interrupts":
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._note)
        return self

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.there = True
        self.times += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
