"""Claims about the loop of predictive as it is closed, filter included: linearised from its code over a period."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from law_loop import ESTIMATES, PLANT, Loop, multiplier

NO_MEMORY = {"hysteresis": "none", "creep": "none"}


@pytest.fixture(scope="module")
def loop() -> Loop:
    return Loop(2e-4, 1, surface="known")


@pytest.fixture(scope="module")
def matrix(loop) -> np.ndarray:
    return loop.matrix()


def test_a_deviation_is_smaller_after_a_period_told_and_a_period_late(matrix):
    assert max(abs(np.linalg.eigvals(matrix))) < 1.0
    assert multiplier(Loop(2e-4, 1, 1, omega=60.0, surface="known", **NO_MEMORY)) < 1.0


def test_at_a_corner_the_loop_has_no_matrix():
    # There the tip is at the speed that is rest.
    assert np.isnan(multiplier(Loop(2e-4, 1, omega=55.0, surface="known", **NO_MEMORY)))


def test_matrix_of_one_period_foretells_the_next_one():
    # Openings that are zero stand at their limit, where what a period makes of a deviation has a corner.
    loop = Loop(2e-4, 1, omega=60.0, surface="known", **NO_MEMORY)
    matrix = loop.matrix()
    # Far from the eigenvectors; what is left after a period is what the numbers looked at carry on.
    change = np.concatenate([np.zeros(len(PLANT)), [1.0, -2.0, 1.5, 0.5, 1.0, -1.0]])
    once, twice = loop.left(change, loop.ticks), loop.left(change, 2 * loop.ticks)
    np.testing.assert_allclose(once, matrix @ change, rtol=1e-3, atol=1e-3 * np.abs(once).max())
    # The gains of the filter repeat themselves nearly.
    np.testing.assert_allclose(twice, matrix @ once, atol=0.4 * np.abs(twice).max())


def test_scanner_and_filter_are_separate(matrix):
    # docs/predictive.md (8.11): a deviation of the scanner leaves next to none of the estimates, one of the estimates
    # moves the scanner.
    n = len(PLANT)
    assert np.abs(matrix[n:, :n]).max() < 5e-2 * np.abs(matrix[n:, n:]).max()
    assert np.abs(matrix[:n, :n]).max() < 5e-3
    # Where no hysteresis is learned, none.
    without = Loop(2e-4, 1, surface="known", **NO_MEMORY).matrix()
    assert np.abs(without[n:, :n]).max() < 1e-2 * np.abs(without[n:, n:]).max()
    assert np.abs(without[:n, :n]).max() < 1e-3


def test_filter_that_believes_its_model_forgets_nothing(loop):
    believed = {name: "nominal" for name in ("lateral_gain", "slow_force", "stiffness")}
    held = Loop(2e-4, 1, surface="known", **NO_MEMORY, **believed)
    # What is believed is changed here alone, and nothing corrects it.
    change = np.zeros(10)
    change[len(PLANT) + ESTIMATES.index("slow force")] = 1.0
    assert held.left(change, held.ticks)[len(PLANT) + ESTIMATES.index("slow force")] == pytest.approx(1.0, rel=1e-6)
    assert abs(loop.left(change, loop.ticks)[len(PLANT) + ESTIMATES.index("slow force")]) < 1.0
