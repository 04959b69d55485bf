"""Bare loops over the plants' steps, for tests that look at every step."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from afm_model import InstrumentParameters, build, changed
from afm_model.compiled.jit import kernel
from afm_model.compiled.records import record_at, size
from afm_model.instrument.block import Layout
from afm_model.parts.header import BlockHeader
from afm_model.parts.signals import Drive
from afm_model.plant import Z_COMPUTED, Z_HELD, Z_UNIFORM, Constants, State
from afm_model.plant import compliant as compliant_plant
from afm_model.plant import paper as paper_plant

UNIT = 1e-4
"""Time unit 1/w0 of the paper's scales [s]."""
_Array = NDArray[np.float64]
_SIZE = size(State)


@dataclass(frozen=True)
class Bench:
    """A plant over its sample, driven in units of U: a volt is one unit."""

    parameters: InstrumentParameters
    layout: Layout
    block: _Array

    @property
    def p(self) -> Any:
        """Constants of the plant."""
        return self.layout.record(self.block, "plant_constants")

    @property
    def sample(self) -> Any:
        """Constants of the sample."""
        return self.layout.record(self.block, "sample_constants")

    def rest(self, z_r: float) -> tuple[Any, float]:
        """State in static contact with the tip at z_r [z0], and the U_z that holds it."""
        height = {"reference.z_r": z_r * self.parameters.scales.z0}
        parameters = changed(self.parameters, height)
        block = self.block.copy()
        s = self.layout.record(block, "plant_state")
        plant: Any = self.layout.parts["plant"].part
        _, _, u_z = plant.rest(parameters, self.p, s, block)
        return s.copy(), u_z

    def at(self, s: Any, treatment: int) -> _Array:
        """A block of its own with the plant in state s."""
        block = self.block.copy()
        self.layout.record(block, "plant_constants").treatment = treatment
        target = self.layout.record(block, "plant_state")
        for name in State.names or ():
            target[name] = s[name]
        return block


def bench(h: float, **values: Any) -> Bench:
    """A plant with a step of `h` time units; `values` are SI parameters, `group__name` for group.name."""
    step = dict.fromkeys(("plant.dt", "detector.sample_period", "plant.control_period"), h * UNIT)
    parameters = build(InstrumentParameters, step | {name.replace("__", "."): v for name, v in values.items()})
    layout = Layout(parameters)
    made = Bench(parameters, layout, layout.make(parameters))
    made.p.gain_x = made.p.gain_y = made.p.gain_z = 1.0
    return made


@kernel
def _compliant(m: _Array, drives: _Array, states: _Array) -> None:
    g = record_at(m, 0, BlockHeader)
    p, s = record_at(m, g.plant_constants, Constants), record_at(m, g.plant_state, State)
    v = record_at(m, g.effective, Drive)
    for i in range(len(states)):
        states[i, :] = m[g.plant_state : g.plant_state + _SIZE]
        if i < len(drives):
            v.voltage[0], v.voltage[1], v.voltage[2] = drives[i, 0], drives[i, 1], drives[i, 2]
            compliant_plant.step(0.0, v, drives, p, s, m)


@kernel
def _paper(m: _Array, drives: _Array, drawn: _Array, states: _Array) -> None:
    g = record_at(m, 0, BlockHeader)
    p, s = record_at(m, g.plant_constants, Constants), record_at(m, g.plant_state, State)
    v = record_at(m, g.effective, Drive)
    for i in range(len(states)):
        states[i, :] = m[g.plant_state : g.plant_state + _SIZE]
        if i < len(drives):
            v.voltage[0], v.voltage[1], v.voltage[2] = drives[i, 0], drives[i, 1], drives[i, 2]
            paper_plant.step(0.0, v, drawn, p, s, m)


@kernel
def _held_under_sine(m: _Array, drawn: _Array, amplitude: float, omega: float, every: int, positions: _Array) -> None:
    g = record_at(m, 0, BlockHeader)
    p, s = record_at(m, g.plant_constants, Constants), record_at(m, g.plant_state, State)
    v = record_at(m, g.effective, Drive)
    step = 0
    for i in range(len(positions)):
        positions[i, 0] = s.X
        positions[i, 1] = s.Y
        for _ in range(every):
            v.voltage[0] = v.voltage[1] = amplitude * math.sin(omega * (step + 0.5) * p.h)
            paper_plant.step(0.0, v, drawn, p, s, m)
            step += 1


def _named(states: _Array) -> Any:
    """Rows of numbers as records of State."""
    return states.view(State)[:, 0].view(np.recarray)


def compliant(s: Any, plant: Bench, drives: _Array) -> Any:
    """States, n + 1 records of State, of the compliant plant from `s` on under `drives`, (n, 3), nondimensional."""
    states = np.empty((len(drives) + 1, _SIZE))
    _compliant(plant.at(s, 0), drives, states)
    return _named(states)


def computed(s: Any, plant: Bench, drives: _Array) -> Any:
    """The same of the paper's plant with f_z computed."""
    return _paper_from(s, plant, Z_COMPUTED, drives, 0.0)


def drawn(s: Any, plant: Bench, drives: _Array, f_z: float) -> Any:
    """The same of the paper's plant with f_z given."""
    return _paper_from(s, plant, Z_UNIFORM, drives, f_z)


def held(s: Any, plant: Bench, drives: _Array) -> Any:
    """The same of the paper's plant with the tip held, under `drives` along x and y alone, (n, 2)."""
    return _paper_from(s, plant, Z_HELD, np.column_stack([drives, np.zeros(len(drives))]), 0.0)


def _paper_from(s: Any, plant: Bench, treatment: int, drives: _Array, f_z: float) -> Any:
    states = np.empty((len(drives) + 1, _SIZE))
    _paper(plant.at(s, treatment), drives, np.array([f_z]), states)
    return _named(states)


def held_under_sine(s: Any, plant: Bench, amplitude: float, omega: float, every: int, points: int) -> _Array:
    """Positions (points, 2), every `every` steps, with the drive on both axes taken at the middle of each step."""
    positions = np.empty((points, 2))
    _held_under_sine(plant.at(s, Z_HELD), np.zeros(1), amplitude, omega, every, positions)
    return positions


def frequency(signal: _Array, h: float) -> float:
    """Angular frequency of an oscillation about zero, from its first to its last upward zero crossing."""
    i = np.flatnonzero((signal[:-1] < 0.0) & (signal[1:] >= 0.0))
    crossings = i + signal[i] / (signal[i] - signal[i + 1])
    return float(2.0 * np.pi * (len(crossings) - 1) / ((crossings[-1] - crossings[0]) * h))
