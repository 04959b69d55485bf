"""The z loop of a real microscope: proportional-integral feedback of the deflection, at the rate of the virtual ADC.

    error e = setpoint - deflection [V],  I' = integral_gain e,  z = I + proportional_gain e, within its limits

The limits of z are `low` and `high`, or those of the piezo (`piezo.limit`) if they are closer.

The integral holds still where z is at a limit and the error would push it further (no windup). The drive along z is
then the loop's: what a controller asks along z has no effect. While a program moves z, or z is held, the loop is open;
afterwards it goes on from where z stands, without a jump. All of it may change between two ticks. docs/microscope.md.
"""

import math
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ..compiled.jit import kernel
from ..compiled.records import Record
from ..core.schema import NonNegative, Unit, refuse_together
from ..parts.groups import OnboardParameters
from ..parts.onboard import NO_DEFLECTION, ONBOARD_SETTINGS, Onboard
from ..parts.part import Numbers, Tree
from ..parts.signals import FOLLOW, GIVEN, HOLD, Detection, Drive, Setpoint


class PiParameters(OnboardParameters):
    """Feedback of the deflection to z."""

    kind: str = Field("pi", description="loop inside the instrument")
    proportional_gain: Annotated[NonNegative, Unit("m/V")] = Field(0.0, description="gain P of the error")
    integral_gain: Annotated[NonNegative, Unit("m/(V s)")] = Field(
        5e-6, description="gain I of its integral; the loop crosses over at I / (2 pi detector.deflection_sensitivity)"
    )
    setpoint_voltage: Annotated[float, Unit("V")] = Field(
        0.0, description="setpoint of the deflection; 0: by setpoint_force"
    )
    setpoint_force: Annotated[float, Unit("N")] = Field(
        0.0, description="setpoint as vertical force (plant lever); 0: by the reference of the tip height"
    )
    low: Annotated[float, Unit("m")] = Field(-5e-6, description="least z")
    high: Annotated[float, Unit("m")] = Field(5e-6, description="largest z")
    hold: bool = Field(False, description="keep z where it is: feedback off")
    feedback: Literal["on", "hold", "off", "external"] = Field(
        "on",
        description="what the loop does where the program asks for nothing else: hold and off keep z where it is; "
        "external passes on what the controller asks along z",
    )

    @model_validator(mode="after")
    def _limits_are_apart(self) -> "PiParameters":
        if self.low >= self.high:
            raise ValueError(
                f"onboard.low = {self.low:g} m is not allowed: it must be < onboard.high = {self.high:g} m"
            )
        refuse_together(self, "onboard.", "setpoint_voltage", "setpoint_force")
        return self


MODES = {"on": FOLLOW, "hold": HOLD, "off": HOLD, "external": GIVEN}


class Constants(Record):
    P: float
    I_step: float
    by_reference: float
    setpoint: float
    a: float
    volts: float
    metres: float
    low: float
    high: float
    hold: float
    feedback: float


class State(Record):
    integral: Annotated[float, "m"]
    z: Annotated[float, "m"]
    error: Annotated[float, "V"]
    mode: float  # what it does with z, see afm_model.parts.signals
    origin: Annotated[float, "m"]  # z without the offset that it is moved by


def _values(parameters: Tree) -> Numbers:
    loop, detector = parameters.onboard, parameters.detector
    # Beyond the range of the piezo z would only be a number.
    range_z = parameters.piezo.limit * parameters.piezo.sensitivity_z or math.inf
    return {
        "P": loop.proportional_gain,
        "I_step": loop.integral_gain * detector.sample_period,
        "by_reference": float(loop.setpoint_voltage == 0.0 and loop.setpoint_force == 0.0),
        "setpoint": _setpoint(parameters),
        "a": parameters.cantilever.a,
        "volts": 1.0 / detector.deflection_sensitivity,
        "metres": parameters.piezo.sensitivity_z,
        "low": max(loop.low, -range_z),
        "high": min(loop.high, range_z),
        "hold": float(loop.hold),
        "feedback": MODES[loop.feedback],
    }


def _setpoint(parameters: Tree) -> float:
    """Of the deflection [V]."""
    loop = parameters.onboard
    if loop.setpoint_force != 0.0:
        return float(parameters.plant.deflection_voltage(parameters, loop.setpoint_force))
    if loop.setpoint_voltage != 0.0:
        return float(loop.setpoint_voltage) if loop.setpoint_voltage != NO_DEFLECTION else 0.0
    return float((parameters.reference.z_r - parameters.cantilever.a) / parameters.detector.deflection_sensitivity)


def _check(parameters: Tree) -> None:
    loop = parameters.onboard
    if loop.setpoint_force != 0.0 and parameters.plant.cantilever_numbers is None:
        raise ValueError(
            f"onboard.setpoint_force = {loop.setpoint_force:g} N is not allowed with plant.kind = "
            f"{parameters.plant.kind}: give onboard.setpoint_voltage"
        )
    most = getattr(parameters.detector, "most_voltage", math.inf)
    given = loop.setpoint_force != 0.0 or loop.setpoint_voltage != 0.0
    if given and abs(volts := _setpoint(parameters)) >= most:
        raise ValueError(
            f"a setpoint of {volts:.4g} V is not allowed: the photodiode reads +-{most:g} V (detector.range), so that "
            f"z would go on into the sample"
        )


def _begin(parameters: Tree, s: Any, drive: tuple[float, float, float]) -> None:
    """From the drive that holds the start, without a jump."""
    s.z = s.integral = parameters.piezo.sensitivity_z * drive[2]


def _warnings(parameters: Tree) -> list[str]:
    """A scanner's resonance lifts the gain of the loop by its quality factor."""
    loop, scanner = parameters.onboard, parameters.plant.scanner_numbers
    if scanner is None:
        return []
    f, Q = scanner.f_z, scanner.Q
    most = parameters.detector.deflection_sensitivity * 2.0 * math.pi * f / Q
    if loop.integral_gain < most:
        return []
    return [
        f"onboard.integral_gain = {loop.integral_gain:g} m/(V s) makes the z loop oscillate: at the resonance of the "
        f"scanner, {f:g} Hz, quality factor {Q:g}, the gain of the loop is {loop.integral_gain / most:.3g} and must be "
        f"< 1: take less than {most:.3g} m/(V s)"
    ]


@kernel
def move_z(r: Setpoint, u: Drive, p: Constants, s: State) -> None:
    """z by the error [V], positive where the sample is to come nearer, or as it is asked for."""
    mode = r.z_mode
    # Who holds z holds it whatever the program asks for; the instrument itself goes before both.
    if mode != GIVEN and p.hold != 0.0:
        mode = HOLD
    if mode == FOLLOW:
        mode = p.feedback
    if mode == GIVEN:
        s.z = u.voltage[2] * p.metres
        s.mode = mode
        return
    if mode != s.mode:
        s.mode, s.origin, s.integral = mode, s.z - r.z_offset, s.z - p.P * s.error
    if mode == FOLLOW:
        s.integral += p.I_step * s.error
        wanted = s.integral + p.P * s.error
        s.z = min(max(wanted, p.low), p.high)
        # At a limit the integral goes no further than what reaches it.
        if (wanted > p.high and s.error > 0.0) or (wanted < p.low and s.error < 0.0):
            s.integral = s.z - p.P * s.error
    elif mode != HOLD:
        s.z = min(max(s.origin + r.z_offset, p.low), p.high)
    u.voltage[2] = s.z / p.metres


@kernel
def regulate(t: float, d: Detection, r: Setpoint, u: Drive, p: Constants, s: State) -> None:
    """See `afm_model.parts.Onboard`."""
    setpoint = (r.position[2] - p.a) * p.volts if p.by_reference != 0.0 else p.setpoint
    s.error = setpoint - d.deflection_voltage
    move_z(r, u, p, s)


PI = Onboard(
    name="pi",
    parameters=PiParameters,
    constants=Constants,
    state=State,
    values=_values,
    check=_check,
    moves_z=True,
    regulate=regulate,
    begin=_begin,
    warnings=_warnings,
    setpoint=_setpoint,
    settings={name: name for name in ONBOARD_SETTINGS},
)
