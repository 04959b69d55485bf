"""A sample of your own from a kernel: flat, with stripes of another material along y.

sample.kind: patches:PATCHES
"""

from typing import Annotated

from afm_model.parts import Field, Record, Sample, SampleParameters, Unit, kernel


class Patches(SampleParameters):
    """Stripes of two materials."""

    width: Annotated[float, Unit("m")] = Field(4e-9, gt=0, description="width of a stripe along x")
    ratio: float = Field(0.5, gt=0, description="friction strength of every other stripe over that of contact.tau")


class Constants(Record):
    width: Annotated[float, "x0"]
    ratio: float


def values(parameters):
    return {"width": parameters.sample.width / parameters.scales.x0}


@kernel
def surface(x, y, h, p, map):
    h.height = h.slope_x = h.slope_y = 0.0
    h.curvature = h.curvature_xx = h.curvature_yy = h.curvature_xy = 0.0
    h.strength = 1.0 if (x / p.width) % 2.0 < 1.0 else p.ratio


PATCHES = Sample(parameters=Patches, constants=Constants, values=values, surface=surface)
