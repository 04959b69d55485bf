"""The verb ThermalTune.

Nothing here looks into the simulated instrument: the functions of `afm_model.analysis` are given what was measured.
"""

from collections.abc import Iterator
from typing import Annotated, ClassVar

from annotated_types import Gt, Le
from pydantic import Field

from ...analysis import spring_constant
from ...core.errors import VerbError
from ...core.schema import Positive, Unit
from ...program.orders import Order
from ..collect import RecordCollector
from ..execution import Execution, Task
from ..results import Calibration, MicroscopeState
from ..verb import Verb, on_the_sample, too_much
from ..view import InstrumentView


class ThermalTune(Verb):
    """Record the free deflection and take the cantilever's stiffness from its thermal noise."""

    returns: ClassVar = Calibration

    duration: Annotated[float, Gt(0), Le(600), Unit("s")] = Field(1.0, description="of the record")
    temperature: Annotated[Positive, Unit("K")] = Field(295.0, description="of the cantilever")

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        yield from on_the_sample(self, state)
        yield from too_much(view.samples(self.duration), f"duration = {self.duration:g} s")
        band = view.resonance_band
        if band is not None and band[1] <= band[0] * 1.4:
            yield (
                f"ThermalTune is not allowed with detector.sample_period = {view.sample_period:g} s: the cantilever's "
                f"resonance is beyond half the rate of the ADC, {0.5 / view.sample_period:g} Hz"
            )

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        run.total = self.duration
        recorder = run.recorder(["deflection_voltage"])
        run.result = lambda: self._found(run.view, recorder)
        yield Task(Order(run.view.stay(self.duration)), self.duration, "listening to the cantilever", recorder)

    def _found(self, view: InstrumentView, recorder: RecordCollector) -> Calibration | None:
        """The spring constant [N/m]; None without a whole record."""
        volts = recorder.record().channels["deflection_voltage"]
        if volts.size * view.sample_period < self.duration * (1.0 - 1e-9):
            return None
        sensitivity, rate = view.deflection_sensitivity, 1.0 / view.sample_period
        try:
            tune = spring_constant(volts, rate, sensitivity, self.temperature, band=view.resonance_band)
        except ValueError as error:
            cold = getattr(view.parameters.plant, "temperature", self.temperature) == 0.0
            raise VerbError(
                f"no spring constant comes out of the record of {self.duration:g} s: "
                + (
                    "plant.temperature = 0 K, so that no heat moves the cantilever: set it to 295"
                    if cold
                    else f"{error}"
                )
            ) from None
        details = {"f0_Hz": tune.f0.value, "Q": tune.Q.value, "rms_m": tune.rms, "floor_m_rtHz": tune.floor.value}
        details["deflection_sensitivity_m_V"] = sensitivity
        return Calibration(*tune.k, "N/m", details)
