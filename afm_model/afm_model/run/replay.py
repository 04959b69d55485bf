"""A recorded run played again."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError
from ..parameters import SimParameters, build
from ..schema import Value

_Array = NDArray[np.float64]


class Replay:
    """A law that gives the drives of a recorded run, tick by tick.

    Parameters
    ----------
    drives : ndarray (n, 3) [V]
        Applied from each tick on, as recorded: `Recording.drive`, `Simulation.drives`.
    delay_ticks : int
        `plant.delay_ticks` of the instrument. What is recorded has been delayed: it is given so many ticks sooner.

    Raises
    ------
    ParameterError
        If the drives are not n rows of three finite numbers: a recording with a gap cannot be replayed.
    """

    def __init__(self, drives: _Array, delay_ticks: int = 0) -> None:
        drives = np.asarray(drives, np.float64)
        if drives.ndim != 2 or drives.shape[1] != 3 or not len(drives):
            raise ParameterError(f"drives of shape {drives.shape} cannot be replayed: they must be n rows of three")
        gaps = np.flatnonzero(~np.isfinite(drives).all(axis=1))
        if gaps.size:
            raise ParameterError(
                f"drives with {gaps.size} gaps cannot be replayed (the first at tick {gaps[0]}): the recording must be "
                "whole"
            )
        self._drives = drives
        self._delay_ticks = delay_ticks
        self._next = 0

    def answer(self, measurement: _Array) -> _Array:
        """The drive of the next tick [V]; after the last one, that again."""
        at = min(self._next + self._delay_ticks, len(self._drives) - 1)
        self._next += 1
        return self._drives[at]

    def reset(self) -> None:
        """Begin again."""
        self._next = 0


def recorded_parameters(values: Mapping[str, Value]) -> SimParameters:
    """Parameters of the instrument as a recording holds them, beside others that its node has.

    Parameters
    ----------
    values : mapping
        Value by dotted name: `Recording.parameters["afm_sim_node"]`.

    Raises
    ------
    ParameterError
        If the instrument of today does not know one of its own, or refuses its value.
    """
    return build(
        SimParameters,
        {name: value for name, value in values.items() if name.partition(".")[0] in SimParameters.model_fields},
    )
