"""A plant of your own, plant.kind coupled:COUPLED: a scanner whose x and y couple; the tip rests on a flat sample."""

import math
from typing import Annotated

from afm_model.parts import Field, Plant, PlantParameters, Record, Vector, kernel, square


class Coupled(PlantParameters):
    x_by_y: float = Field(0.03, ge=-0.5, le=0.5, description="share of the drive of y that also moves x")
    y_by_x: float = Field(0.05, ge=-0.5, le=0.5, description="share of the drive of x that also moves y")


class Constants(Record):
    dt: Annotated[float, "s"]
    x_by_y: float
    y_by_x: float
    w: Annotated[Vector, "rad/s"]
    c: Annotated[Vector, "1/s"]
    metres: Annotated[Vector, "m/V"]


class State(Record):
    x: Annotated[Vector, "m"]
    v: Annotated[Vector, "m/s"]


def values(parameters):
    scanner = parameters.scanner
    w = [2.0 * math.pi * f for f in scanner.frequencies]
    c = [2.0 * xi * w_i for xi, w_i in zip(scanner.damping_ratios, w, strict=True)]
    return {"w": w, "c": c, "metres": parameters.piezo.sensitivities}


@kernel
def step(t, v, r, p, s, m):
    for axis in range(3):
        moved = p.metres[axis] * v.voltage[axis]
        if axis == 0:
            moved += p.x_by_y * p.metres[1] * v.voltage[1]
        elif axis == 1:
            moved += p.y_by_x * p.metres[0] * v.voltage[0]
        s.v[axis] += p.dt * (square(p.w[axis]) * (moved - s.x[axis]) - p.c[axis] * s.v[axis])
        s.x[axis] += p.dt * s.v[axis]


@kernel
def observe(p, s, o):
    for axis in range(3):
        o.position[axis], o.velocity[axis] = s.x[axis], s.v[axis]
    o.tip_height, o.tip_rate, o.contact = s.x[2], s.v[2], 1.0


COUPLED = Plant(parameters=Coupled, constants=Constants, state=State, values=values, step=step, observe=observe)
