"""What a scan asks for: its frame, its lines, its channels. The verb, its plan and its image all read it."""

from typing import Annotated, Literal

from annotated_types import Ge, Le
from pydantic import Field

from ..core.schema import Group, NonNegative, Unit
from .quantities import Angle, Length, LineCount, Metre, Rate, Speed

PRESSED = ("height", "error", "lateral")
"""Channels of a scan of a tip that is pressed and that names none."""


class Raster(Group):
    """Describe lines, trace and retrace, over a frame of the sample."""

    centre_x: Metre = Field(0.0, description="middle of the frame")
    centre_y: Metre = Field(0.0, description="middle of the frame")
    size_x: Length = Field(100e-9, description="width of the frame: length of a line")
    size_y: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="height of the frame; 0: square pixels. Ignored with slow_axis off"
    )
    angle: Angle = Field(0.0, description="of the fast direction against x, counterclockwise")
    pixels: Annotated[int, Ge(2), Le(8192)] = Field(128, description="in a line")
    lines: LineCount = Field(128, description="of the image")
    line_rate: Rate = Field(1.0, description="lines a second; a line is trace and retrace")
    overscan: Annotated[float, Ge(0.01), Le(2.0)] = Field(
        0.1, description="time of a turn over that of the image part of a line; the turns are rounded"
    )
    direction: Literal["up", "down"] = Field("up", description="of the slow axis: up begins at the least y")
    slow_axis: bool = Field(True, description="false: every line at the same place, the middle of the frame")
    speed: Speed = Field(10e-6, description="velocity on the way to the first line")
    channels: str = Field(
        "",
        description="what is measured: of height, error, lateral, amplitude_error, phase, x, y, and any signal's name; "
        "empty: height, error, lateral, of a tip that taps height, amplitude_error, phase",
    )

    @property
    def height(self) -> float:
        """Height of the frame [m]."""
        return self.size_y or self.size_x * self.lines / self.pixels

    @property
    def channel_names(self) -> list[str]:
        """What is measured, each name once; where none is given, what is of a tip that is pressed."""
        if not self.channels:
            return list(PRESSED)
        return list(dict.fromkeys(name.strip() for name in self.channels.split(",") if name.strip()))
