"""A detector of your own: an ideal photodiode with a lock-in amplifier behind it, detector.kind lock_in:LOCK_IN.

The deflection is multiplied by cosine and sine of the reference frequency and low-passed twice. With the deflection
A cos(2 pi f t + phi), the channels `lock_in_amplitude` and `lock_in_phase` settle to A [m] and phi [rad].
"""

import math
from typing import Annotated

from afm_model.parts import Channel, Detector, DetectorParameters, Field, Record, Unit, Vector, kernel


class LockIn(DetectorParameters):
    frequency: Annotated[float, Unit("Hz")] = Field(1e3, gt=0, description="reference frequency")
    time_constant: Annotated[float, Unit("s")] = Field(2e-3, gt=0, description="of each of the two low-passes")


class Constants(Record):
    a: Annotated[float, "m"]
    deflection_sensitivity: Annotated[float, "m/V"]
    lateral_sensitivity: Annotated[float, "N/V"]
    turn: Annotated[float, "rad"]
    share: float


class State(Record):
    angle: Annotated[float, "rad"]
    in_phase: Annotated[Vector, "m"]
    quadrature: Annotated[Vector, "m"]
    amplitude: Annotated[float, "m"]
    phase: Annotated[float, "rad"]


def values(parameters):
    d = parameters.detector
    turn = 2.0 * math.pi * d.frequency * d.sample_period
    return {"a": parameters.cantilever.a, "turn": turn, "share": -math.expm1(-d.sample_period / d.time_constant)}


@kernel
def low_pass(stages, share, x):
    stages[0] += share * (x - stages[0])
    stages[1] += share * (stages[0] - stages[1])
    return stages[1]


@kernel
def detect(o, d, p, s, r):
    z = o.tip_height - p.a + o.deflection_excess
    d.deflection_voltage = z / p.deflection_sensitivity
    d.lateral_voltage = (o.friction[0] + o.lateral_excess) / p.lateral_sensitivity
    x = low_pass(s.in_phase, p.share, 2.0 * z * math.cos(s.angle))
    y = low_pass(s.quadrature, p.share, -2.0 * z * math.sin(s.angle))
    s.amplitude, s.phase = math.sqrt(x * x + y * y), math.atan2(y, x)
    s.angle = (s.angle + p.turn) % (2.0 * math.pi)


CHANNELS = (Channel("lock_in_amplitude", "m", "amplitude"), Channel("lock_in_phase", "rad", "phase"))
_own = {"constants": Constants, "state": State, "channels": CHANNELS, "values": values, "detect": detect}
LOCK_IN = Detector(parameters=LockIn, noisy=lambda _: False, ideal=lambda _: True, **_own)
