"""The verb Tune: the resonance of the driven cantilever, off the sample; docs/dynamic.md."""

import math
from collections.abc import Generator, Iterator
from typing import Annotated, Any, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray
from pydantic import Field

from ...analysis.resonance import lag, resonance_fit
from ...core.errors import ParameterError, VerbError
from ...core.schema import NonNegative, Unit, Value
from ...parameters import InstrumentParameters, changed
from ...program.orders import Order
from ..arrays import Arrays, attributes, variable
from ..execution import Execution, Task
from ..results import MicroscopeState
from ..verb import Verb, on_the_sample
from ..view import InstrumentView

_WIDTHS = 8.0
"""Span of a sweep over f0 / Q, where it is not given."""
DECAYS = 12.0
"""Decay times of the cantilever to a settled response: 6e-6 of the last one is left."""
_ON_RESONANCE = 0.5 * math.pi
"""Lag of a free cantilever at its first resonance, which the phase is counted by [rad]."""
_NAMES = ["in_phase", "quadrature"]
Hertz = Annotated[NonNegative, Unit("Hz")]


def of_lock_in(part: Any) -> float:
    """Time in which the lock-in of an onboard part settles, but for 6e-6 of the last response [s]."""
    return float((12.0 + 2.0 * part.filter_order) * part.time_constant)


def driven(view: InstrumentView, frequency: float, amplitude: float) -> InstrumentParameters:
    """Parameters with the drive at a frequency [Hz] and an amplitude [m]; 0: the amplitude that it has."""
    drive = amplitude or view.parameters.onboard.drive_amplitude
    news: dict[str, Value] = {"onboard.drive_frequency": frequency, "onboard.drive_amplitude": drive}
    parameters: InstrumentParameters = view.parameters
    return changed(parameters, news)


def swept(
    run: Execution,
    frequencies: NDArray[np.float64],
    amplitude: float,
    settle: float,
    average: float,
) -> Generator[Task, None, list[complex]]:
    """Tasks that drive at one frequency [Hz] after the other, each `settle` and then `average` long [s].

    Returns
    -------
    list of complex [m]
        Mean of A exp(-i phi) at each.
    """
    view, found = run.view, list[complex]()
    rate = 1.0 / (view.ticks(average) * view.control_period)
    for number, f in enumerate(frequencies.tolist()):
        view.instrument.set_onboard(driven(view, f, amplitude))
        detail, recorder = f"frequency {number + 1} of {frequencies.size}", run.recorder(_NAMES, rate)
        yield Task(Order(view.stay(settle)), settle, detail)
        yield Task(Order(view.stay(average)), average, detail, recorder)
        x, y = (recorder.record().channels[name][0] for name in _NAMES)
        found.append(complex(x, -y))
    return found


class Tune(Verb):
    """Sweep the frequency of the drive over a resonance; fit it; set the drive for a free amplitude."""

    returns: ClassVar = Arrays

    frequency: Hertz = Field(0.0, description="middle of the sweep; 0: first resonance as plant.* gives it")
    span: Hertz = Field(0.0, description="width of the sweep; 0: 8 widths of the resonance as plant.* gives it")
    points: Annotated[int, Ge(16), Le(10_000)] = Field(41, description="frequencies, evenly spaced")
    average: Annotated[float, Ge(0), Le(100), Unit("s")] = Field(
        0.0, description="mean at each frequency, once it is settled; 0: as long as settling takes"
    )
    drive_amplitude: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="of the base in the sweep; 0: onboard.drive_amplitude"
    )
    free_amplitude: Annotated[NonNegative, Unit("m")] = Field(
        0.0,
        description="of the deflection at resonance, that the drive is set for at the end, at the frequency found, and "
        "the zero of the phase: there the free cantilever shows pi/2; 0: all is put back as it was",
    )

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        part, cantilever = view.parameters.onboard, view.parameters.plant.cantilever_numbers
        if not hasattr(part, "drive_frequency"):
            yield f"Tune is not allowed with onboard.kind = {part.kind}, which drives no cantilever: take dynamic"
            return
        yield from on_the_sample(self, state)
        if part.harmonic != 1:
            yield f"Tune is not allowed with onboard.harmonic = {part.harmonic}: it must be 1"
        if self.drive_amplitude == 0.0 and part.drive_amplitude == 0.0:
            yield "drive_amplitude = 0 m is not allowed where onboard.drive_amplitude is 0 too: it must be > 0 m"
        middle, span = self._sweep(cantilever)
        if not middle > 0.5 * span > 0.0:
            yield f"span = {span:g} Hz is not allowed: it must be > 0 and < {2.0 * middle:g} Hz, twice the middle"
            return
        try:
            driven(view, middle + 0.5 * span, self.drive_amplitude)
            changed(view.parameters, {"onboard.free_amplitude": self.free_amplitude})
        except ParameterError as error:
            yield str(error)

    def _sweep(self, cantilever: object) -> tuple[float, float]:
        """Middle and width [Hz]."""
        middle = self.frequency or getattr(cantilever, "f0", 0.0)
        return middle, self.span or _WIDTHS * middle / getattr(cantilever, "Q", math.inf)

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        view, before = run.view, run.view.parameters.onboard
        middle, span = self._sweep(view.parameters.plant.cantilever_numbers)
        # The narrowest resonance that a sweep of this width is made for.
        settle = DECAYS * _WIDTHS / (math.pi * span) + of_lock_in(before)
        average = self.average or settle
        run.total = self.points * (settle + average)
        frequencies = np.linspace(middle - 0.5 * span, middle + 0.5 * span, self.points)
        run.result = lambda: None
        after = {"onboard.drive_frequency": before.drive_frequency, "onboard.drive_amplitude": before.drive_amplitude}
        try:
            found = yield from swept(run, frequencies, self.drive_amplitude, settle, average)
            curve = self._found(frequencies, found, before)
            run.result, told = lambda: curve, curve.attributes
            if self.free_amplitude > 0.0:
                after = {
                    "onboard.drive_frequency": told["f0_Hz"],
                    "onboard.drive_amplitude": told["drive_amplitude_m"],
                    "onboard.phase_offset": told["phase_offset_rad"],
                    "onboard.free_amplitude": self.free_amplitude,
                }
        finally:
            view.instrument.set_onboard(changed(view.parameters, after))

    def _found(self, frequencies: NDArray[np.float64], found: list[complex], part: Any) -> Arrays:
        """The curve, its fit, the drive for the free amplitude, and the zero of the phase.

        Parameters
        ----------
        part : DynamicParameters
            As before the sweep.
        """
        response, drive = np.array(found), self.drive_amplitude or part.drive_amplitude
        try:
            fit = resonance_fit(frequencies, response)
        except ValueError as error:
            raise VerbError(f"no resonance comes out of the sweep: {error}") from None
        over = ("frequency",)
        columns = {
            "amplitude": (np.abs(response), "m"),
            "phase": (lag(response), "rad"),
            "in_phase": (response.real, "m"),
            "quadrature": (-response.imag, "m"),
            "fitted_amplitude": (np.abs(fit.response), "m"),
        }
        told: dict[str, float] = {}
        for name, each in (("f0_Hz", fit.f0), ("Q", fit.Q), ("amplitude_m", fit.amplitude), ("phase_rad", fit.phase)):
            told |= {name: each.value, f"{name}_uncertainty": each.uncertainty}
        # From -pi to pi, so that it stays in its range however often it is set.
        told["phase_offset_rad"] = math.remainder(part.phase_offset + fit.phase.value - _ON_RESONANCE, 2.0 * math.pi)
        told["drive_amplitude_m"] = drive * (self.free_amplitude or fit.amplitude.value) / fit.amplitude.value
        return Arrays(
            {name: variable(over, values, name, unit) for name, (values, unit) in columns.items()},
            {"frequency": variable(over, frequencies, "frequency", "Hz")},
            attributes(self, told),
        )
