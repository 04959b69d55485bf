"""Parameters of the control laws of section 3 of the paper (its equation (6))."""

from typing import Literal

from pydantic import Field

from .physics import Cantilever, Piezo, Scales, Scanner
from .run import Process
from .schema import Group, NonNegative, Positive


class Law(Group):
    """Law and gains, in the paper's nondimensional units. All may change while the controller runs."""

    kind: Literal["open_loop", "sgn", "tanh"] = Field(
        "tanh", description="open_loop: U = reference; sgn: the paper's (6); tanh: sgn replaced by tanh(alpha s)"
    )
    c_x: Positive = Field(1.0, description="position gain along x")
    cdot_x: Positive = Field(1.0, description="velocity gain along x")
    c_y: Positive = Field(1.0, description="position gain along y")
    cdot_y: Positive = Field(1.0, description="velocity gain along y")
    c_z: Positive = Field(2.0, description="position gain along z")
    cdot_z: Positive = Field(3.0, description="velocity gain along z")
    M_x: NonNegative = Field(15.0, description="switching gain along x, a bound on |f_x|")
    M_y: NonNegative = Field(15.0, description="switching gain along y, a bound on |f_y|")
    M_z: NonNegative = Field(0.05, description="switching gain along z, a bound on |f_z|")
    alpha: Positive = Field(
        10.0,
        description="steepness of tanh along x and y; with the other gains as they are it chatters beyond "
        "0.2 / (w0 plant.control_period), see docs/theory.md C17",
    )
    alpha_z: Positive = Field(10.0, description="steepness of tanh along z")
    z_rate: Literal["sample", "tip"] = Field(
        "sample", description="rate fed back along z: of the sample (piezo sensor) or of the tip (deflection)"
    )


class ControllerParameters(Group):
    """The law and what the controller believes of the microscope."""

    law: Law = Law()
    scanner: Scanner = Scanner()
    cantilever: Cantilever = Cantilever()
    scales: Scales = Scales()
    piezo: Piezo = Piezo()
    process: Process = Process()
