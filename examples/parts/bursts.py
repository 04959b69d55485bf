"""A fault of your own, by seed, fault.kind bursts:BURSTS: bursts of noise on the deflection, drives that get lost."""

from typing import Annotated

import numpy as np

from afm_model.parts import Fault, FaultParameters, Field, Record, Unit, Vector, kernel


class Bursts(FaultParameters):
    rate: Annotated[float, Unit("Hz")] = Field(100.0, ge=0, description="bursts per second of simulated time")
    length: Annotated[float, Unit("s")] = Field(1e-3, gt=0, description="how long a burst lasts")
    noise: Annotated[float, Unit("m")] = Field(1e-9, ge=0, description="rms noise of the deflection in a burst")
    loss: float = Field(0.1, ge=0, le=1, description="part of the drives that get lost, the last one holds")


class Constants(Record):
    probability: float
    length: Annotated[float, "s"]
    noise: Annotated[float, "m"]
    loss: float


class State(Record):
    until: Annotated[float, "s"]
    last: Annotated[Vector, "V"]


def values(parameters):
    return {"probability": parameters.fault.rate * parameters.plant.control_period}


def draw(parameters, generator, ticks):
    """Of each tick: whether a burst begins, its noise, whether the drive gets lost."""
    return np.column_stack([generator.random(ticks), generator.standard_normal(ticks), generator.random(ticks)])


@kernel
def on_measurement(k, t, y, e, p, s, r):
    if r[0] < p.probability:
        s.until = t + p.length
    if t < s.until:
        y.deflection += p.noise * r[1]


@kernel
def on_drive(k, t, u, p, s, r):
    for axis in range(3):
        if r[2] < p.loss and t > 0.0:
            u.voltage[axis] = s.last[axis]
        s.last[axis] = u.voltage[axis]


_functions = {"draw": draw, "on_measurement": on_measurement, "on_drive": on_drive}
BURSTS = Fault(parameters=Bursts, constants=Constants, state=State, values=values, draws=3, **_functions)
