"""Random numbers of an instrument: one stream for each source, so that to switch one on changes no other."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.random_numbers import RandomStream
from ..parameters import InstrumentParameters
from .block import Layout
from .sensors import position_noise
from .tick import DRAW_TICKS

_Array = NDArray[np.float64]


class Draws:
    """Random numbers for DRAW_TICKS control ticks at a time.

    Parameters
    ----------
    layout : Layout
    samples_per_tick : int
    """

    def __init__(self, layout: Layout, samples_per_tick: int) -> None:
        self._layout, self._per_tick = layout, samples_per_tick
        self.numbers: _Array = np.zeros(DRAW_TICKS * layout.draws)
        """(DRAW_TICKS * draws,), as `tick` takes them; `draw` overwrites them."""

    def reset(self, seed: int) -> None:
        """Return to the start of a run: the same numbers again."""
        streams = (RandomStream(seed, number) for number in range(6))
        self._disturbance, self._noise, self._position_noise, self._chance, self._wander, self._between = streams

    def first(self) -> tuple[_Array, _Array]:
        """Those of the first measurement: of the detector (2,), of the position sensors (3,)."""
        return self._noise.standard_normal(2), self._position_noise.standard_normal(3)

    def draw(self, parameters: InstrumentParameters) -> bool:
        """Write those of the next ticks. What is off is not drawn and stays zero; False if nothing is on."""
        layout, places = self._layout, self._layout.places
        random = self.numbers.reshape(DRAW_TICKS, -1)
        anything = False
        for family, name, generator in (("plant", "disturbance", self._disturbance), ("fault", "faults", self._chance)):
            part = layout.parts[family].part
            if part.draws == 0:
                continue
            drawn = (
                part.draw(parameters, generator, DRAW_TICKS)
                if part.draw is not None
                else generator.standard_normal((DRAW_TICKS, part.draws))
            )
            if drawn is not None:
                random[:, places[name] : places[name] + part.draws] = drawn
                anything = True
        noise, position = places["noise"], places["position_noise"]
        samples = 2 * self._per_tick
        detector: Any = layout.parts["detector"].part
        if detector.noisy(parameters):
            random[:, noise : noise + samples] = self._noise.standard_normal((DRAW_TICKS, samples))
            anything = True
        if position_noise(parameters) > 0.0:
            # Those of the measurements are a stream of their own, the same at any rate of the ADC.
            end = position + 3 * self._per_tick
            between = self._between.standard_normal((DRAW_TICKS, end - 3 - position))
            random[:, position : end - 3] = between
            random[:, end - 3 : end] = self._position_noise.standard_normal((DRAW_TICKS, 3))
            anything = True
        if parameters.drift.wander > 0.0:
            random[:, places["wander"] : places["wander"] + 3] = self._wander.standard_normal((DRAW_TICKS, 3))
            anything = True
        return anything
