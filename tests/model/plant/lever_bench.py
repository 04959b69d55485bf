"""The plant `lever` step by step, for tests."""

from typing import Any

import numpy as np

from afm_model import InstrumentParameters, build
from afm_model.compiled.jit import kernel
from afm_model.compiled.records import pointer_at, record_at
from afm_model.instrument.block import Layout
from afm_model.parts.header import BlockHeader
from afm_model.parts.signals import Actuation
from afm_model.plant.lever import LEVER, Constants, State
from afm_model.plant.lever.step import step as lever_step

BASE = {"plant.kind": "lever", "sample.kind": "flat", "reference.z_r": 50e-9}


@kernel
def _advance(m: np.ndarray, u: np.ndarray, states: np.ndarray) -> None:
    g = record_at(m, 0, BlockHeader)
    p, s = record_at(m, g.plant_constants, Constants), record_at(m, g.plant_state, State)
    v = record_at(m, g.effective, Actuation)
    for i in range(len(u)):
        for axis in range(3):
            v.voltage[axis] = u[i, axis]
        lever_step(i * p.h, v, pointer_at(m, 0), p, s, m)
        for j in range(states.shape[1]):
            states[i, j] = m[g.plant_state + j]


class LeverBench:
    """The plant at rest, made of dotted parameters; `held` is the drive [V] that holds it."""

    def __init__(self, **values: Any) -> None:
        given = {name.replace("__", "."): value for name, value in values.items()}
        step = given.get("plant.dt", 1e-6)
        periods = {"detector.sample_period": step, "plant.control_period": step}
        self.parameters: Any = build(InstrumentParameters, BASE | periods | given)
        self._layout = Layout(self.parameters)
        self.block = self._layout.make(self.parameters)
        self.p = self._layout.record(self.block, "plant_constants")
        self.s = self._layout.record(self.block, "plant_state")
        self.held = np.array(LEVER.rest(self.parameters, self.p, self.s, self.block))
        self.plant = self.parameters.plant

    @property
    def numbers(self) -> np.ndarray:
        """The state as numbers, in place."""
        return self._layout.array(self.block, "plant_state")

    def run(self, moved: np.ndarray) -> Any:
        """States (n,) as records, of n steps under drives moved from the held one by (n, 3) metres of the scanner."""
        states = np.empty((len(moved), len(self.numbers)))
        _advance(self.block, self.held + moved / np.array(self.p.metres), states)
        return states.view(State)[:, 0].view(np.recarray)

    def stay(self, n: int) -> Any:
        """The same with the drive held."""
        return self.run(np.zeros((n, 3)))


def triangle(amplitude: float, n: int) -> np.ndarray:
    """Two periods of a triangle, n steps each, from zero."""
    return amplitude * 2.0 / np.pi * np.arcsin(np.sin(2.0 * np.pi * np.arange(1, 2 * n + 1) / n))
