"""Callbacks of a run."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..instrument import Block


def _ignore(*_: object) -> None:
    """Nobody listens."""


@dataclass(frozen=True)
class Listeners:
    """Callbacks of a run: `Engine` calls them between two ticks."""

    changed: Callable[[], None] = _ignore
    """changed(): the state or its detail has changed."""
    block: Callable[[Block, NDArray[np.float32]], None] | None = None
    """block(block, round_trips): recorded ticks, and the round trips of them [s]; blocks join without a gap. None:
    nobody wants them.
    """
    ended: Callable[[], None] = _ignore
    """ended(): the duration is over, every block has been handed on; the state becomes FINISHED next."""
    verb_over: Callable[[Any], None] = _ignore
    """verb_over(outcome): a verb has come to its end."""
