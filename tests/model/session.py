"""A whole run in one process: the instrument, the controller and nothing between them."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from afm_model import Block, Controller, ControllerParameters, Instrument, InstrumentParameters, build
from afm_model.parameters import Value
from afm_model.parts.signals import Measurement

Z_LOOP: dict[str, Value] = {
    "plant.kind": "lever",
    "plant.scanner": "stack_13um",
    "plant.tilt": 0.0,
    "plant.tau": 1e3,
    "sample.kind": "flat",
    "reference.z_r": 50e-9,
    "onboard.kind": "pi",
}
"""A lever on a flat sample, with a z loop inside the instrument."""
PERIOD = 2.0 * np.pi / 50.0
"""Period of the paper's reference sin(0.005 tau) [s]."""
X0, Z0 = 2.5e-10, 1e-7
LATERAL, NORMAL = 15e-9, 60e-9
"""Units of the lateral and of the normal force, m_p w0^2 x0 and m_c w0^2 z0 [N]."""


def instrument(values: Mapping[str, Value], block_ticks: int = 5000) -> Instrument:
    """An instrument with `values` in place of the defaults."""
    return Instrument(build(InstrumentParameters, values), block_ticks)


def controller(values: Mapping[str, Value]) -> Controller:
    """A controller with `values` in place of the defaults."""
    return Controller(build(ControllerParameters, values))


def run(scope: Instrument, law: Controller, seconds: float) -> list[Block]:
    """Run for `seconds` of simulated time and return what was recorded, ending with a part of a block."""
    blocks = []
    for _ in range(round(seconds / scope.parameters.plant.control_period)):
        if scope.block_full:
            blocks.append(scope.take_block())
        scope.tick(law.answer(scope.measurement))
    blocks.append(scope.take_block())
    return blocks


def joined(blocks: list[Block]) -> tuple[Any, np.ndarray, np.ndarray]:
    """Measurements, by name, drives and samples of consecutive blocks."""
    return (
        np.concatenate([block.measurements for block in blocks]).view(np.recarray),
        np.concatenate([block.drives for block in blocks]),
        np.concatenate([block.samples for block in blocks], axis=1),
    )


def measured(scope: Instrument) -> Any:
    """The instrument's measurement by name; the next tick writes over it."""
    return scope.measurement.view(Measurement)[0]


def column(scope: Instrument, channel: str) -> int:
    """Row of `Block.samples` that holds a channel."""
    return [each.name for each in scope.channels].index(channel)
