"""A law of your own, law.kind kalman:KALMAN: Kalman filter on noisy position, PD with feedforward."""

import math
from typing import Annotated

import numpy as np
from pydantic import Field
from scipy.linalg import solve_discrete_are

from afm_model.law import SampledLaw
from afm_model.parts import Law, Record, Unit, Vector, kernel


class Kalman(SampledLaw):
    """Gains and noise of the filter, which is made for law.period."""

    bandwidth: Annotated[float, Unit("rad/s")] = Field(1e4, gt=0, description="bandwidth of the loop along x and y")
    position_noise: Annotated[float, Unit("m")] = Field(5e-11, gt=0, description="rms noise of the position sensors")
    jerk: Annotated[float, Unit("m/s^2")] = Field(0.5, gt=0, description="rms acceleration that the filter expects")


class Constants(Record):
    period: Annotated[float, "s"]
    gain: float
    gain_rate: Annotated[float, "1/s"]
    kp: Annotated[float, "1/s^2"]
    kd: Annotated[float, "1/s"]
    volts_x: Annotated[float, "V s^2/m"]
    volts_y: Annotated[float, "V s^2/m"]
    w_x: Annotated[float, "rad/s"]
    w_y: Annotated[float, "rad/s"]


class State(Record):
    started: float
    position: Annotated[Vector, "m"]
    velocity: Annotated[Vector, "m/s"]


def values(parameters):
    law, scanner, piezo = parameters.law, parameters.scanner, parameters.piezo
    T = law.period
    A = np.array([[1.0, T], [0.0, 1.0]])
    Q = law.jerk**2 * np.array([[T**4 / 4.0, T**3 / 2.0], [T**3 / 2.0, T**2]])
    P = solve_discrete_are(A.T, np.array([[1.0], [0.0]]), Q, np.array([[law.position_noise**2]]))
    gain = P[:, 0] / (P[0, 0] + law.position_noise**2)
    w = {axis: 2.0 * math.pi * getattr(scanner, f"f_{axis}") for axis in "xy"}
    # Volts per acceleration: a static displacement of one sensitivity takes w^2 times it.
    volts = {f"volts_{axis}": 1.0 / (w[axis] ** 2 * getattr(piezo, f"sensitivity_{axis}")) for axis in "xy"}
    gains = {"period": T, "gain": gain[0], "gain_rate": gain[1]}
    return {**gains, **volts, "kp": law.bandwidth**2, "kd": 1.4 * law.bandwidth, "w_x": w["x"], "w_y": w["y"]}


@kernel
def control(t, y, u, p, s):
    for axis in range(2):
        if s.started == 0.0:
            s.position[axis] = y.position[axis]
        predicted = s.position[axis] + p.period * s.velocity[axis]
        innovation = y.position[axis] - predicted
        s.position[axis] = predicted + p.gain * innovation
        s.velocity[axis] += p.gain_rate * innovation
        w, volts = (p.w_x, p.volts_x) if axis == 0 else (p.w_y, p.volts_y)
        error = y.reference_position[axis] - s.position[axis]
        rate = y.reference_velocity[axis] - s.velocity[axis]
        acceleration = y.reference_acceleration[axis] + p.kp * error + p.kd * rate
        u.voltage[axis] = volts * (acceleration + w * w * s.position[axis])
    u.voltage[2] = y.drive[2]
    s.started = 1.0


KALMAN = Law(name="kalman", parameters=Kalman, constants=Constants, state=State, values=values, control=control)
