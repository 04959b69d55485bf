"""The paper's control laws, docs/theory.md (28), from a measurement in SI to a piezo drive in volts."""

import math
from collections import defaultdict
from typing import Annotated, Any, Literal

from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Record, Vector
from ..core.elementary import square, tanh
from ..core.schema import NonNegative, Positive
from ..parts.groups import LawParameters
from ..parts.part import Law, Numbers, Tree
from ..parts.signals import Measurement, PiezoDrive
from .lyapunov import lyapunov_matrix

OPEN_LOOP, SGN, TANH = range(3)
KINDS = {"open_loop": OPEN_LOOP, "sgn": SGN, "tanh": TANH}


class PaperLaw(LawParameters):
    """Law and gains, in the paper's nondimensional units. All may change while the controller runs."""

    kind: str = Field(
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


class Constants(Record):
    """Nondimensional gains and the microscope; vectors are of x, y and z."""

    kind: float  # OPEN_LOOP, SGN or TANH
    tip_rate: float  # whether the rate along z is that of the tip
    c: Vector
    cdot: Vector
    p2: Vector
    p4: Vector
    M: Vector
    alpha: Vector
    eta: Annotated[Vector, "w0"]
    xi: Vector
    volts: Annotated[Vector, "V"]  # drive per unit of U
    eta_c: Annotated[float, "w0"]
    mu: Annotated[float, "1"]
    a: Annotated[float, "z0"]
    x0: Annotated[float, "m"]
    z0: Annotated[float, "m"]
    w0: Annotated[float, "rad/s"]


def _values(parameters: Tree) -> Numbers:
    law = parameters.law
    scanner, scales = parameters.scanner, parameters.scales
    values: dict[str, Any] = {
        "kind": KINDS[law.kind],
        "tip_rate": law.z_rate == "tip",
        "eta_c": 2.0 * math.pi * parameters.cantilever.f_c / scales.w0,
        "mu": scanner.mass_ratio,
        "a": parameters.cantilever.a / scales.z0,
    }
    vectors: dict[str, list[float]] = defaultdict(list)
    for axis, length in (("x", scales.x0), ("y", scales.x0), ("z", scales.z0)):
        c, cdot = getattr(law, f"c_{axis}"), getattr(law, f"cdot_{axis}")
        P = lyapunov_matrix(c, cdot)
        eta = 2.0 * math.pi * getattr(scanner, f"f_{axis}") / scales.w0
        of_axis = {
            "c": c,
            "cdot": cdot,
            "p2": P[0, 1],
            "p4": P[1, 1],
            "M": getattr(law, f"M_{axis}"),
            "alpha": law.alpha_z if axis == "z" else law.alpha,
            "eta": eta,
            "xi": getattr(scanner, f"xi_{axis}"),
            # Static displacement is U / eta^2 in units of length.
            "volts": length / (square(eta) * getattr(parameters.piezo, f"sensitivity_{axis}")),
        }
        for name, value in of_axis.items():
            vectors[name].append(float(value))
    return values | vectors


@kernel
def switching(kind: float, s: float, alpha: float) -> float:
    """sgn(s), or tanh(alpha s) in its place."""
    if kind == TANH:
        return tanh(alpha * s)
    if s > 0.0:
        return 1.0
    return -1.0 if s < 0.0 else 0.0


@kernel
def control(t: float, y: Measurement, u: PiezoDrive, g: Constants, s: Record) -> None:
    """See `afm_model.parts.Law`.

    open_loop: U_x = x_r, U_y = y_r as in section 4.1 of the paper; the z drive stays as it is.
    sgn, tanh: docs/theory.md (28), (31), with v = -M sgn(s) or -M tanh(alpha s), s = p_2 e + p_4 e'.
    """
    x_r = y.reference_position[0] / g.x0
    y_r = y.reference_position[1] / g.x0
    if g.kind == OPEN_LOOP:
        u.voltage[0] = g.volts[0] * x_r
        u.voltage[1] = g.volts[1] * y_r
        u.voltage[2] = y.drive[2]
        return

    speed = g.x0 * g.w0
    acceleration = speed * g.w0

    # x
    x1 = y.position[0] / g.x0
    x2 = y.velocity[0] / speed
    e = x1 - x_r
    e_rate = x2 - y.reference_velocity[0] / speed
    v = -g.M[0] * switching(g.kind, g.p2[0] * e + g.p4[0] * e_rate, g.alpha[0])
    feedforward = y.reference_acceleration[0] / acceleration
    u.voltage[0] = g.volts[0] * (
        -g.c[0] * e - g.cdot[0] * e_rate + feedforward + g.eta[0] * g.eta[0] * x1 + 2.0 * g.xi[0] * g.eta[0] * x2 + v
    )

    # y
    x3 = y.position[1] / g.x0
    x4 = y.velocity[1] / speed
    e = x3 - y_r
    e_rate = x4 - y.reference_velocity[1] / speed
    v = -g.M[1] * switching(g.kind, g.p2[1] * e + g.p4[1] * e_rate, g.alpha[1])
    feedforward = y.reference_acceleration[1] / acceleration
    u.voltage[1] = g.volts[1] * (
        -g.c[1] * e - g.cdot[1] * e_rate + feedforward + g.eta[1] * g.eta[1] * x3 + 2.0 * g.xi[1] * g.eta[1] * x4 + v
    )

    # z: the tip height z_c = a + deflection is driven to the setpoint
    x5 = g.a + y.deflection / g.z0
    rate = y.deflection_rate if g.tip_rate else y.velocity[2]
    x6 = rate / (g.z0 * g.w0)
    e = x5 - y.reference_position[2] / g.z0
    v = -g.M[2] * switching(g.kind, g.p2[2] * e + g.p4[2] * x6, g.alpha[2])
    u.voltage[2] = g.volts[2] * (
        (g.eta[2] * g.eta[2] + g.eta_c * g.eta_c / g.mu) * x5
        + 2.0 * g.xi[2] * g.eta[2] * x6
        + (1.0 + 1.0 / g.mu) * (-g.c[2] * e - g.cdot[2] * x6 + v)
    )


def _warnings(parameters: Tree, control_period: float) -> list[str]:
    """Limits of a held drive, docs/theory.md C17: beyond them the continuous-time law is another one."""
    law, hold = parameters.law, parameters.scales.w0 * control_period
    if law.kind == "open_loop":
        return []
    told = [
        f"along {axis} the loop diverges: law.cdot_{axis} w0 plant.control_period = {rate * hold:.3g} must be < 2 "
        f"(law.cdot_{axis} = {rate:g}, plant.control_period = {control_period:g} s)"
        for axis, rate in (("x", law.cdot_x), ("y", law.cdot_y), ("z", law.cdot_z))
        if rate * hold >= 2.0
    ]
    if law.kind == "tanh" and law.alpha * hold > 0.2:
        told.append(
            f"along x and y the drive chatters: law.alpha w0 plant.control_period = {law.alpha * hold:.3g} should be "
            f"<= 0.2 (law.alpha = {law.alpha:g}, plant.control_period = {control_period:g} s)"
        )
    return told


def _law(name: str) -> Law:
    return Law(name=name, parameters=PaperLaw, constants=Constants, values=_values, warnings=_warnings, control=control)


PARTS = tuple(_law(name) for name in KINDS)
