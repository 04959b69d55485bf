"""Settings of the tests of the law `predictive`."""

import numpy as np
import pytest


@pytest.fixture
def rng() -> np.random.Generator:
    """Return random numbers, the same in every run."""
    return np.random.default_rng(20260)
