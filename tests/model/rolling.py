"""Bare loops over the plants' steps, for tests that look at every step."""

import math
from typing import Any

import numpy as np

from afm_model import InstrumentParameters, build
from afm_model.jit import kernel
from afm_model.plant import PLANT_RECORD, Z_HELD, plant_constants, state, step_compliant, step_paper

UNIT = 1e-4
"""Time unit 1/w0 of the paper's scales [s]."""


def constants(h: float, **values: Any) -> np.ndarray:
    """Plant constants for a step of `h` time units; `values` are SI parameters, `group__name` for group.name."""
    flat = {name.replace("__", "."): value for name, value in values.items()}
    return plant_constants(build(InstrumentParameters, flat), h * UNIT)


def named(constants: np.ndarray) -> Any:
    """The constants by name."""
    return constants.view(PLANT_RECORD)[0]


@kernel
def _compliant(s: np.ndarray, constants: np.ndarray, drives: np.ndarray, states: np.ndarray) -> None:
    p = constants.view(PLANT_RECORD)[0]
    for i in range(len(drives)):
        states[i, :] = s
        step_compliant(s, p, drives[i, 0], drives[i, 1], drives[i, 2])
    states[len(drives), :] = s


def compliant(s: np.ndarray, constants: np.ndarray, drives: np.ndarray) -> np.ndarray:
    """States, (n + 1, SIZE), of the compliant plant from `s` on under `drives`, (n, 3), nondimensional."""
    states = np.empty((len(drives) + 1, state.SIZE))
    _compliant(s.copy(), constants, drives, states)
    return states


@kernel
def _held(s: np.ndarray, constants: np.ndarray, drives: np.ndarray, states: np.ndarray) -> None:
    p = constants.view(PLANT_RECORD)[0]
    for i in range(len(drives)):
        states[i, :] = s
        step_paper(s, p, drives[i, 0], drives[i, 1], 0.0, Z_HELD, 0.0)
    states[len(drives), :] = s


def held(s: np.ndarray, constants: np.ndarray, drives: np.ndarray) -> np.ndarray:
    """States, (n + 1, SIZE), of the paper's plant with the tip held, under `drives`, (n, 2)."""
    states = np.empty((len(drives) + 1, state.SIZE))
    _held(s.copy(), constants, drives, states)
    return states


@kernel
def _held_under_sine(
    s: np.ndarray, constants: np.ndarray, amplitude: float, omega: float, every: int, positions: np.ndarray
) -> None:
    p = constants.view(PLANT_RECORD)[0]
    step = 0
    for i in range(len(positions)):
        positions[i, 0] = s[state.X]
        positions[i, 1] = s[state.Y]
        for _ in range(every):
            u = amplitude * math.sin(omega * (step + 0.5) * p.h)
            step_paper(s, p, u, u, 0.0, Z_HELD, 0.0)
            step += 1


def held_under_sine(
    s: np.ndarray, constants: np.ndarray, amplitude: float, omega: float, every: int, points: int
) -> np.ndarray:
    """Positions (points, 2), every `every` steps, with the drive on both axes taken at the middle of each step."""
    positions = np.empty((points, 2))
    _held_under_sine(s.copy(), constants, amplitude, omega, every, positions)
    return positions


def frequency(signal: np.ndarray, h: float) -> float:
    """Angular frequency of an oscillation about zero, from its first to its last upward zero crossing."""
    i = np.flatnonzero((signal[:-1] < 0.0) & (signal[1:] >= 0.0))
    crossings = i + signal[i] / (signal[i] - signal[i + 1])
    return float(2.0 * np.pi * (len(crossings) - 1) / ((crossings[-1] - crossings[0]) * h))
