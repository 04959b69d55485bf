"""A family of tries: what they share is made once, and made anew after one that failed."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from random import Random

from support import Graph

from torture.outcome import Outcome

Try = Callable[[Random, Outcome], None]
"""One try: draws its moments, fills in what became of it, raises if it failed."""
Make = Callable[[Graph, Path, str], AbstractContextManager[Try]]
"""Makes what the tries share: graph, folder and namespace are its own."""


class Unavailable(RuntimeError):
    """This fault cannot be had on this machine; says why."""


@dataclass(frozen=True)
class Family:
    """Tries of one fault."""

    fault: str
    """As in the table."""
    make: Make
    share: float = 1.0
    """Tries for each one asked for."""

    def tries(self, asked: int) -> int:
        """How many."""
        return max(1, round(self.share * asked))
