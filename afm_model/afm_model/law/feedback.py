"""What implicit, super_twisting and observer have in common: time constants by rule, and the state of a sampled law."""

import math
from typing import Annotated

from pydantic import Field

from ..core.schema import NonNegative, Unit
from ..parts.part import Tree
from .height import HeightConstants, HeightState
from .scanner import Axis, ScannerConstants, ScannerState, free_axes
from .timing import SampledLaw


class FeedbackConstants(ScannerConstants, HeightConstants):
    """Those of the scanner and of the loop along z."""


class FeedbackState(ScannerState, HeightState):
    """The same."""


class FeedbackLaw(SampledLaw):
    """A sampled law with state feedback along x and y."""

    time_constant: Annotated[NonNegative, Unit("s")] = Field(
        0.0, description="of the tracking error along x and y; 0: (1 + law.delay_ticks) law.period"
    )


def time_constant(parameters: Tree) -> float:
    """Of the tracking error [1/w0]: as given, or one control period and the delay, docs/laws.md (6.1)."""
    law = parameters.law
    return float(parameters.scales.w0 * (law.time_constant or (1 + law.delay_ticks) * law.period))


def pole(parameters: Tree, axis: Axis) -> float:
    """Eigenvalue of that time constant over the step of `axis`."""
    return math.exp(-axis.hold / time_constant(parameters))


def lateral_axes(parameters: Tree, periods: int = 1) -> list[Axis]:
    """x and y of the free scanner over `periods` control periods."""
    return free_axes(parameters, periods)[:2]
