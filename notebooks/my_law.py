"""A law of one's own, law.kind my_law:MINE: PD, and what the last drive did not move is taken for friction."""

import math
from typing import Any

from pydantic import Field

from afm_model.law import SampledLaw
from afm_model.parts import Law, Record, Vector, kernel


class MineParameters(SampledLaw):
    """Its own parameters; law.period comes from SampledLaw, and from the plant if left out."""

    kind: str = Field("my_law:MINE", description="control law")
    slowness: float = Field(4.0, gt=0, description="time constant of the loop over control period and delay")


class Constants(Record):
    period: float
    tau: float
    stiffness: Vector
    damping: Vector
    volts: Vector


class State(Record):
    velocity: Vector
    asked: Vector
    started: float


def values(parameters: Any) -> dict[str, Any]:
    """The scanner as it was told: stiffness and damping over mass, and volts for an acceleration of 1 m/s^2."""
    law, scanner, piezo = parameters.law, parameters.scanner, parameters.piezo
    w = [2.0 * math.pi * getattr(scanner, f"f_{axis}") for axis in "xyz"]
    return {
        "period": law.period,
        "tau": law.slowness * (1 + law.delay_ticks) * law.period,
        "stiffness": [each**2 for each in w],
        "damping": [2.0 * getattr(scanner, f"xi_{axis}") * each for axis, each in zip("xyz", w, strict=True)],
        "volts": [1.0 / (each**2 * getattr(piezo, f"sensitivity_{axis}")) for axis, each in zip("xyz", w, strict=True)],
    }


@kernel
def control(t: float, y: Any, u: Any, p: Any, s: Any) -> None:
    """Write the drive that answers measurement y of time t. [m/s^2] until the last line."""
    for axis in range(2):
        held = p.stiffness[axis] * y.position[axis] + p.damping[axis] * y.velocity[axis]
        # What was asked for, less what the scanner did of it: friction, over the mass.
        friction = 0.0
        if s.started != 0.0:
            friction = s.asked[axis] - held - (y.velocity[axis] - s.velocity[axis]) / p.period
        error = y.reference_position[axis] - y.position[axis]
        rate = y.reference_velocity[axis] - y.velocity[axis]
        wanted = y.reference_acceleration[axis] + error / p.tau**2 + 2.0 * rate / p.tau
        s.asked[axis] = wanted + held + friction
        s.velocity[axis] = y.velocity[axis]
        u.voltage[axis] = p.volts[axis] * s.asked[axis]
    u.voltage[2] = y.drive[2]  # z stays as it is
    s.started = 1.0


MINE = Law(
    name="mine",
    parameters=MineParameters,
    constants=Constants,
    state=State,
    values=values,
    control=control,
    knowledge="positions and velocities of the scanner; its resonances and damping",
)
