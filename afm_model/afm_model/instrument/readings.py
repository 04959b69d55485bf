"""What can be read of an instrument between two ticks, and what the plant was doing at recorded states."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import kernel
from ..compiled.records import Array, Block, Integers, record_at, size
from ..core import registry
from ..parameters import InstrumentParameters
from ..parts.dispatch import observe
from ..parts.header import BlockHeader
from ..parts.part import Channel
from ..parts.signals import Truth
from .block import Layout, LoopState

_SIZE = size(Truth)
CLIPPED, STEEP = (LoopState.names.index(name) for name in ("clipped", "steep"))


@kernel
def truth_of_rows(states: NDArray[np.float64], m: Block) -> NDArray[np.float64]:
    """Truth (rows, numbers of Truth) of states (rows, numbers), each put into the block m in turn."""
    g = record_at(m, 0, BlockHeader)
    told = np.zeros((len(states), _SIZE))
    for row in range(len(states)):
        for i in range(states.shape[1]):
            m[g.hashed + i] = states[row, i]
        observe(record_at(m, g.truth, Truth), m)
        for i in range(_SIZE):
            told[row, i] = m[g.truth + i]
    return told


class Readings:
    """The part of an `Instrument` that only reads its block."""

    parameters: InstrumentParameters
    ticks: int
    """Control ticks since the start."""
    channels: tuple[Channel, ...]
    _layout: Layout
    _block: Block
    _loop: Integers

    def part(self, family: str) -> Any:
        """The part of a family."""
        return self._layout.parts[family].part

    def numbers(self, name: str) -> Array:
        """The numbers of a record of the block, in place."""
        return self._layout.array(self._block, name)

    def record(self, name: str) -> Any:
        """A record of the block, in place."""
        return self._layout.record(self._block, name)

    @property
    def address(self) -> int:
        """Of the block."""
        return int(self._block.ctypes.data)

    @property
    def time(self) -> float:
        """Simulated time of the next control tick [s]."""
        return self.ticks * self.parameters.plant.control_period

    def newest(self, row: int) -> float:
        """Return the present number of a channel, which is its newest sample."""
        return float(self._block[self._layout.place(self.channels[row].field)])

    @property
    def drive(self) -> Array:
        """Copy of the drive applied until now [V], (3,)."""
        return self._layout.array(self._block, "applied").copy()

    @property
    def state(self) -> Any:
        """Copy of the state of the plant, a record."""
        return self._layout.record(self._block, "plant_state").copy()

    @property
    def truth(self) -> Any:
        """Copy of what the plant is doing now, a record of `afm_model.parts.signals.Truth`: without noise."""
        return self._layout.record(self._block, "truth").copy()

    def truth_of(self, states: Array) -> NDArray[Any]:
        """What the plant was doing at recorded states (`Block.states`): records (ticks,) of Truth."""
        return truth_of_rows(np.ascontiguousarray(states), self._block.copy()).view(Truth)[:, 0].view(np.recarray)

    @property
    def in_contact(self) -> bool:
        """Whether the tip touches the sample."""
        return bool(self._layout.record(self._block, "truth").contact != 0.0)

    @property
    def samples_saturated(self) -> int:
        """Samples of the ADC since the start at which the detector was beyond its range; 0 for one that has none."""
        state = self._layout.record(self._block, "detector_state")
        return int(state["saturated"]) if "saturated" in (state.dtype.names or ()) else 0

    @property
    def time_outside(self) -> float:
        """Time since the start in which the plant was outside of what it holds for [s]; 0 for one that does not say."""
        name = registry.find("plant", self.parameters.plant.kind).time_outside
        return float(self._layout.record(self._block, "plant_ledger")[name]) if name else 0.0

    @property
    def drives_clipped(self) -> int:
        """Updates of the drive since the start at which it was beyond `piezo.limit` along some axis, and clipped."""
        return int(self._loop[CLIPPED])

    @property
    def drives_steep(self) -> int:
        """Updates of the drive since the start at which `piezo.slew_limit` held it back along some axis."""
        return int(self._loop[STEEP])
