"""A plant of your own, plant.kind stribeck:STRIBECK: friction that falls with the speed, on a flat sample."""

import math
from typing import Annotated

from afm_model.parts import Field, Plant, PlantParameters, Record, Unit, Vector, exp, hypot, kernel, square


class Stribeck(PlantParameters):
    static: Annotated[float, Unit("N")] = Field(2e-7, ge=0, description="friction at which it begins to slide")
    kinetic: Annotated[float, Unit("N")] = Field(1e-7, ge=0, description="friction of a fast motion")
    speed: Annotated[float, Unit("m/s")] = Field(1e-7, gt=0, description="at which friction falls between them")


class Constants(Record):
    dt: Annotated[float, "s"]
    static: Annotated[float, "N"]
    kinetic: Annotated[float, "N"]
    speed: Annotated[float, "m/s"]
    mass: Annotated[float, "kg"]
    w: Annotated[Vector, "rad/s"]
    xi: Vector
    metres: Annotated[Vector, "m/V"]


class State(Record):
    x: Annotated[Vector, "m"]
    v: Annotated[Vector, "m/s"]
    bound: Annotated[float, "N"]
    friction: Annotated[Vector, "N"]


def values(parameters):
    scanner, mass = parameters.scanner, parameters.scanner.mass_ratio * parameters.cantilever.m_c
    w = [2.0 * math.pi * f for f in scanner.frequencies]
    return {"mass": mass, "w": w, "xi": scanner.damping_ratios, "metres": parameters.piezo.sensitivities}


@kernel
def step(t, v, r, p, s, m):
    s.bound = p.kinetic + (p.static - p.kinetic) * exp(-square(hypot(s.v[0], s.v[1]) / p.speed))
    for i in range(3):
        s.v[i] += p.dt * p.w[i] * (p.w[i] * (p.metres[i] * v.voltage[i] - s.x[i]) - 2.0 * p.xi[i] * s.v[i])
    speed = hypot(s.v[0], s.v[1])
    # Friction takes at most all of the motion: it never turns it round.
    kept = max(0.0, 1.0 - p.dt * s.bound / (p.mass * speed)) if speed > 0.0 else 1.0
    for i in range(3):
        s.friction[i] = (kept - 1.0) * s.v[i] * p.mass / p.dt if i < 2 else 0.0
        s.v[i] *= kept if i < 2 else 1.0
        s.x[i] += p.dt * s.v[i]


@kernel
def observe(p, s, o):
    o.position[:], o.velocity[:], o.friction[:] = s.x, s.v, s.friction
    o.friction_bound, o.tip_height, o.tip_rate, o.contact = s.bound, s.x[2], s.v[2], 1.0


STRIBECK = Plant(parameters=Stribeck, constants=Constants, state=State, values=values, step=step, observe=observe)
