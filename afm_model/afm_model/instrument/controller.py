"""A law with its parameters and its state, ready to answer measurements."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import kernel
from ..compiled.records import Block, Record, record_at, size
from ..parameters import ControllerParameters
from ..parts.assembly import Assembled, assembled
from ..parts.dispatch import control
from ..parts.drives_ahead import Command, CommandRecord
from ..parts.header import LawHeader
from ..parts.part import LawEstimate
from ..parts.signals import Measurement, PiezoDrive

_Array = NDArray[np.float64]


@kernel
def answer(block: Block, t: float, measurement: _Array, command: _Array) -> None:
    """Write the command that the law answers to a measurement taken at time t [s]."""
    control(t, record_at(measurement, 0, Measurement), record_at(command, 0, PiezoDrive), block)


def external_law() -> Block:
    """Block of the law that is somewhere else: it has no function."""
    return np.zeros(size(LawHeader))


_KEPT = 64
"""Laws whose constants are kept: many runs are made with the same one."""
_MADE: dict[int, tuple[ControllerParameters, Any, _Array]] = {}


def _constants_of(chosen: Assembled, parameters: ControllerParameters) -> _Array:
    """Constants of a law, made once for the very same parameters."""
    known = _MADE.get(id(parameters))
    if known is None or known[0] is not parameters or known[1] is not chosen.part:
        numbers = np.zeros(size(chosen.part.constants))
        chosen.fill_constants(numbers, 0, parameters)
        if len(_MADE) >= _KEPT:
            del _MADE[next(iter(_MADE))]
        known = _MADE[id(parameters)] = parameters, chosen.part, numbers
    return known[2]


class Controller:
    """A law with its parameters and its state.

    Parameters
    ----------
    parameters : ControllerParameters

    Attributes
    ----------
    block : ndarray
        What compiled code takes: which law, its constants, its state; another array after the parameters have changed.
    in_python : bool
        Whether the law may have raised something inside compiled code.
    written : ndarray
        Numbers of `afm_model.parts.signals.PiezoDrive`, where the law writes.

    Raises
    ------
    ParameterError
        If parameters are so large or small that the law cannot be computed, here or when they are assigned.
    PartError
        If a law of somebody else's does not work.
    """

    block: Block
    in_python: bool
    _parameters: ControllerParameters
    _state_at: int

    def __init__(self, parameters: ControllerParameters) -> None:
        self.written = np.zeros(size(PiezoDrive))
        self._command = CommandRecord(self.written)
        self._drive, self._horizon_count = self._command.voltage, self._command.horizon_count
        self._law: Assembled | None = None
        self._memory = np.zeros(0)
        self.parameters = parameters

    @property
    def parameters(self) -> ControllerParameters:
        """The parameters in force; assigning changes the law from the next measurement on. Its state goes on, unless
        the law is another one (but for what both hand over), or needs another amount of memory.
        """
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: ControllerParameters) -> None:
        chosen = assembled("law", parameters.law.kind)
        constants = size(LawHeader)
        state = constants + size(chosen.part.constants)
        block = np.zeros(state + size(chosen.part.state))
        header = record_at(block, 0, LawHeader)
        for name, value in {**chosen.places, "law_constants": constants, "law_state": state}.items():
            header[name] = value
        block[constants:state] = _constants_of(chosen, parameters)
        kept: Any = chosen.part
        memory = 0 if kept.memory is None else kept.memory[1](parameters)
        goes_on = self._law is not None and self._law.part is chosen.part and memory == len(self._memory)
        if goes_on:
            block[state:] = self.block[self._state_at :]
            each = (record_at(numbers, constants, kept.constants) for numbers in (self.block, block))
            kept.change(*each, record_at(block, state, kept.state))
        handed = {} if goes_on else self._handed_over(kept.state)
        self._law, self._parameters, self.block, self._state_at = chosen, parameters, block, state
        self.in_python = chosen.in_python
        if not goes_on:
            self._memory = np.zeros(memory)
            self.reset()
            for name, value in handed.items():
                self.state[name] = value

    def _handed_over(self, state: type[Record]) -> dict[str, Any]:
        """What the state of this law hands over to that of another."""
        before = Record if self._law is None else self._law.part.state
        shared = (each for each in state.__mro__ if vars(each).get("handed_over") and issubclass(before, each))
        base: Any = next(shared, Record)
        return {name: np.copy(self.state[name]) for name in base.fields}

    def reset(self) -> None:
        """Put the state of the law to its start."""
        assert self._law is not None
        self._law.fill_start(self.block, self._state_at, self._parameters)
        part: Any = self._law.part
        if part.memory is not None:
            self._memory[:] = 0.0
            self.state[part.memory[0]] = self._memory.ctypes.data

    @property
    def state(self) -> Any:
        """Record of the law's state: reading and writing it is reading and writing the law's."""
        assert self._law is not None
        return record_at(self.block, self._state_at, self._law.part.state)

    @property
    def remark(self) -> str:
        """What the law has to say of itself, such as that it has fallen back; empty: nothing."""
        part: Any = self._law.part if self._law is not None else None
        return str(part.remark(self.state))

    @property
    def estimates(self) -> tuple[LawEstimate, ...]:
        """What the law believes of the microscope now; of most laws nothing."""
        part: Any = self._law.part if self._law is not None else None
        return tuple(part.estimates(record_at(self.block, size(LawHeader), part.constants), self.state))

    def answer(self, measurement: _Array, time: float = 0.0) -> _Array | Command:
        """Drive [V], (3,), valid until the next call; of a law that sends a horizon, drive and horizon.

        Parameters
        ----------
        measurement : ndarray
            In the order of `afm_model.parts.signals.Measurement`.
        time : float [s]
            Simulated time at which it was taken; the paper's laws do not use it.

        Raises
        ------
        PartError
            If a law in Python has raised something.
        DriveError
            If a law has written a horizon that is too long or has no period.
        """
        answer(self.block, time, measurement, self.written)
        if self.in_python:
            self.raise_errors()
        return self.given()

    def given(self) -> _Array | Command:
        """The last answer."""
        return self._command.read() if self._horizon_count[0] else self._drive

    def raise_errors(self) -> None:
        """Raise what a law in Python has raised inside compiled code.

        Raises
        ------
        PartError
        """
        assert self._law is not None
        if self._law.in_python:
            self._law.raise_errors()
