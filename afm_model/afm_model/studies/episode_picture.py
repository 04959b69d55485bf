"""The pictures of episodes of `learning` and of lines of `scan_line`, as pixels."""

from collections.abc import Callable
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
        figure, pixels = _canvas()
        draw(figure, Curves(np.array(self._times), position, reference, error, y["drive"], y["lateral_force"]))
        return pixels()


def _canvas() -> tuple[Any, Callable[[], NDArray[np.uint8]]]:
    """Return an empty figure, and what makes pixels of it."""
    figure = needed("matplotlib.figure", "a picture").Figure(figsize=SIZE, dpi=_DPI, layout="constrained")
    canvas = needed("matplotlib.backends.backend_agg", "a picture").FigureCanvasAgg(figure)

    def pixels() -> NDArray[np.uint8]:
        canvas.draw()
        return np.array(canvas.buffer_rgba())[..., :3]

    return figure, pixels


def line_pixels(line: Any) -> NDArray[np.uint8]:
    """Draw a `ScannedLine`: true height, trace and retrace, error of the z loop, force, (570, 720, 3).

    Raises
    ------
    ImportError
        If matplotlib is not installed.
    """
    figure, pixels = _canvas()
    height, error, force = figure.subplots(3, 1)
    x, finer = 1e9 * line.x, 1e9 * np.linspace(line.x[0], line.x[-1], line.error.size // 2)
    height.plot(x, 1e9 * line.true_height[0], color="0.7", linewidth=5.0, label="sample")
    for axes, at, unit, values in (
        (height, x, 1e9, line.height),
        (error, finer, 1e9, line.error.reshape(2, -1)),
        (force, finer, 1e9, line.force_seen.reshape(2, -1)),
    ):
        for name, each in zip(("trace", "retrace"), values, strict=True):
            axes.plot(at, unit * each, linewidth=1.0, label=name)
        axes.grid(alpha=0.3)
    height.legend(ncols=3, frameon=False)
    for axes, label in ((height, "height [nm]"), (error, "z loop error [nm]"), (force, "force [nN]")):
        axes.set(xlabel="x [nm]", ylabel=label)
    return pixels()
