"""What a run is connected with: the link to its controller, and callbacks."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import DriveError
from ..instrument import Block
from ..instrument.wire import Wire
from ..parts.drives_ahead import Command

_Array = NDArray[np.float64]
Answer = _Array | Command | DriveError
"""Voltages (3,) [V] or a Command; or why what came cannot be a drive."""


class Link:
    """Carries measurements to a controller and drives back. Its methods never wait. The base class has none."""

    wire: Wire | None = None
    """Its messages in place, where it has them: a run in lockstep then takes and publishes by it."""

    def name_run(self, run_id: int) -> None:
        """A run begins that has this name: measurements carry it, and drives for another run are outdated."""

    def publish(self, sequence: int, measurement: _Array) -> None:
        """Send the measurement of tick `sequence`; the array is overwritten by the next tick."""

    def take(self) -> tuple[int, Answer] | None:
        """Take the oldest drive: return the sequence of the measurement it answers, and voltages (3,) [V] or Command.

        None if no drive is left.

        What came and cannot be a drive is the error that says why.

        An array is valid until the next call.

        Raises
        ------
        MalformedError
            If what came cannot be read. It is taken then: the next call goes on after it.
        """
        return None

    def read(self, data: bytes) -> tuple[int, Answer]:
        """A message that was taken by `wire`, as `take` gives it."""
        raise NotImplementedError

    def arrived(self) -> float:
        """When the drive taken last arrived, by the clock of the run [s]."""
        return math.nan

    def ready(self) -> bool:
        """Whether all nodes that the run needs are present."""
        return True

    def objection(self) -> str:
        """Why what this run brings cannot be trusted, in one sentence; empty if it can."""
        return ""

    def cause(self) -> str:
        """Return why the controller may be silent or slow, in one sentence; empty if nothing is known."""
        return ""

    @property
    def controller(self) -> str:
        """Name of the controller; empty if it is not known."""
        return ""


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
    left: Callable[[], None] = _ignore
    """left(): the run is left for another one; every block has been handed on, `Engine.run_id` is still its name."""
    verb_over: Callable[[Any], None] = _ignore
    """verb_over(outcome): a verb has come to its end."""
