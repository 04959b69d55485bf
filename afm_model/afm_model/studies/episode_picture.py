"""The picture of an episode of `afm_model.studies.learning`, as pixels."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.optional import needed
from ..parameters import SimParameters
from ..parts.signals import Measurement
from ..run.plotting import SIZE, Curves, draw

_DPI = 60
"""Pixels an inch: a picture has 720 x 570."""


class EpisodePicture:
    """Keeps the measurements of an episode and draws them.

    Parameters
    ----------
    sim : SimParameters
    """

    def __init__(self, sim: SimParameters) -> None:
        self._sim = sim
        self._times: list[float] = []
        self._measurements: list[NDArray[np.float64]] = []

    def begin(self) -> None:
        """Forget the episode before."""
        self._times.clear()
        self._measurements.clear()

    def add(self, time: float, measurement: NDArray[np.float64]) -> None:
        """Keep a measurement of simulated time `time` [s]."""
        self._times.append(time)
        self._measurements.append(measurement.copy())

    def pixels(self) -> NDArray[np.uint8]:
        """Draw position, reference, errors, drive and lateral force up to now, (570, 720, 3).

        Raises
        ------
        ImportError
            If matplotlib is not installed.
        """
        y: Any = np.array(self._measurements).view(Measurement)[:, 0]
        reference, position = y["reference_position"], y["position"]
        error = position - reference
        error[:, 2] = self._sim.cantilever.a + y["deflection"] - reference[:, 2]
        figure = needed("matplotlib.figure", "a picture").Figure(figsize=SIZE, dpi=_DPI, layout="constrained")
        canvas = needed("matplotlib.backends.backend_agg", "a picture").FigureCanvasAgg(figure)
        draw(figure, Curves(np.array(self._times), position, reference, error, y["drive"], y["lateral_force"]))
        canvas.draw()
        return np.array(canvas.buffer_rgba())[..., :3]
