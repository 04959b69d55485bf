"""The law that is not here: the simulator waits for a controller on topics."""

from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Record
from ..parts.groups import LawParameters
from ..parts.part import Law, Tree
from ..parts.signals import Measurement, PiezoDrive


class ExternalLaw(LawParameters):
    """The law inside the simulator: by default it has no law."""

    kind: str = Field(
        "external",
        description="law inside the simulator; external: no law, a controller answers over topics",
    )


def _check(parameters: Tree) -> None:
    raise ValueError(
        "law.kind = external is not allowed here: it is for the simulator, which then waits for a controller; "
        "give a law"
    )


@kernel
def _control(t: float, y: Measurement, u: PiezoDrive, p: Record, s: Record) -> None:
    """Never called: the drive comes from elsewhere."""


OUTSIDE = Law(name="external", parameters=ExternalLaw, check=_check, control=_control)
