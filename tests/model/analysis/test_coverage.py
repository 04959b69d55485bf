"""Claim: the truth is within one and two of the uncertainties that are given in 68 and 95 % of all records."""

import math
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "tools"))
import examine

COLOURS = "white", "low-passed", "thermal"
"""1/f noise goes on below the record, where nothing tells it: docs/numerics.md."""
SURE = 2.6
"""Standard deviations of a count that are taken for chance."""
LARGE = 1.2
"""Uncertainties may be so much too large: Student's distribution takes 95 % and not 68 % for its measure."""
SYSTEMATIC = {
    "deflection_sensitivity: friction",  # half the difference of approach and retract
    "deflection_sensitivity: without friction",  # how the baseline goes on in contact
    "wedge_by_flat: N/V",  # the interpolation between loads
    "wedge_by_flat: dF/dN",
    "verbs: lateral, N/V",
    "verbs: deflection, m/V",
    *(f"fit_resonator: {name}" for name in ("f", "damping", "sensitivity")),  # at least that of white noise
}
"""What is wrong about a model is in these, so that they may be larger."""
DRAWS = {
    "contact_fit": 12,
    "deflection_sensitivity": 100,
    "fit_resonator": 150,
    "force_curve": 60,
    "spring_constant": 200,
    "step_height": 150,
    "wedge_by_flat": 60,
    "verbs": 6,
}
"""Of slow cases; others have 400."""
MORE_DRAWS = {
    "deflection_sensitivity": 400,
    "force_curve": 300,
    "spring_constant": 400,
    "step_height": 200,
    "verbs": 12,
}
"""Of some of them in the long test."""
ENOUGH = 150
"""Draws that tell a wrong factor."""


def wrong(off: np.ndarray, larger: bool) -> str:
    """What is wrong about the uncertainties in whose units answers are so far off."""
    for units in (1.0, 2.0):
        expected = math.erf(units * math.sqrt(0.5))
        chance = SURE * math.sqrt(expected * (1.0 - expected) / off.size)
        if np.mean(np.abs(off) <= units) < expected - chance:
            return "too small"
        if not larger and np.mean(np.abs(off) <= units / LARGE) > expected + chance:
            return "too large"
    return ""


@pytest.mark.parametrize(
    ("case", "draws"),
    [
        *((case, DRAWS.get(case, 400)) for case in examine.CASES),
        *(pytest.param(case, draws, marks=pytest.mark.long) for case, draws in MORE_DRAWS.items()),
    ],
)
def test_truth_is_within_the_uncertainty_as_often_as_it_says(case, draws):
    rows = examine.examine(case, draws, COLOURS)
    assert rows
    for row in rows:
        assert row.off.size > 0.9 * draws, row.name
        larger = row.name in SYSTEMATIC
        assert wrong(row.off, larger) == "", row.name
        # The claim would not hold for uncertainties that are smaller or larger by a half.
        if row.off.size >= ENOUGH and not larger:
            assert (wrong(1.5 * row.off, larger), wrong(row.off / 1.5, larger)) == ("too small", "too large"), row.name
