"""law.kind sgn_tracking, tanh_tracking: the paper's laws along x and y, the loop of the sampled laws along z.

Along z: docs/laws.md (2.1). The paper's law there diverges from cdot_z w0 T = 2 on, docs/theory.md C17. With the same
loop along z as the others, its laws along x and y can be compared at rates where they could not run at all.
"""

from pydantic import Field

from ..compiled.jit import kernel
from ..parts.part import Law, Numbers, Tree
from ..parts.signals import Measurement, PiezoDrive
from . import paper, sampled, scanner
from .paper import PaperLaw
from .sampled import SampledConstants, SampledLaw, SampledState


class PaperTracking(PaperLaw, SampledLaw):
    """Gains of the paper's laws; those along z, and z_rate, are not used."""

    kind: str = Field("tanh_tracking", description="control law")


class Constants(paper.Constants, SampledConstants):
    """Cantilever, scales and volts mean the same to both."""


def _values(parameters: Tree) -> Numbers:
    kind = parameters.law.kind.removesuffix("_tracking")
    as_paper = parameters.model_copy(update={"law": parameters.law.model_copy(update={"kind": kind})})
    of_paper = paper.PARTS[paper.KINDS[kind]].values(as_paper)
    return {**of_paper, **sampled.sampled_values(parameters)}


@kernel
def control(t: float, y: Measurement, u: PiezoDrive, p: Constants, s: SampledState) -> None:
    """See `afm_model.parts.Law`."""
    paper.control(t, y, u, p, s)
    scanner.follow_flight(y, p, s)
    sampled.control_height(y, u, p, s)


PARTS = tuple(
    Law(
        name=f"{kind}_tracking",
        parameters=PaperTracking,
        constants=Constants,
        state=SampledState,
        values=_values,
        control=control,
        knowledge="positions and velocities of the scanner, deflection; scanner, cantilever; bounds on friction",
    )
    for kind in ("sgn", "tanh")
)
