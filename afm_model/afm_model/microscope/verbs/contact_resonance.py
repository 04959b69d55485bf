"""The verb ContactResonance: the resonance of a cantilever that is pressed on the sample; docs/dynamic.md."""

import math
from collections.abc import Generator, Iterator
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Ge, Le
from numpy.typing import NDArray
from pydantic import Field

from ...analysis import contact_stiffness
from ...analysis.resonance import lag, resonance_fit
from ...core.errors import ParameterError, VerbError
from ...core.schema import NonNegative, Unit
from ...parameters import changed
from ..arrays import Arrays, attributes, variable
from ..execution import Execution, Task
from ..results import MicroscopeState
from ..verb import Verb
from ..view import InstrumentView
from .tune import DECAYS, Hertz, driven, of_lock_in, swept

_PINNED = 4.5
"""Over f0: beyond the first resonance of a beam whose end is pinned, 4.39."""
_WIDTHS = 4.0
"""Span of a sweep over its middle / Q, where it is not given: a pressed cantilever has a larger Q than a free one."""
_QUICK = 3.0
"""Decay times of the cantilever to a response that shows where the resonance is."""


class ContactResonance(Verb):
    """Sweep the drive over a resonance of the cantilever pressed on the sample; contact stiffness by a closed form."""

    returns: ClassVar = Arrays
    on_sample: ClassVar = True
    slides: ClassVar = True
    presses: ClassVar = True

    frequency: Hertz = Field(0.0, description="middle of the sweep; 0: where the response is largest up to `highest`")
    highest: Hertz = Field(0.0, description="to which the resonance is searched for, from f0 on; 0: 4.5 f0")
    span: Hertz = Field(0.0, description="width of the sweep; 0: 4 / Q of its middle, Q as plant.* gives it")
    points: Annotated[int, Ge(16), Le(10_000)] = Field(41, description="frequencies, evenly spaced")
    average: Annotated[float, Ge(0), Le(100), Unit("s")] = Field(
        0.0, description="mean at each frequency, once it is settled; 0: as long as settling takes"
    )
    drive_amplitude: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="of the drive in the sweep; 0: onboard.drive_amplitude"
    )
    mode: Annotated[int, Ge(1), Le(3)] = Field(1, description="of the pressed cantilever, whose resonance it is")
    free_frequency: Hertz = Field(0.0, description="first resonance off the sample; 0: as plant.* gives it")
    lateral: Annotated[float, Ge(0), Le(10)] = Field(
        0.0, description="lateral over normal stiffness of the contact of a tip that sticks; 0: it slides freely"
    )

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        part = view.parameters.onboard
        if not hasattr(part, "drive_frequency"):
            yield f"ContactResonance is not allowed with onboard.kind = {part.kind}, which has no drive: take dynamic"
            return
        for name, allowed in (("harmonic", (1,)), ("lock_in", ("deflection",)), ("drive", ("base", "tip"))):
            if (value := getattr(part, name)) not in allowed:
                told = " or ".join(map(str, allowed))
                yield f"ContactResonance is not allowed with onboard.{name} = {value}: it must be {told}"
        if getattr(part, "phase_bandwidth", 0.0) or getattr(part, "amplitude_bandwidth", 0.0):
            yield "ContactResonance is not allowed with loops of phase or amplitude: take bandwidths of 0"
        if self.drive_amplitude == 0.0 and part.drive_amplitude == 0.0:
            yield "drive_amplitude = 0 m is not allowed where onboard.drive_amplitude is 0 too: it must be > 0 m"
        f0, middle, span = self._free(view), self.frequency, self._span(view, self.frequency)
        if middle and not middle > 0.5 * span > 0.0:
            yield f"span = {span:g} Hz is not allowed: it must be > 0 and < {2.0 * middle:g} Hz, twice the middle"
            return
        if not middle and not self._highest(view) > f0:
            yield f"highest = {self.highest:g} Hz is not allowed: it must be > {f0:g} Hz, the free resonance"
        try:
            top = middle or self._highest(view)
            driven(view, top + 0.5 * self._span(view, top), self.drive_amplitude)
        except ParameterError as error:
            yield str(error)

    def _free(self, view: InstrumentView) -> float:
        return self.free_frequency or float(view.parameters.plant.cantilever_numbers.f0)

    def _highest(self, view: InstrumentView) -> float:
        return self.highest or _PINNED * self._free(view)

    def _span(self, view: InstrumentView, middle: float) -> float:
        return self.span or _WIDTHS * middle / float(view.parameters.plant.cantilever_numbers.Q)

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        view, part = run.view, run.view.parameters.onboard
        # The losses of the first mode are the least that a resonance can have.
        decay = float(view.parameters.plant.cantilever_numbers.Q) / (math.pi * self._free(view))
        settle = DECAYS * decay + of_lock_in(part)
        average = self.average or settle
        run.total = self.points * (settle + average)
        run.result = lambda: None
        before = {"onboard.drive_frequency": part.drive_frequency, "onboard.drive_amplitude": part.drive_amplitude}
        try:
            middle = self.frequency or (yield from self._searched(run, decay))
            span = self._span(view, middle)
            frequencies = np.linspace(middle - 0.5 * span, middle + 0.5 * span, self.points)
            found = yield from swept(run, frequencies, self.drive_amplitude, settle, average)
            curve = self._found(view, frequencies, np.array(found))
            run.result = lambda: curve
        finally:
            view.instrument.set_onboard(changed(view.parameters, before))

    def _searched(self, run: Execution, decay: float) -> Generator[Task, None, float]:
        """Where the response is largest, between the free resonance and the highest frequency [Hz]."""
        view, part = run.view, run.view.parameters.onboard
        low, high = self._free(view), self._highest(view)
        count = max(16, math.ceil(math.pi * decay * (high - low)))  # the narrowest resonance has two
        frequencies = np.linspace(low, high, count + 1)
        settle = _QUICK * decay + 0.5 * of_lock_in(part)
        run.total += frequencies.size * 1.25 * settle
        response = np.abs((yield from swept(run, frequencies, self.drive_amplitude, settle, 0.25 * settle)))
        top = int(response.argmax())
        if not 0 < top < count:
            raise VerbError(
                f"no resonance from {low:.6g} to {high:.6g} Hz: the response is largest at {frequencies[top]:.6g} Hz; "
                f"take another highest, or give frequency"
            )
        return float(frequencies[top])

    def _found(
        self, view: InstrumentView, frequencies: NDArray[np.float64], response: NDArray[np.complex128]
    ) -> Arrays:
        """The curve, its fit, and the stiffness that belongs to it."""
        plant, c = view.parameters.plant, view.parameters.plant.cantilever_numbers
        free, k = self._free(view), view.spring_constant
        try:
            fit = resonance_fit(frequencies, response)
            stiffness = contact_stiffness(
                fit.f0,
                f0=free,
                k=k,
                mode=self.mode,
                lateral=self.lateral,
                tilt=plant.tilt,
                tip_height=c.tip_height + 0.5 * c.thickness,
                length=c.length,
            )
        except ValueError as error:
            raise VerbError(f"no contact stiffness comes out of the sweep: {error}") from None
        columns = {
            "amplitude": (np.abs(response), "m"),
            "phase": (lag(response), "rad"),
            "in_phase": (response.real, "m"),
            "quadrature": (-response.imag, "m"),
            "fitted_amplitude": (np.abs(fit.response), "m"),
        }
        each = {"resonance_Hz": fit.f0, "Q": fit.Q, "amplitude_m": fit.amplitude, "phase_rad": fit.phase}
        told = {"free_frequency_Hz": free, "spring_constant_N_m": k, "setpoint_V": view.setpoint}
        for name, one in (each | {"contact_stiffness_N_m": stiffness}).items():
            told |= {name: one.value, f"{name}_uncertainty": one.uncertainty}
        over = ("frequency",)
        return Arrays(
            {name: variable(over, values, name, unit) for name, (values, unit) in columns.items()},
            {"frequency": variable(over, frequencies, "frequency", "Hz")},
            attributes(self, told),
        )
