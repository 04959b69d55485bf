"""Thermal noise of the plant `lever`: random forces on what moves of the cantilever, docs/lever.md (27), (28)."""

import math
from typing import TYPE_CHECKING

from ..core.jit import kernel
from .random_numbers import normal

if TYPE_CHECKING:
    from .lever_constants import Constants
    from .lever_state import State

BOLTZMANN = 1.380649e-23
"""[J/K]."""


def kick(w2: float, inverse: float, compliance: float, temperature: float, h: float) -> float:
    """Rms change of the rate at mid-step by the thermal force on an oscillator of the scheme, docs/lever.md (28).

    Parameters
    ----------
    w2, inverse : float
        Frequency of the scheme squared [1/s^2], and 1/D.
    compliance : float
        Static displacement per force (or angle per torque).
    temperature : float [K]
    h : float [s]
    """
    loss = (1.0 / inverse - 1.0 - 0.25 * h * h * w2) * 2.0 / h
    return 0.5 * h * inverse * math.sqrt(2.0 * loss * BOLTZMANN * temperature * w2 * compliance / h)


@kernel
def agitate(
    v_0: float, v_1: float, v_2: float, v_phi: float, p: "Constants", s: "State"
) -> tuple[float, float, float, float]:
    """Rates at mid-step of the modes of bending and of torsion, with the thermal forces of this step."""
    if p.thermal == 0.0:
        return v_0, v_1, v_2, v_phi
    count = 4 * int(s.steps)
    v_0 += p.kick[0] * normal(p.thermal_key, count)
    v_1 += p.kick[1] * normal(p.thermal_key, count + 1)
    v_2 += p.kick[2] * normal(p.thermal_key, count + 2)
    v_phi += p.twist_kick * normal(p.thermal_key, count + 3)
    return v_0, v_1, v_2, v_phi
