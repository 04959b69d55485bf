"""Ctrl-C between two steps, not within one: an instrument is never left in the middle of a tick."""

import signal
import threading
from types import FrameType, TracebackType
from typing import Any


class Interrupts:
    """Keeps Ctrl-C back as long as it is entered; KeyboardInterrupt is raised at the end.

    In another thread than the main one nothing is kept back: it gets no signals.
    """

    def __init__(self) -> None:
        self.there = False
        """Whether somebody has pressed it."""
        self._before: Any = None

    def __enter__(self) -> "Interrupts":
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._note)
        return self

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.there = True

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
        if self.there and error is None:
            raise KeyboardInterrupt
