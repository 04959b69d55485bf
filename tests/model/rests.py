"""The rests of a run, step by step."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from afm_model import Simulation

CHANNELS = "truth/stuck, truth/velocity_x, truth/velocity_y"
"""detector.channels of a run whose rests are looked at; with detector.sample_period = plant.dt every step is there."""
SLIP = 1e-4
"""Speed [x0 w0] that a motion must reach to be a slip; a true one goes on to 1 and more."""


@dataclass(frozen=True)
class Rest:
    """Samples start to stop, without stop."""

    start: int
    stop: int
    period: float  # of the samples [s]

    @property
    def duration(self) -> float:
        """[s]"""
        return (self.stop - self.start) * self.period


def speed(run: Simulation) -> NDArray[np.float64]:
    """Lateral speed at the samples [x0 w0]."""
    scales = run.parameters.scales
    lateral = np.hypot(run.channel("truth/velocity_x"), run.channel("truth/velocity_y"))
    return np.asarray(lateral / (scales.x0 * scales.w0))


def raw_rests(run: Simulation) -> list[Rest]:
    """Every stretch of samples at rest in the scored part, in their order."""
    stuck = run.channel("truth/stuck") != 0.0
    stuck &= run.time_samples >= run.parameters.score_start - 1e-9
    edges = np.flatnonzero(np.diff(np.concatenate([[False], stuck, [False]])))
    period = run.parameters.detector.sample_period
    return [Rest(int(a), int(b), period) for a, b in edges.reshape(-1, 2)]


def rests(run: Simulation) -> list[Rest]:
    """Rests with a slip between them, the shortest first: what moves more slowly between two is no slip."""
    moving = speed(run)
    joined: list[Rest] = []
    for each in raw_rests(run):
        if joined and moving[joined[-1].stop : each.start].max() < SLIP:
            joined[-1] = Rest(joined[-1].start, each.stop, each.period)
        else:
            joined.append(each)
    return sorted(joined, key=lambda rest: rest.duration)
