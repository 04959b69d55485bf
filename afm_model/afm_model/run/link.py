"""The link between a run and its controller."""

import math

import numpy as np
from numpy.typing import NDArray

from ..core.errors import DriveError
from ..parts.command import Command

_Array = NDArray[np.float64]


class Link:
    """Carries measurements to a controller and drives back. Its methods never wait. The base class has none."""

    def publish(self, sequence: int, measurement: _Array) -> None:
        """Send the measurement of tick `sequence`; the array is overwritten by the next tick."""

    def take(self) -> tuple[int, _Array | Command | DriveError] | None:
        """The oldest drive not yet taken: sequence of the measurement it answers, voltages (3,) [V] or Command.

        None if there is none.

        What came and cannot be a drive is the error that says why.

        An array is valid until the next call.

        Raises
        ------
        MalformedError
            If what came cannot be read. It is taken then: the next call goes on behind it.
        """
        return None

    def arrived(self) -> float:
        """When the drive taken last arrived, by the clock of the run [s]."""
        return math.nan

    def ready(self) -> bool:
        """Whether all nodes that the run needs are present."""
        return True

    def objection(self) -> str:
        """Why what this run brings cannot be trusted, in one sentence; empty if it can."""
        return ""

    @property
    def controller(self) -> str:
        """Name of the controller; empty if it is not known."""
        return ""
