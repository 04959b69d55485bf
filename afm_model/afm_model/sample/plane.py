"""A tilted plane."""

from typing import Annotated

from annotated_types import Gt, Lt
from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Block, Record
from ..core.elementary import tan
from ..core.schema import Unit
from ..parts.groups import SampleParameters
from ..parts.part import Numbers, Sample, Tree
from ..parts.signals import Surface

Angle = Annotated[float, Gt(-1.4), Lt(1.4), Unit("rad")]


class Plane(SampleParameters):
    """A plane through the origin, tilted along x and y."""

    angle_x: Angle = Field(0.0, description="angle of the plane along x; it rises towards positive x")
    angle_y: Angle = Field(0.0, description="angle of the plane along y")


class Constants(Record):
    slope_x: float
    slope_y: float


def _values(parameters: Tree) -> Numbers:
    sample, scales = parameters.sample, parameters.scales
    rise = scales.x0 / scales.z0
    return {"slope_x": tan(sample.angle_x) * rise, "slope_y": tan(sample.angle_y) * rise}


@kernel
def surface(x: float, y: float, h: Surface, p: Constants, unused: Block) -> None:
    """See `afm_model.parts.Sample`."""
    h.height = p.slope_x * x + p.slope_y * y
    h.slope_x = p.slope_x
    h.slope_y = p.slope_y
    h.curvature = h.curvature_xx = h.curvature_yy = h.curvature_xy = 0.0
    h.strength = 1.0


PLANE = Sample(name="plane", parameters=Plane, constants=Constants, values=_values, surface=surface, lanes=True)
