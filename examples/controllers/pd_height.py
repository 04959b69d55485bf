"""The PD controller for x and y, and along z the loop of the laws of this package: as a law, and as an object."""

from dataclasses import replace
from typing import Any

import pd_class
import pd_law

from afm_model import HeightLoop, SimParameters
from afm_model.law import SampledConstants, SampledState, control_height, follow_flight, sampled_values
from afm_model.parts import kernel


class Constants(pd_law.Constants, SampledConstants):
    """Those of both."""


def values(parameters: Any) -> dict[str, Any]:
    """Gains, and what the loop along z needs."""
    return sampled_values(parameters) | pd_law.values(parameters)


@kernel
def control(t: float, y: Any, u: Any, p: Any, s: Any) -> None:
    """Write the drive that answers measurement y of time t."""
    pd_law.control(t, y, u, p, s)
    follow_flight(y, p, s)
    control_height(y, u, p, s)


PD = replace(pd_law.PD, constants=Constants, state=SampledState, values=values, control=control)


class Pd(pd_class.Pd):
    """The same as an object."""

    def __init__(self, sim: SimParameters) -> None:
        super().__init__(sim)
        self.z = HeightLoop(sim)

    def answer(self, measurement: Any) -> Any:
        """Drive [V], (3,), for a measurement."""
        drive = super().answer(measurement)
        drive[2] = self.z.answer(measurement)
        return drive

    def reset(self) -> None:
        """A run begins."""
        self.z.reset()
