"""A flat sample of two materials, in stripes along y or in squares."""

import math
from typing import Annotated, Literal

from annotated_types import Ge, Le
from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Block, Record
from ..core.elementary import square
from ..core.schema import Positive, Unit
from ..parts.groups import SampleParameters
from ..parts.part import Numbers, Sample, Tree
from ..parts.signals import Surface


class Patches(SampleParameters):
    """Two materials; x = 0 is an edge, the second one lies to the left of it."""

    kind: str = Field("patches", description="the sample")
    pattern: Literal["stripes", "squares"] = Field("stripes", description="how the two alternate")
    width: Annotated[Positive, Unit("m")] = Field(100e-9, description="width of a patch")
    strength: Positive = Field(0.5, description="friction strength of the second material over that of the first")
    adhesion: Annotated[float, Ge(1e-3), Le(1e3)] = Field(
        1.0, description="work of adhesion of the second material over that of the first (plant lever)"
    )
    modulus: Annotated[float, Ge(1e-3), Le(1e3)] = Field(
        1.0, description="elastic modulus of the second material over that of the first (plant lever)"
    )
    viscosity: Annotated[float, Ge(0.0), Le(1e3)] = Field(
        1.0, description="viscosity of the contact on the second material over that on the first (plant lever)"
    )
    tension: Annotated[float, Ge(0.0), Le(1e3)] = Field(
        1.0, description="tension of a liquid bridge on the second material over that on the first; 0: no bridge there"
    )


class Constants(Record):
    width: Annotated[float, "x0"]
    squares: float
    strength: float
    adhesion: float
    modulus: float
    viscosity: float
    tension: float


def _values(parameters: Tree) -> Numbers:
    sample = parameters.sample
    return {"width": sample.width / parameters.scales.x0, "squares": float(sample.pattern == "squares")}


@kernel
def surface(x: float, y: float, h: Surface, p: Constants, unused: Block) -> None:
    """See `afm_model.parts.Sample`."""
    h.height = h.slope_x = h.slope_y = 0.0
    h.curvature = h.curvature_xx = h.curvature_yy = h.curvature_xy = 0.0
    place = math.floor(x / p.width)
    if p.squares != 0.0:
        place += math.floor(y / p.width)
    # Odd; a remainder would be a call of the C library.
    second = place != 2.0 * math.floor(0.5 * place)
    h.strength = p.strength if second else 1.0
    h.adhesion = p.adhesion if second else 1.0
    h.modulus = p.modulus if second else 1.0
    h.viscosity = p.viscosity if second else 1.0
    h.tension = p.tension if second else 1.0


def _contrast(parameters: Tree) -> tuple[float, float]:
    other = square(parameters.sample.adhesion / parameters.sample.modulus)
    return min(1.0, other), max(1.0, other)


PATCHES = Sample(
    name="patches",
    parameters=Patches,
    constants=Constants,
    values=_values,
    contrast=_contrast,
    materials=lambda parameters: ((1.0, 1.0), (parameters.sample.adhesion, parameters.sample.modulus)),
    surface=surface,
)
