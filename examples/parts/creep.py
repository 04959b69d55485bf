"""A piezo of your own: it creeps. After a step it goes on by `creep` of the step in every decade of time.

piezo.kind: creep:CREEP
"""

import math
from typing import Any

from pydantic import Field

from afm_model.parts import Channel, Piezo, PiezoParameters, kernel, record

POLES = 6  # time constants 1 ms, 10 ms, ... 100 s: one a decade gives the logarithm to 3e-4 of the step


class Creep(PiezoParameters):
    """Creep by the log law, as poles."""

    creep: float = Field(0.015, ge=0, lt=0.1, description="part of a step that follows in every decade of time")


CONSTANTS = record("creep", *(f"decay_{i}" for i in range(POLES)))
STATE = record(*(f"slow_{i}" for i in range(POLES)), vectors=tuple(f"slow_{i}" for i in range(POLES)))


def values(parameters: Any) -> dict[str, float]:
    T = parameters.detector.sample_period
    return {"creep": parameters.piezo.creep} | {f"decay_{i}": -math.expm1(-T / 10.0 ** (i - 3)) for i in range(POLES)}


@kernel
def follow(slow, decay, u, axis):
    """One pole, an exact step under a held drive; what it has crept."""
    slow[axis] += decay * (u - slow[axis])
    return slow[axis]


@kernel
def actuate(t, u, v, p, s):
    for axis in range(3):
        w = u.voltage[axis]
        crept = follow(s.slow_0, p.decay_0, w, axis) + follow(s.slow_1, p.decay_1, w, axis)
        crept += follow(s.slow_2, p.decay_2, w, axis) + follow(s.slow_3, p.decay_3, w, axis)
        crept += follow(s.slow_4, p.decay_4, w, axis) + follow(s.slow_5, p.decay_5, w, axis)
        v.voltage[axis] = w + p.creep * crept


CREEP = Piezo(
    name="creep",
    parameters=Creep,
    constants=CONSTANTS,
    state=STATE,
    values=values,
    actuate=actuate,
    channels=(Channel("truth/creep_x", "V", "slow_1.x"),),
)
