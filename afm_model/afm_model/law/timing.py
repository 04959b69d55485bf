"""What a law that is computed for one rate must know of time: the control period and the delay of its drives."""

from typing import Annotated

from annotated_types import Ge, Le
from pydantic import Field

from ..core.schema import Positive, Unit
from ..parts.groups import LawParameters, PlantParameters


class SampledLaw(LawParameters):
    """A law made for one control period and one delay. A scenario that leaves them out means those of its plant."""

    period: Annotated[Positive, Unit("s")] = Field(
        2e-6, description="control period that the law is made for; left out in a scenario: plant.control_period"
    )
    delay_ticks: Annotated[int, Ge(0), Le(100_000)] = Field(
        0, description="delay of the drive in control periods that the law is made for; left out: plant.delay_ticks"
    )

    def made_for_another(self, period: float) -> bool:
        """Whether the law is made for another control period than this one [s]."""
        return abs(self.period - period) > 1e-6 * period


class TimingWarning(UserWarning):
    """A law is made for another control period or delay than those of the plant."""


TIMING = ("period", "delay_ticks")
"""Names of the parameters of `SampledLaw`."""


def disagreements(law: LawParameters, plant: PlantParameters) -> list[str]:
    """Where a law is made for another period or delay than those of the plant, a sentence each.

    Parameters
    ----------
    law : LawParameters
        Of any law; one that is not made for a period has nothing to disagree.
    plant : PlantParameters
    """
    control_period, delay_ticks = plant.control_period, plant.delay_ticks
    if not isinstance(law, SampledLaw):
        return []
    told = []
    if law.made_for_another(control_period):
        told.append(
            f"the law is made for another rate: law.period = {law.period:g} s should be plant.control_period = "
            f"{control_period:g} s"
        )
    if law.delay_ticks != delay_ticks:
        told.append(
            f"the law is made for another delay: law.delay_ticks = {law.delay_ticks} should be plant.delay_ticks = "
            f"{delay_ticks}"
        )
    return told
