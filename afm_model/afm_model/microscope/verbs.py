"""What a microscope can be asked to do, each with its own numbers. SI units.

A verb is carried out in the instrument's own world, at the rate of the virtual ADC. Each is also an action of afm_msgs
with the same name and fields.
"""

from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field, model_validator

from ..core.schema import Group, NonNegative, Positive, Unit

_Metre = Annotated[float, Unit("m")]
_Length = Annotated[Positive, Unit("m")]
_Speed = Annotated[float, Ge(1e-12), Le(1.0), Unit("m/s")]
_Rest = Annotated[float, Ge(0), Le(1e4), Unit("s")]
_Angle = Annotated[float, Unit("rad")]
_Trigger = Annotated[NonNegative, Unit("V")]
_Rate = Annotated[Positive, Unit("Hz")]
_Force = Annotated[NonNegative, Unit("N")]
_Count = Annotated[int, Ge(1), Le(1_000_000)]
_Lines = Annotated[int, Ge(1), Le(8192)]
_Samples = Annotated[float, Ge(1e-3), Le(1e9), Unit("Hz")]


class Verb(Group):
    """Something that the microscope does, which takes time and can be cancelled."""


class Approach(Verb):
    """Move z to the sample until the deflection reaches the setpoint, then switch the feedback on."""

    rate: _Speed = Field(1e-6, description="velocity of z towards the sample")
    range: _Length = Field(5e-6, description="way of z at most; without a sample within it the tip is withdrawn again")
    settle: Annotated[float, Gt(0), Le(1e4), Unit("s")] = Field(
        20e-3, description="rest before it, whose mean deflection is the zero, and with feedback behind it"
    )


class Withdraw(Verb):
    """Switch the feedback off and move z away from the sample."""

    distance: _Length = Field(500e-9, description="way of z")
    rate: _Speed = Field(10e-6, description="velocity of z")


class MoveTo(Verb):
    """Move the scanner along x and y on a straight line; the feedback stays as it is."""

    x: _Metre = Field(0.0, description="place to go to")
    y: _Metre = Field(0.0, description="place to go to")
    speed: _Speed = Field(10e-6, description="velocity along the line")


class ForceCurve(Verb):
    """Force curves where the scanner stands. The feedback is off meanwhile, and on again behind them."""

    lift: _Length = Field(200e-9, description="z is first withdrawn by this from where it stands")
    ramp: _Length = Field(400e-9, description="way of an approach at most")
    settle: Annotated[float, Gt(0), Le(1e4), Unit("s")] = Field(
        2e-3, description="rest before an approach; the trigger counts from the mean deflection in it"
    )
    approach_rate: _Speed = Field(1e-6, description="velocity of z on the way to the sample")
    retract_rate: _Speed = Field(1e-6, description="velocity of z on the way back")
    trigger_voltage: _Trigger = Field(
        0.0, description="rise of the deflection at which an approach ends; 0: by trigger_force"
    )
    trigger_force: _Force = Field(
        0.0, description="the same as force of the cantilever; 0, too: an approach ends with the ramp"
    )
    dwell: _Rest = Field(0.0, description="rest at the end of an approach, z held")
    count: _Count = Field(1, description="curves, one after the other")
    sample_rate: _Samples = Field(50e3, description="samples of the result; each is a mean over samples of the ADC")

    @model_validator(mode="after")
    def _one_trigger(self) -> "ForceCurve":
        if self.trigger_voltage > 0.0 and self.trigger_force > 0.0:
            raise ValueError(
                f"trigger_voltage = {self.trigger_voltage:g} V and trigger_force = {self.trigger_force:g} N are not "
                f"allowed together: give one"
            )
        return self


class FrictionLoop(Verb):
    """Lines to and fro through the place where the scanner stands, with feedback."""

    length: _Length = Field(10e-9, description="of the line, whose middle is where the scanner stands")
    angle: _Angle = Field(0.0, description="of the line against x, counterclockwise")
    line_rate: _Rate = Field(10.0, description="lines a second; a line is trace and retrace")
    count: _Lines = Field(2, description="lines; the first one begins in the middle and is not part of the result")
    sample_rate: _Samples = Field(50e3, description="samples of the result; each is a mean over samples of the ADC")


class Scan(Verb):
    """An image, line by line, trace and retrace."""

    centre_x: _Metre = Field(0.0, description="middle of the frame")
    centre_y: _Metre = Field(0.0, description="middle of the frame")
    size_x: _Length = Field(100e-9, description="width of the frame: length of a line")
    size_y: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="height of the frame; 0: square pixels. Ignored with slow_axis off"
    )
    angle: _Angle = Field(0.0, description="of the fast direction against x, counterclockwise")
    pixels: Annotated[int, Ge(2), Le(8192)] = Field(128, description="in a line")
    lines: _Lines = Field(128, description="of the image")
    line_rate: _Rate = Field(1.0, description="lines a second; a line is trace and retrace")
    overscan: Annotated[float, Ge(0.01), Le(2.0)] = Field(
        0.1, description="time of a turn over that of the image part of a line; the turns are rounded"
    )
    direction: Literal["up", "down"] = Field("up", description="of the slow axis: up begins at the least y")
    slow_axis: bool = Field(True, description="false: every line at the same place, the middle of the frame")
    speed: _Speed = Field(10e-6, description="velocity on the way to the first line")
    channels: str = Field(
        "height, error, lateral", description="what is measured: of height, error, lateral, x, y, and any signal's name"
    )

    @property
    def height(self) -> float:
        """Height of the frame [m]."""
        return self.size_y or self.size_x * self.lines / self.pixels


class ScanPath(Verb):
    """Measure along a path of straight lines, at even speed, with feedback."""

    x: tuple[float, ...] = Field((), description="places in turn [m]")
    y: tuple[float, ...] = Field((), description="places in turn [m]")
    speed: _Speed = Field(1e-6, description="velocity along the path")
    sample_rate: _Samples = Field(1e3, description="samples of the result; each is a mean over samples of the ADC")


class ThermalTune(Verb):
    """Record the free deflection and take the cantilever's stiffness from its thermal noise."""

    duration: Annotated[float, Gt(0), Le(600), Unit("s")] = Field(1.0, description="of the record")
    temperature: Annotated[Positive, Unit("K")] = Field(295.0, description="of the cantilever")


class CalibrateSensitivity(Verb):
    """Force curves on a stiff sample, and from their slopes the sensitivity of the deflection [m/V]."""

    count: _Count = Field(3, description="force curves")
    ramp: _Length = Field(400e-9, description="way of an approach at most")
    lift: _Length = Field(200e-9, description="z is first withdrawn by this from where it stands")
    rate: _Speed = Field(1e-6, description="velocity of z")
    trigger_voltage: Annotated[Positive, Unit("V")] = Field(2.0, description="rise of the deflection at the turn")


class CalibrateLateral(Verb):
    """Lines over a wedge at several setpoints, and from them the sensitivity of the lateral signal [N/V].

    The sample is a grating whose slope rises towards +x, with a flat stretch beside it. The tip is on it, the scanner
    anywhere: places are given.
    """

    slope_from: _Metre = Field(0.0, description="where the slope begins, along x")
    slope_to: _Metre = Field(100e-9, description="where the slope ends")
    flat_from: _Metre = Field(-100e-9, description="where the flat stretch begins")
    flat_to: _Metre = Field(0.0, description="where the flat stretch ends")
    slope_angle: Annotated[float, Gt(0), Le(1.4), Unit("rad")] = Field(0.4363, description="of the slope, 25 degrees")
    setpoint_from: Annotated[Positive, Unit("N")] = Field(10e-9, description="least setpoint")
    setpoint_to: Annotated[Positive, Unit("N")] = Field(40e-9, description="largest setpoint")
    setpoints: Annotated[int, Ge(2), Le(100)] = Field(4, description="in even steps")
    line_rate: _Rate = Field(1.0, description="lines a second; a line is trace and retrace")
    lines: _Lines = Field(2, description="at each setpoint; the first one is not used")


VERBS: dict[str, type[Verb]] = {
    each.__name__: each
    for each in (
        *(Approach, Withdraw, MoveTo, ForceCurve, FrictionLoop, Scan, ScanPath),
        *(ThermalTune, CalibrateSensitivity, CalibrateLateral),
    )
}
"""By their names."""
