"""The test problem: section 4.1 of the paper, lateral motion with the tip held, from rest over one period."""

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from afm_model import load_scenario
from afm_model.parameters import SimParameters
from afm_model.plant import PLANT_RECORD, plant_constants, rest, state

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "model"))

from oracle import Trajectory, event_driven, paper_lateral  # noqa: E402

AMPLITUDE, OMEGA = 20.0, 0.005
_Array = NDArray[np.float64]


def parameters() -> SimParameters:
    """The scenario of section 4.1."""
    return load_scenario(ROOT / "docs" / "scenarios" / "paper_4_1.yaml").sim


def constants(h: float) -> _Array:
    """Constants of the plant for a step of `h` units."""
    p = parameters()
    return plant_constants(p, h / p.scales.w0)


def start() -> _Array:
    """Rest at the setpoint, all of the state."""
    p = parameters()
    return rest(constants(0.01), p.reference.z_r / p.scales.z0)[0]


def load() -> float:
    """The load, constant because the tip is held [m_c w0^2 z0]."""
    return float(start()[state.N])


def by_name(c: _Array) -> Any:
    """Constants by name."""
    return c.view(PLANT_RECORD)[0]


def reference(duration: float) -> Trajectory:
    """The event-driven solution at every unit of time up to `duration`."""
    return event_driven(
        paper_lateral(load()),
        lambda t: (AMPLITUDE * math.sin(OMEGA * t),) * 2,
        lambda t: (AMPLITUDE * OMEGA * math.cos(OMEGA * t),) * 2,
        np.arange(math.floor(duration) + 1.0),
    )


def error(positions: _Array, exact: Trajectory) -> float:
    """Largest distance from the reference in x or y [x0]; infinite if the solution blew up."""
    if not np.isfinite(positions).all():
        return math.inf
    return float(np.abs(positions - exact.positions).max())
