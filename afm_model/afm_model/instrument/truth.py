"""What the plant was doing at recorded states."""

import numpy as np
from numpy.typing import NDArray

from ..core.jit import kernel
from ..core.records import Block, record_at, size
from ..parts.dispatch import observe
from ..parts.header import BlockHeader
from ..parts.signals import Truth

_SIZE = size(Truth)


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
