"""What has to be done now and then beside a control loop."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass
class Chore:
    """Something to do again and again, every `period` of wall time [s]; next at `at`."""

    do: Callable[[], None]
    period: float
    at: float = 0.0


class Chores:
    """Does one of them at most at a time, so that no tick waits for several.

    Parameters
    ----------
    chores : Chore
        In order of the first time.
    """

    def __init__(self, *chores: Chore) -> None:
        self._chores = chores

    def do_one(self, now: float) -> None:
        """Do the one that has been due for longest, if any is."""
        chore = min(self._chores, key=lambda chore: chore.at)
        if now >= chore.at:
            chore.at = now + chore.period
            chore.do()
