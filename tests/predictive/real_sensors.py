"""What real sensors, contacts and scanners do that no parameter of the microscope has: parts for tests of the law."""

import dataclasses
from typing import Annotated

from afm_model.parts import Fault, FaultParameters, Field, Record, Unit, kernel
from afm_model.plant import COMPLIANT


class _Outliers(FaultParameters):
    rate: float = Field(1e-3, ge=0, description="outliers per measurement")
    lateral_force: Annotated[float, Unit("N")] = Field(0.0, ge=0, description="their size")
    deflection: Annotated[float, Unit("m")] = Field(0.0, ge=0, description="their size")
    position: Annotated[float, Unit("m")] = Field(0.0, ge=0, description="their size, along x and -y")


class _Sizes(Record):
    rate: float
    lateral_force: Annotated[float, "N"]
    deflection: Annotated[float, "m"]
    position: Annotated[float, "m"]


@kernel
def _add_outlier(k, t, y, e, p, s, r):
    if r[0] < p.rate:
        sign = 1.0 if r[1] < 0.5 else -1.0
        y.lateral_force += sign * p.lateral_force
        y.deflection += sign * p.deflection
        y.position[0] += sign * p.position
        y.position[1] -= sign * p.position


OUTLIERS = Fault(
    parameters=_Outliers,
    constants=_Sizes,
    draws=2,
    draw=lambda parameters, generator, ticks: generator.random((ticks, 2)),
    on_measurement=_add_outlier,
)


class _Real(COMPLIANT.parameters):
    slow: float = Field(0.0, description="part of friction that is missing at a low speed")
    speed: Annotated[float, Unit("m/s")] = Field(50e-9, description="below this one")
    one_way: float = Field(0.0, description="part by which friction is stronger along +x")
    anisotropy: float = Field(0.0, description="part by which friction is stronger along x than along y")
    coupling: float = Field(0.0, description="part of the drive of x that moves y, and of y that moves x")


_OWN = ("slow", "one_way", "anisotropy", "coupling")


class _Constants(COMPLIANT.constants):
    slow: float
    speed: Annotated[float, "x0 w0"]
    one_way: float
    anisotropy: float
    coupling: float


def _values(parameters):
    own, scales = parameters.plant, parameters.scales
    more = {name: getattr(own, name) for name in _OWN} | {"speed": own.speed / (scales.x0 * scales.w0)}
    return COMPLIANT.values(parameters) | more


_compliant = COMPLIANT.step


@kernel
def _step(t, v, unused, p, s, m):
    """Step as `compliant` does, with a drive and a friction of this motion."""
    u_x, u_y, f_s = v.voltage[0], v.voltage[1], p.f_s
    v.voltage[0], v.voltage[1] = u_x + p.coupling * u_y, u_y + p.coupling * u_x
    # The direction of friction: of the motion, at rest of what pushes.
    b_x, b_y, speed2 = s.V_X, s.V_Y, s.V_X * s.V_X + s.V_Y * s.V_Y
    if speed2 == 0.0:
        b_x, b_y = p.gain_x * v.voltage[0] - p.spring_x * s.X, p.gain_y * v.voltage[1] - p.spring_y * s.Y
    size2 = b_x * b_x + b_y * b_y
    along_x = b_x * b_x / size2 if size2 > 0.0 else 0.5
    p.f_s *= 1.0 + p.anisotropy * (along_x - 0.5)
    if speed2 < p.speed * p.speed:
        p.f_s *= 1.0 - p.slow
    if b_x > 0.0:
        p.f_s *= 1.0 + p.one_way
    _compliant(t, v, unused, p, s, m)
    p.f_s, v.voltage[0], v.voltage[1] = f_s, u_x, u_y


REAL = dataclasses.replace(
    COMPLIANT, name="real", parameters=_Real, constants=_Constants, values=_values, step=_step, lanes=False
)
