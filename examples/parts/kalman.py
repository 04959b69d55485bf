"""A law of your own, law.kind kalman:KALMAN: Kalman filter made for law.period, and PD with feedforward."""

import math
from typing import Annotated

import numpy as np

from afm_model.law import SampledLaw
from afm_model.parts import Field, Law, Record, Unit, Vector, kernel


class Kalman(SampledLaw):
    bandwidth: Annotated[float, Unit("rad/s")] = Field(1e4, gt=0, description="bandwidth of the loop along x and y")
    position_noise: Annotated[float, Unit("m")] = Field(5e-11, gt=0, description="rms noise of the position sensors")
    jerk: Annotated[float, Unit("m/s^2")] = Field(0.5, gt=0, description="rms acceleration that the filter expects")


class Constants(Record):
    period: Annotated[float, "s"]
    gain: float
    gain_rate: Annotated[float, "1/s"]
    bandwidth: Annotated[float, "rad/s"]
    w: Annotated[Vector, "rad/s"]
    volts: Annotated[Vector, "V s^2/m"]  # drive per acceleration


class State(Record):
    started: float
    position: Annotated[Vector, "m"]
    velocity: Annotated[Vector, "m/s"]


def values(parameters):
    law, T = parameters.law, parameters.law.period
    # The steady Kalman filter in closed form: Kalata 1984, doi:10.1109/TAES.1984.310438.
    index = law.jerk * T * T / law.position_noise
    r = 0.25 * (4.0 + index - math.sqrt(8.0 * index + index * index))
    w = 2.0 * np.pi * np.array(parameters.scanner.frequencies)
    volts = 1.0 / (w * w * parameters.piezo.sensitivities)
    return {"gain": 1.0 - r * r, "gain_rate": 2.0 * (1.0 - r) * (1.0 - r) / T, "w": w, "volts": volts}


@kernel
def control(t, y, u, p, s):
    for axis in range(2):
        if s.started == 0.0:
            s.position[axis] = y.position[axis]
        predicted = s.position[axis] + p.period * s.velocity[axis]
        innovation = y.position[axis] - predicted
        s.position[axis] = predicted + p.gain * innovation
        s.velocity[axis] += p.gain_rate * innovation
        error = y.reference_position[axis] - s.position[axis]
        rate = y.reference_velocity[axis] - s.velocity[axis]
        acceleration = y.reference_acceleration[axis] + p.bandwidth**2 * error + 1.4 * p.bandwidth * rate
        u.voltage[axis] = p.volts[axis] * (acceleration + p.w[axis] ** 2 * s.position[axis])
    u.voltage[2] = y.drive[2]
    s.started = 1.0


KALMAN = Law(parameters=Kalman, constants=Constants, state=State, values=values, control=control)
