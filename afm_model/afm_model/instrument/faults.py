"""The faults of an instrument: in force from its start, or put in force while it runs."""

import numpy as np
from numpy.typing import NDArray

from ..compiled.records import record_at, size
from ..core.errors import ParameterError
from ..fault import NEVER, SCHEDULED, SENSED, Constants, Memory, OnTheirWay, faults_of, table
from ..parameters import InstrumentParameters
from ..parts.header import BlockHeader
from ..parts.signals import PiezoDrive, copy_command
from .block import Layout

_TOLD = ("begun", "held")
"""What is remembered of each fault."""
_HOOKS = {
    "on_sample": ("on_sample",),
    "on_command": ("on_commands",),
    "on_drive": ("on_drives",),
    "on_measurement": ("on_sensors", "on_measurements"),
}
"""For which sorts of faults each function of the part is called."""
_SORTS = tuple(sort for sorts in _HOOKS.values() for sort in sorts)
"""How many faults of a sort are in the table; for a sort without a fault nothing is computed."""


class Faults:
    """Faults in the block of an instrument.

    Parameters
    ----------
    layout : Layout
    block : ndarray
    parameters : InstrumentParameters
    """

    def __init__(self, layout: Layout, block: NDArray[np.float64], parameters: InstrumentParameters) -> None:
        self._layout, self._block, self._parameters = layout, block, parameters
        self.there = bool(faults_of(parameters))
        """Whether there is any, now or later."""
        self._scheduled = layout.parts["fault"].part is SCHEDULED
        if self._scheduled:
            self._table = record_at(block, layout.places["fault_constants"], Constants)
            self._memory = record_at(block, layout.places["fault_state"], Memory)
        self._header = record_at(block, 0, BlockHeader)
        self._of_messages = self._received = np.zeros(0)
        self._names: list[str] = []
        self.until = NEVER
        """Before this tick is computed, `renew` must be called."""

    def reset(self) -> None:
        """Return to the start of a run; the commands of the block are those of the start."""
        if self._scheduled:
            for sort in _SORTS:
                self._table[sort] = 0
            self._fill(0)
            if self._table.on_measurements > 0:
                self._make_room()
            if self._table.on_commands > 0:
                self._begin_commands(-1)
        elif self._header.fault_on_command != 0:
            self._receive()

    def put_in_force(self, parameters: InstrumentParameters) -> None:
        """Take the schedule of `parameters` from the next tick on; a fault that is already active continues.

        Raises
        ------
        ParameterError
            If the fault of this instrument is no schedule.
        """
        if not self._scheduled:
            kind = self._parameters.fault.kind
            raise ParameterError(
                f"fault.kind = {kind} takes no faults while it runs: start the simulator with fault.kind = scheduled"
            )
        self._parameters = parameters
        self.there = bool(faults_of(parameters))
        self.renew(int(self._layout.record(self._block, "loop").k))

    def renew(self, tick: int) -> None:
        """Fill the table again, for `tick` and those after it: faults that are over leave their places."""
        on_commands, on_measurements = self._table.on_commands > 0, self._table.on_measurements > 0
        self._fill(tick)
        if self._table.on_commands > 0 and not on_commands:
            self._begin_commands(tick - 1)
        if self._table.on_measurements > 0 and not on_measurements:
            self._begin_measurements(tick)

    def _fill(self, tick: int) -> None:
        remembered = {name: [self._memory[field][i] for field in _TOLD] for i, name in enumerate(self._names)}
        found = table(self._parameters, tick)
        for name, value in found.numbers.items():
            # A sort that was there once is looked after to the end of the run: a late message may still be on its way,
            # a lost one leaves the one before in force, and the friction of the sample is put back.
            self._table[name] = max(value, self._table[name]) if name in _SORTS else value
        for i, name in enumerate(found.names):
            for field, value in zip(_TOLD, remembered.get(name, (0, 0.0)), strict=True):
                self._memory[field][i] = value
        self._names, self.until = found.names, found.until
        addresses = self._layout.parts["fault"].places
        for hook, sorts in _HOOKS.items():
            called = any(self._table[sort] > 0 for sort in sorts)
            self._header[f"fault_{hook}"] = addresses[f"fault_{hook}"] if called else 0

    def _make_room(self) -> None:
        """Have room for messages on their way, empty at first."""
        if self._memory.messages == 0:
            self._of_messages = np.zeros(size(OnTheirWay))
            self._memory.messages = self._of_messages.ctypes.data

    def _receive(self) -> None:
        """What is commanded now has arrived."""
        self._received = np.zeros(size(PiezoDrive))
        self._header.received = self._received.ctypes.data
        copy_command(self._layout.record(self._block, "commanded"), record_at(self._received, 0, PiezoDrive))

    def _begin_commands(self, tick: int) -> None:
        """From now on commands are remembered: the one of `tick` is in force."""
        self._make_room()
        self._receive()
        f = self._memory
        commanded = self._layout.record(self._block, "commanded")
        f.in_force, f.passed = tick, commanded.sequence
        f.passed_voltage[:] = commanded.voltage
        record_at(self._of_messages, 0, OnTheirWay).arrives_at[:] = -1

    def _begin_measurements(self, tick: int) -> None:
        """Keep sensor values from now on: those of `tick` have been measured."""
        self._make_room()
        self._memory.shown = tick
        f = record_at(self._of_messages, 0, OnTheirWay)
        slot = tick % len(f.shown_at)
        f.shown_at[:] = -1
        f.shown_at[slot] = tick
        f.sensed[slot] = self._layout.array(self._block, "measurement")[:SENSED]
