"""Preview of the reference: what the measurements of control ticks to come will contain of it."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import kernel
from ..compiled.records import Block, record_at, size
from ..core.errors import ParameterError
from ..parameters import InstrumentParameters
from ..parts.assembly import assembled
from ..parts.dispatch import reference
from ..parts.header import BlockHeader
from ..parts.signals import Setpoint

_Array = NDArray[np.float64]
MOST = 1_000_000
"""Control ticks that may be asked for at once."""
_LAST = 2**53
"""Beyond it not every whole number is a float64: several ticks would have the same time."""
_WIDTH = size(Setpoint)


class Preview(NamedTuple):
    """Reference at n control ticks: x and y of the scanner, z of the tip."""

    time: _Array  # (n,) simulated time [s]
    position: _Array  # (n, 3) [m]
    velocity: _Array  # (n, 3) [m/s]
    acceleration: _Array  # (n, 3) [m/s^2]


@kernel
def _write(first: int, count: int, control_period: float, rows: Block, m: Block) -> None:
    """Write the reference at `count` control ticks from `first` on into records of Setpoint."""
    for i in range(count):
        reference((first + i) * control_period, record_at(rows, i * _WIDTH, Setpoint), m)


class Previewer:
    """Answers questions for the reference of an instrument, to the last bit as its measurements will.

    Parameters
    ----------
    parameters : InstrumentParameters

    Raises
    ------
    ParameterError
        If the reference is not known ahead: its program takes orders during the run, or depends on what is measured.
    """

    def __init__(self, parameters: InstrumentParameters) -> None:
        kind = parameters.reference.kind
        self._program = program = assembled("program", kind)
        part: Any = program.part
        if part.order is not None:
            raise ParameterError(f"reference.kind = {kind} is not known ahead: it does what is ordered during the run")
        self._period = parameters.plant.control_period
        self._block = np.zeros(size(BlockHeader) + size(part.constants))
        header = record_at(self._block, 0, BlockHeader)
        header.program_reference = program.places["program_reference"]
        header.program_constants = size(BlockHeader)
        program.fill_constants(self._block, size(BlockHeader), parameters)

    def ask(self, first: int, count: int) -> Preview:
        """Reference at `count` control ticks from tick `first` on; 0 is the first of a run.

        Raises
        ------
        ParameterError
            If there are no such ticks, or more than MOST.
        PartError
            If a program in Python raises something.
        """
        if not 1 <= count <= MOST:
            raise ParameterError(f"count = {count} is not allowed: it must be from 1 to {MOST}")
        if not 0 <= first <= _LAST - count:
            raise ParameterError(f"first = {first} is not allowed: it must be from 0 to {_LAST - count}")
        rows = np.zeros((count, _WIDTH))
        _write(first, count, self._period, rows.ravel(), self._block)
        self._program.raise_errors()
        found = rows.view(Setpoint.dtype)[:, 0]
        time = np.arange(first, first + count, dtype=np.float64) * self._period
        return Preview(time, found["position"].copy(), found["velocity"].copy(), found["acceleration"].copy())


def preview_reference(parameters: InstrumentParameters, first: int, count: int) -> Preview:
    """Preview of the reference in process: for a law in Python that looks ahead.

    Parameters
    ----------
    parameters : InstrumentParameters
        Or SimParameters: of the run.
    first : int
        First control tick; 0 is the first of the run.
    count : int
        How many.

    Raises
    ------
    ParameterError
        If the reference is not known ahead, or there are no such ticks.
    """
    return Previewer(parameters).ask(first, count)
