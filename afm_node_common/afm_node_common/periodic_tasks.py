"""Periodic tasks in addition to a control loop."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass
class PeriodicTask:
    """A function to call every `period` of wall time [s]; next at `at`."""

    do: Callable[[], None]
    period: float
    at: float = 0.0


class PeriodicTasks:
    """Runs at most one task at a time, so that no tick waits for several.

    Parameters
    ----------
    tasks : PeriodicTask
        In order of the first time.
    """

    def __init__(self, *tasks: PeriodicTask) -> None:
        self._tasks = tasks

    def run_next(self, now: float) -> None:
        """Run the task that has been due for longest, if one is due."""
        task = min(self._tasks, key=lambda task: task.at)
        if now >= task.at:
            task.at = now + task.period
            task.do()
