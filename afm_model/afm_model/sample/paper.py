"""The test sample of the paper, h = beta sin(k_x x) sin(k_y y).

Lengths are nondimensional: X, Y in x_0, H in z_0. Equations: docs/theory.md (16) to (18).
"""

from typing import Annotated

from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Block, Record
from ..core.elementary import sincos, square
from ..core.schema import NonNegative, Unit
from ..parts.groups import SampleParameters
from ..parts.part import Numbers, Sample, Tree
from ..parts.signals import Surface


class PaperSample(SampleParameters):
    """Test sample h = beta sin(k_x x) sin(k_y y)."""

    beta: Annotated[float, Unit("m")] = Field(12.5e-9, description="height amplitude; 0 is a flat sample")
    k_x: Annotated[NonNegative, Unit("rad/m")] = Field(2e9, description="wave number along x")
    k_y: Annotated[NonNegative, Unit("rad/m")] = Field(2e9, description="wave number along y")


class Constants(Record):
    beta: float
    k_x: float
    k_y: float


def _values(parameters: Tree) -> Numbers:
    sample = parameters.sample
    scales = parameters.scales
    return {"beta": sample.beta / scales.z0, "k_x": sample.k_x * scales.x0, "k_y": sample.k_y * scales.x0}


def _curvature(parameters: Tree) -> float:
    """At the tops and bottoms."""
    sample = parameters.sample
    x0 = parameters.scales.x0
    return 0.5 * (square(sample.k_x * x0) + square(sample.k_y * x0)) * abs(sample.beta) / parameters.scales.z0


@kernel
def surface(x: float, y: float, h: Surface, p: Constants, unused: Block | int) -> None:
    """See `afm_model.parts.Sample`."""
    sin_x, cos_x = sincos(p.k_x * x)
    sin_y, cos_y = sincos(p.k_y * y)
    height = p.beta * sin_x * sin_y
    h.height = height
    h.slope_x = p.beta * p.k_x * cos_x * sin_y
    h.slope_y = p.beta * p.k_y * sin_x * cos_y
    h.curvature = 0.5 * (p.k_x * p.k_x + p.k_y * p.k_y) * height
    h.curvature_xx = -p.k_x * p.k_x * height
    h.curvature_yy = -p.k_y * p.k_y * height
    h.curvature_xy = p.beta * p.k_x * p.k_y * cos_x * cos_y
    h.strength = 1.0


PAPER = Sample(
    name="paper",
    parameters=PaperSample,
    constants=Constants,
    values=_values,
    height=lambda parameters: abs(parameters.sample.beta),
    curvature=_curvature,
    surface=surface,
    lanes=True,
)
