"""A program of your own: z goes to the sample until it pushes the cantilever, then the z loop follows its setpoint.

reference.kind: approach:APPROACH, with onboard.kind pi and plant.gap
"""

from typing import Annotated

from afm_model.parts import Channel, Field, Program, ProgramParameters, Record, Unit, kernel
from afm_model.parts.signals import OPEN


class Approach(ProgramParameters):
    rate: Annotated[float, Unit("m/s")] = Field(1e-6, gt=0, description="velocity of z towards the sample")
    touch: Annotated[float, Unit("V")] = Field(0.2, gt=0, description="deflection at which the tip has arrived")


class Constants(Record):
    rate: Annotated[float, "m/s"]
    touch: Annotated[float, "V"]
    z_r: Annotated[float, "m"]


class State(Record):
    arrived: float


@kernel
def reference(t, r, p):
    for axis in range(3):
        r.position[axis] = r.velocity[axis] = r.acceleration[axis] = 0.0
    r.position[2] = p.z_r


@kernel
def watch(t, d, r, p, s):
    if d.deflection_voltage > p.touch:
        s.arrived = 1.0
    if s.arrived == 0.0:
        r.z_mode, r.z_offset = OPEN, p.rate * t


APPROACH = Program(
    parameters=Approach,
    constants=Constants,
    state=State,
    reference=reference,
    watch=watch,
    channels=(Channel("arrived", "1", "arrived"),),
)
