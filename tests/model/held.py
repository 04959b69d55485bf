"""An instrument under the drive of its start, and what its channels show."""

from collections.abc import Callable
from typing import Any

import numpy as np

from afm_model import Instrument
from afm_model.instrument import Block


def held(
    parameters: Any, ticks: int, begin: Callable[[Instrument], None] = lambda scope: None
) -> tuple[Instrument, dict[str, np.ndarray], Block]:
    """The instrument after so many ticks, its channels by name in SI units, and all ticks; `begin` may first change
    its state.
    """
    scope = Instrument(parameters, ticks)
    begin(scope)
    drive = scope.drive
    for _ in range(ticks):
        scope.tick(drive)
    block = scope.take_block()
    named = zip(scope.channels, block.samples, strict=True)
    return scope, {each.name: each.scale(parameters) * row for each, row in named}, block
