"""Parameters of the friction-predicting law."""

from typing import Annotated, Literal

from annotated_types import Ge, Le
from pydantic import Field

from ...core.schema import NonNegative, Positive, Unit
from ..timing import SampledLaw


class PredictiveLaw(SampledLaw):
    """What the friction-predicting law knows and assumes. Its gains follow from the microscope and the period."""

    kind: str = Field("predictive", description="friction-predicting control, docs/laws.md")
    packet: Annotated[int, Ge(1), Le(64)] = Field(1, description="drives in a control period, each with its time")
    spare: Annotated[int, Ge(0), Le(16)] = Field(
        0,
        description="further control periods for which an answer holds drives, played while the next one is late",
    )
    reserve: Annotated[int, Ge(0), Le(511)] = Field(
        0,
        description="further drives behind those, planned a few with each answer and kept: they bridge a controller "
        "that stands still",
    )
    feedback: Literal["full", "measured"] = Field(
        "full", description="full: positions and rates as measured; measured: an observer that positions correct"
    )
    position_noise: Annotated[Positive, Unit("m")] = Field(5e-11, description="measured: rms noise of a position")
    deflection_noise: Annotated[NonNegative, Unit("m")] = Field(
        1e-11, description="measured: rms noise of the deflection"
    )
    force_noise: Annotated[NonNegative, Unit("N")] = Field(
        5e-11, description="measured: rms noise of the lateral force"
    )
    surface: Literal["known", "observed", "learned"] = Field(
        "observed",
        description="height of the sample along the reference: known: that of sample.*; observed: from tip and "
        "scanner, continued; learned: observed, and kept along the line of the reference",
    )
    friction: Literal["nominal", "identified"] = Field(
        "identified", description="bound of friction: nominal: that of contact.*; identified: from the lateral force"
    )
    response: Annotated[NonNegative, Unit("s")] = Field(
        0.0, description="time in which an error vanishes; 0: 1/w0, but neither below a control period nor above two"
    )
    height: Annotated[Positive, Unit("m")] = Field(
        12.5e-9, description="largest height of the sample about its mean, for an observed surface"
    )
    wave_number: Annotated[Positive, Unit("rad/m")] = Field(
        2e9, description="largest wave number of the sample along x and y, for an observed surface"
    )
