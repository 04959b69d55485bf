"""The loop along z of the laws of this package, for a controller of one's own that is an object."""

from typing import Any

from numpy.typing import NDArray

from ..law.paper_tracking import PaperTracking
from ..parameters.simulator_parameters import SimParameters, controller_of
from .controller import Controller


class HeightLoop:
    """Drives z as the laws of this package do: the tip follows the surface at its setpoint, docs/laws.md (2.1).

    Parameters
    ----------
    sim : SimParameters
        As an object with `answer` receives it: period, delay, scanner, cantilever and piezo are read.

    Raises
    ------
    ParameterError
        If the loop cannot be computed with them.
    """

    def __init__(self, sim: SimParameters) -> None:
        plant = sim.plant
        law = PaperTracking(period=plant.control_period, delay_ticks=plant.delay_ticks)
        self._law = Controller(controller_of(sim, law))

    def answer(self, measurement: NDArray[Any]) -> float:
        """Return the drive of z [V] for a measurement; each measurement once, in order, and its drive must be sent."""
        drive: Any = self._law.answer(measurement)
        return float(drive[2])

    def reset(self) -> None:
        """Forget the surface: a run begins."""
        self._law.reset()
