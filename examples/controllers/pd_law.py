"""A law of your own, law.kind pd_law:PD: proportional-derivative tracking of x and y, tuned by scanner and period."""

import math
from typing import Any

from pydantic import Field

from afm_model.law import SampledLaw
from afm_model.parts import Law, Record, Vector, kernel


class PdParameters(SampledLaw):
    """Its own parameters; law.period and law.delay_ticks come from SampledLaw, and from the plant if left out."""

    kind: str = Field("pd_law:PD", description="control law")
    slowness: float = Field(4.0, gt=0, description="time constant of the loop over control period and delay")


class Constants(Record):
    kp: Vector
    kd: Vector


def values(parameters: Any) -> dict[str, Any]:
    """Gains [V/m], [V s/m]: acceleration a = e / tau^2 + 2 e' / tau, and volts by the mass of the scanner."""
    law, scanner, piezo = parameters.law, parameters.scanner, parameters.piezo
    tau = law.slowness * (1 + law.delay_ticks) * law.period
    per_volt = [(2.0 * math.pi * getattr(scanner, f"f_{i}")) ** 2 * getattr(piezo, f"sensitivity_{i}") for i in "xyz"]
    return {"kp": [1.0 / tau**2 / each for each in per_volt], "kd": [2.0 / tau / each for each in per_volt]}


@kernel
def control(t: float, y: Any, u: Any, p: Any, s: Any) -> None:
    """Write the drive that answers measurement y of time t."""
    for axis in range(2):
        error = y.reference_position[axis] - y.position[axis]
        rate = y.reference_velocity[axis] - y.velocity[axis]
        u.voltage[axis] = p.kp[axis] * error + p.kd[axis] * rate
    u.voltage[2] = y.drive[2]


def warnings(parameters: Any, control_period: float) -> list[str]:
    """What is told at the start of a run, a sentence each."""
    if parameters.law.slowness >= 1.0:
        return []
    return [f"the loop is faster than its samples: law.slowness = {parameters.law.slowness:g} should be >= 1"]


PD = Law(
    name="pd",
    parameters=PdParameters,
    constants=Constants,
    values=values,
    control=control,
    warnings=warnings,
    knowledge="positions and velocities of the scanner; its resonances",
)
