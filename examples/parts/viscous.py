"""A plant of your own, plant.kind viscous:VISCOUS: a scanner in a viscous film, the tip following the surface."""

import math
from typing import Annotated

from afm_model.parts import Field, Plant, PlantParameters, Record, Unit, Vector, kernel, surface


class Viscous(PlantParameters):
    film: Annotated[float, Unit("1/s")] = Field(3e3, ge=0, description="damping of the film, force per mass and speed")


class Constants(Record):
    dt: Annotated[float, "s"]
    x0: Annotated[float, "m"]
    z0: Annotated[float, "m"]
    film: Annotated[float, "1/s"]
    mass: Annotated[float, "kg"]
    w: Annotated[Vector, "rad/s"]
    c: Annotated[Vector, "1/s"]
    metres: Annotated[Vector, "m/V"]


class State(Record):
    x: Annotated[Vector, "m"]
    v: Annotated[Vector, "m/s"]
    tip: Annotated[float, "m"]
    tip_rate: Annotated[float, "m/s"]


def values(parameters):
    scanner = parameters.scanner
    w = [2.0 * math.pi * f for f in scanner.frequencies]
    c = [2.0 * xi * w_i for xi, w_i in zip(scanner.damping_ratios, w, strict=True)]
    mass = scanner.mass_ratio * parameters.cantilever.m_c
    return {"mass": mass, "w": w, "c": c, "metres": parameters.piezo.sensitivities}


@kernel
def step(t, v, r, p, s, m):
    for axis in range(3):
        w2 = p.w[axis] * p.w[axis]
        damping = p.c[axis] + (p.film if axis < 2 else 0.0)
        s.v[axis] += p.dt * (w2 * (p.metres[axis] * v.voltage[axis] - s.x[axis]) - damping * s.v[axis])
        s.x[axis] += p.dt * s.v[axis]
    h = surface(s.x[0] / p.x0, s.x[1] / p.x0, m)
    s.tip = s.x[2] + h.height * p.z0
    s.tip_rate = s.v[2] + (h.slope_x * s.v[0] + h.slope_y * s.v[1]) * p.z0 / p.x0


@kernel
def observe(p, s, o):
    for axis in range(3):
        o.position[axis], o.velocity[axis] = s.x[axis], s.v[axis]
        o.friction[axis] = -p.film * p.mass * s.v[axis] if axis < 2 else 0.0
    o.tip_height, o.tip_rate, o.contact = s.tip, s.tip_rate, 1.0


VISCOUS = Plant(parameters=Viscous, constants=Constants, state=State, values=values, step=step, observe=observe)
