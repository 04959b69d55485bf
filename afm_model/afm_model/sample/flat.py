"""A flat sample."""

from ..compiled.jit import kernel
from ..compiled.records import Block, Record
from ..parts.groups import SampleParameters
from ..parts.part import Sample
from ..parts.signals import Surface


@kernel
def surface(x: float, y: float, h: Surface, p: Record, unused: Block) -> None:
    """See `afm_model.parts.Sample`."""
    h.height = h.slope_x = h.slope_y = 0.0
    h.curvature = h.curvature_xx = h.curvature_yy = h.curvature_xy = 0.0
    h.strength = 1.0


FLAT = Sample(name="flat", parameters=SampleParameters, surface=surface, lanes=True)
