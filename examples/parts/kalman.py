"""A law of your own, law.kind kalman:KALMAN: Kalman filter made for law.period, and PD with feedforward."""

from typing import Annotated

import numpy as np
from scipy.linalg import solve_discrete_are

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
    A = np.array([[1.0, T], [0.0, 1.0]])
    Q = law.jerk**2 * np.array([[T**4 / 4.0, T**3 / 2.0], [T**3 / 2.0, T**2]])
    P = solve_discrete_are(A.T, np.array([[1.0], [0.0]]), Q, np.array([[law.position_noise**2]]))
    gain = P[:, 0] / (P[0, 0] + law.position_noise**2)
    w = 2.0 * np.pi * np.array(parameters.scanner.frequencies)
    return {"gain": gain[0], "gain_rate": gain[1], "w": w, "volts": 1.0 / (w**2 * parameters.piezo.sensitivities)}


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
