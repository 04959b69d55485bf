"""Parameters of the plants of this package."""

import math
from typing import Annotated, Literal

from pydantic import Field

from ..core.elementary import square
from ..core.schema import NonNegative, Unit
from ..parts.groups import PlantParameters
from .physics import PlantPhysics


class PlantGroup(PlantParameters):
    """Which equations of motion are integrated, and how finely."""

    kind: str = Field(
        "compliant", description="compliant: eight states, contact can be lost; paper: six states of the paper's (5)"
    )
    z: Literal["computed", "held", "uniform"] = Field(
        "computed",
        description="paper plant only: f_z computed; z held at the setpoint (4.1); f_z drawn in +-M_z (4.2)",
    )
    M_z: NonNegative = Field(0.05, description="bound of the drawn f_z [w0^2 z0], paper plant with z = uniform")
    gap: Annotated[NonNegative, Unit("m")] = Field(
        0.0,
        description="compliant plant only: distance from the sample at the start; 0: in static contact at the setpoint",
    )

    def own_spring_constant(self, parameters: PlantPhysics) -> float:
        """That of `cantilever.*` [N/m]."""
        return parameters.cantilever.m_c * square(2.0 * math.pi * parameters.cantilever.f_c)
