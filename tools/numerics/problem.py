"""The test problem: section 4.1 of the paper, lateral motion with the tip held, from rest over one period."""

import math
import sys
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from afm_model import changed, load_scenario
from afm_model.compiled.records import record_at
from afm_model.instrument.block import Layout
from afm_model.parts.header import BlockHeader
from afm_model.plant import State

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "model"))

from oracle import Trajectory, event_driven, paper_lateral  # noqa: E402

AMPLITUDE, OMEGA = 20.0, 0.005
_Array = NDArray[np.float64]


@cache
def _at_rest(h: float = 0.01) -> _Array:
    """Block of the scenario of section 4.1 for a step of `h` units, its drive in units of U."""
    given = load_scenario(ROOT / "docs" / "scenarios" / "paper_4_1.yaml").sim
    step = dict.fromkeys(("plant.dt", "detector.sample_period", "plant.control_period"), h / given.scales.w0)
    parameters = changed(given, step)
    layout = Layout(parameters)
    m = layout.make(parameters)
    p = layout.record(m, "plant_constants")
    layout.parts["plant"].part.rest(parameters, p, layout.record(m, "plant_state"), m)  # type: ignore[attr-defined]
    p.gain_x = p.gain_y = p.gain_z = 1.0
    return m


def start(h: float) -> _Array:
    """Rest at the setpoint: block of the instrument for a step of `h` units. The drive is U itself, not volts."""
    return _at_rest(h).copy()


def load() -> float:
    """The load, constant because the tip is held [m_c w0^2 z0]."""
    m = _at_rest()
    return float(record_at(m, record_at(m, 0, BlockHeader).plant_state, State).N)


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
