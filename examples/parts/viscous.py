"""A plant of your own, plant.kind viscous:VISCOUS: a scanner in a viscous film, the tip following the surface."""

import math
from typing import Annotated

from pydantic import Field

from afm_model.parts import Plant, PlantParameters, Record, Unit, Vector, kernel, surface


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
    scanner, piezo, scales = parameters.scanner, parameters.piezo, parameters.scales
    w = [2.0 * math.pi * getattr(scanner, f"f_{axis}") for axis in "xyz"]
    c = [2.0 * getattr(scanner, f"xi_{axis}") * w_i for axis, w_i in zip("xyz", w, strict=True)]
    metres = [getattr(piezo, f"sensitivity_{axis}") for axis in "xyz"]
    mass = scanner.mass_ratio * parameters.cantilever.m_c
    numbers = {"dt": parameters.plant.dt, "x0": scales.x0, "z0": scales.z0, "film": parameters.plant.film, "mass": mass}
    return numbers | {"w": w, "c": c, "metres": metres}


def rest(parameters, p, s, m):
    return 0.0, 0.0, 0.0


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


_functions = {"rest": rest, "step": step, "observe": observe}
VISCOUS = Plant(name="viscous", parameters=Viscous, constants=Constants, state=State, values=values, **_functions)
