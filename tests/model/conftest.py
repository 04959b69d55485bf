"""Settings shared by the tests of the model."""

import math

import numpy as np
import pytest

from .oracle import Trajectory, event_driven, paper_lateral


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers, the same in every run."""
    return np.random.default_rng(20260)


@pytest.fixture(scope="session")
def period() -> Trajectory:
    """The event-driven reference of section 4.1 of the paper over one period, at every time unit."""
    load = (2.0 * math.pi * 0.24) ** 2 * 0.01 + 0.01  # of the cantilever held at z_r = 0.01
    return event_driven(
        paper_lateral(load),
        lambda t: (20.0 * math.sin(0.005 * t),) * 2,
        lambda t: (0.1 * math.cos(0.005 * t),) * 2,
        np.arange(1257.0),
    )
