"""Periodic reference: sine and triangle start at zero, a constant is there at once. The setpoint stays as it is."""

import math
from typing import Annotated, Literal

from annotated_types import Gt, Lt
from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Record
from ..core.elementary import sincos
from ..core.schema import NonNegative, Unit
from ..parts.groups import ProgramParameters
from ..parts.part import Numbers, Program, Tree
from ..parts.signals import Setpoint

SINE, TRIANGLE, CONSTANT = range(3)
SHAPES = {"sine": SINE, "triangle": TRIANGLE, "constant": CONSTANT}
Shape = Literal["sine", "triangle", "constant"]
Amplitude = Annotated[float, Gt(-1e-3), Lt(1e-3), Unit("m")]
"""Beyond a millimetre no scanner goes."""


class Reference(ProgramParameters):
    """Reference trajectory of the scanner, and the setpoint of the tip height."""

    shape_x: Shape = Field("sine", description="waveform along x")
    shape_y: Shape = Field("sine", description="waveform along y")
    amplitude_x: Amplitude = Field(5e-9, description="amplitude along x (paper: 20 x0)")
    amplitude_y: Amplitude = Field(5e-9, description="amplitude along y (paper: 20 y0)")
    omega_x: Annotated[NonNegative, Unit("rad/s")] = Field(50.0, description="angular frequency along x")
    omega_y: Annotated[NonNegative, Unit("rad/s")] = Field(50.0, description="angular frequency along y")

    @property
    def period(self) -> float:
        """Period of x, the fast axis [s]; 0 if x does not move periodically."""
        if self.shape_x == "constant" or self.omega_x == 0.0:
            return 0.0
        return 2.0 * math.pi / self.omega_x

    @property
    def amplitude(self) -> tuple[float, float]:
        """Amplitude along x and y [m]."""
        return self.amplitude_x, self.amplitude_y

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity along x and y where both are fastest, at the start [m/s]."""
        part = {"sine": 1.0, "triangle": 2.0 / math.pi, "constant": 0.0}
        return (
            part[self.shape_x] * self.amplitude_x * self.omega_x,
            part[self.shape_y] * self.amplitude_y * self.omega_y,
        )

    @property
    def top_speed(self) -> float:
        """Largest of the speeds along x and y [m/s]."""
        return max(map(abs, self.velocity))


class Constants(Record):
    shape_x: float
    shape_y: float
    amplitude_x: Annotated[float, "m"]
    amplitude_y: Annotated[float, "m"]
    omega_x: Annotated[float, "rad/s"]
    omega_y: Annotated[float, "rad/s"]
    z_r: Annotated[float, "m"]


def _values(parameters: Tree) -> Numbers:
    reference = parameters.reference
    return {"shape_x": SHAPES[reference.shape_x], "shape_y": SHAPES[reference.shape_y]}


@kernel
def waveform(shape: float, amplitude: float, omega: float, t: float) -> tuple[float, float, float]:
    """Position, velocity and acceleration of a reference at time t.

    Parameters
    ----------
    shape : SINE, TRIANGLE or CONSTANT
    amplitude : float [m]
    omega : float [rad/s]
    t : float [s]

    Returns
    -------
    (position, velocity, acceleration) : floats [m], [m/s], [m/s^2]
        The acceleration of the triangle is given as 0; at its corners it does not exist.
    """
    if shape == CONSTANT:
        return amplitude, 0.0, 0.0
    phase = omega * t
    if shape == SINE:
        sine, cosine = sincos(phase)
        return amplitude * sine, amplitude * omega * cosine, -amplitude * omega * omega * sine
    # Of the period, counted from the lowest place.
    part = phase * (0.5 / math.pi) + 0.25
    part -= math.floor(part)
    slope = amplitude * omega * 2.0 / math.pi
    return amplitude * (1.0 - 4.0 * abs(part - 0.5)), slope if part < 0.5 else -slope, 0.0


@kernel
def reference(t: float, r: Setpoint, p: Constants) -> None:
    """See `afm_model.parts.Program`."""
    r.position[0], r.velocity[0], r.acceleration[0] = waveform(p.shape_x, p.amplitude_x, p.omega_x, t)
    r.position[1], r.velocity[1], r.acceleration[1] = waveform(p.shape_y, p.amplitude_y, p.omega_y, t)
    r.position[2] = p.z_r
    r.velocity[2] = 0.0
    r.acceleration[2] = 0.0


PERIODIC = Program(name="periodic", parameters=Reference, constants=Constants, values=_values, reference=reference)
