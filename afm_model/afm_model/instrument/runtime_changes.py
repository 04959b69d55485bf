"""Changes between two ticks: orders of the program, settings of the onboard loop."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.records import record_at
from ..core.errors import ParameterError
from ..parameters import InstrumentParameters
from .block import Layout, LoopState


class Orders:
    """Access to program and onboard loop of an instrument during a run.

    Parameters
    ----------
    layout : Layout
    block : ndarray
    parameters : InstrumentParameters
    """

    def __init__(self, layout: Layout, block: NDArray[np.float64], parameters: InstrumentParameters) -> None:
        self._layout, self._block, self._parameters = layout, block, parameters
        program: Any = layout.parts["program"].part
        self._order: Any = program.order
        self._first: Any = program.first
        self.taken = program.order is not None and program.first is None
        """Whether the program takes orders."""
        self._loop = record_at(block, layout.places["loop"], LoopState)
        self._done = block[layout.place("program_state.done") :] if self.taken else None

    def _put(self, order: Any, tick: int) -> None:
        constants = self._layout.record(self._block, "program_constants")
        state = self._layout.record(self._block, "program_state")
        # What the constants point to must stay where it is.
        self._kept = self._order(order, tick, self._parameters, constants, state)

    def reset(self) -> None:
        """Return to the start of a run: nothing is ordered, or what the program begins with."""
        if self._order is not None:
            at = self._layout.places["program_constants"]
            self._layout.parts["program"].fill_constants(self._block, at, self._parameters)
        self._loop.halt = 0
        if self._first is not None:
            self._put(self._first(self._parameters), 0)

    def put_in_force(self, order: Any, tick: int) -> None:
        """Order what the program does from this tick on.

        Raises
        ------
        ParameterError
            If it takes no orders.
        """
        if not self.taken:
            raise ParameterError(
                f"reference.kind = {self._parameters.reference.kind} takes no orders: take reference.kind = verbs"
            )
        self._put(order, tick)
        self._loop.halt = self._layout.place("program_state.done")

    @property
    def done(self) -> bool:
        """Whether the order in force is done, or no order is in force."""
        # Places computed once: they are read after each tick.
        return self._done is None or self._done.item(0) != 0.0

    @property
    def asked(self) -> Any:
        """Copy of the reference of this tick, a record of `afm_model.parts.signals.Setpoint`."""
        return self._layout.record(self._block, "asked").copy()

    @property
    def program(self) -> Any:
        """Copy of the state of the program, a record."""
        return self._layout.record(self._block, "program_state").copy()

    @property
    def onboard(self) -> Any:
        """Copy of the state of the loop inside the instrument, a record."""
        return self._layout.record(self._block, "onboard_state").copy()

    def set_onboard(self, parameters: InstrumentParameters) -> None:
        """Change gains, setpoint or mode of the onboard loop, which continues from the present z.

        Raises
        ------
        ParameterError
            If it is another loop.
        """
        old, new = self._parameters.onboard.kind, parameters.onboard.kind
        if new != old:
            raise ParameterError(f"onboard.kind = {new} is not allowed while it runs: it stays {old}")
        self._parameters = parameters
        at = self._layout.places["onboard_constants"]
        self._layout.parts["onboard"].fill_constants(self._block, at, parameters)
