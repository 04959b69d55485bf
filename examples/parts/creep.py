"""A piezo of your own: it creeps. After a step it goes on by `creep` of the step in every decade of time.

piezo.kind: creep:CREEP
"""

import math
from typing import Annotated, Any

from afm_model.parts import Array, Channel, Field, Piezo, PiezoParameters, Record, kernel

POLES = 6  # time constants 1 ms, 10 ms, ... 100 s: one a decade gives the logarithm to 3e-4 of the step


class Creep(PiezoParameters):
    """Creep by the log law, as poles."""

    creep: float = Field(0.015, ge=0, lt=0.1, description="part of a step that follows in every decade of time")


class Constants(Record):
    creep: float
    decay: Annotated[Array, (POLES,)]


class State(Record):
    slow: Annotated[Array, (POLES, 3), "V"]


def values(parameters: Any) -> dict[str, Any]:
    T = parameters.detector.sample_period
    return {"decay": [-math.expm1(-T / 10.0 ** (i - 3)) for i in range(POLES)]}


@kernel
def actuate(t, u, v, p, s):
    for axis in range(3):
        crept = 0.0
        for i in range(POLES):  # an exact step under a held drive
            s.slow[i, axis] += p.decay[i] * (u.voltage[axis] - s.slow[i, axis])
            crept += s.slow[i, axis]
        v.voltage[axis] = u.voltage[axis] + p.creep * crept


CREEP = Piezo(
    parameters=Creep,
    constants=Constants,
    state=State,
    values=values,
    actuate=actuate,
    channels=(Channel("truth/creep_x", "V", "slow.x"),),
)
