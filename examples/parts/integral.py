"""A z loop of your own, onboard.kind integral:INTEGRAL: an integrator that can be set a setpoint in volts only."""

import math
from typing import Annotated

from afm_model.parts import Field, Onboard, OnboardParameters, Record, Unit, kernel
from afm_model.parts.signals import FOLLOW, GIVEN, HOLD


class Integral(OnboardParameters):
    target: Annotated[float, Unit("V")] = Field(5.0, description="deflection that it keeps")
    bandwidth: Annotated[float, Unit("Hz")] = Field(200.0, gt=0, description="at which it crosses over")
    range: Annotated[float, Unit("m")] = Field(5e-6, gt=0, description="of z to both sides")


class Constants(Record):
    target: Annotated[float, "V"]
    step: Annotated[float, "m/V"]
    range: Annotated[float, "m"]
    metres: Annotated[float, "m/V"]


class State(Record):
    z: Annotated[float, "m"]
    error: Annotated[float, "V"]
    mode: float
    origin: Annotated[float, "m"]


def values(parameters):
    detector = parameters.detector
    step = 2.0 * math.pi * parameters.onboard.bandwidth * detector.sample_period * detector.deflection_sensitivity
    return {"step": step, "metres": parameters.piezo.sensitivity_z}


@kernel
def regulate(t, d, r, u, p, s):
    s.error = p.target - d.deflection_voltage
    if r.z_mode != s.mode:
        s.mode, s.origin = r.z_mode, s.z - r.z_offset
    if r.z_mode == GIVEN:
        s.z = p.metres * u.voltage[2]
        return
    if r.z_mode == FOLLOW:
        s.z += p.step * s.error
    elif r.z_mode != HOLD:
        s.z = s.origin + r.z_offset
    s.z = min(max(s.z, -p.range), p.range)
    u.voltage[2] = s.z / p.metres


INTEGRAL = Onboard(
    parameters=Integral,
    constants=Constants,
    state=State,
    values=values,
    regulate=regulate,
    moves_z=True,
    settings={"setpoint_voltage": "target"},
)
