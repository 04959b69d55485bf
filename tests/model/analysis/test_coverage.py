"""Claim: the truth is within one and two of the uncertainties that are given in 68 and 95 % of all records."""

import math
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "tools"))
import examine

COLOURS = "white", "low-passed", "thermal"
"""1/f noise goes on below the record, where nothing tells it: docs/numerics.md."""
SURE = 2.6
"""Standard deviations of a count that are taken for chance."""
LARGE = 1.25
"""Uncertainties may be so much too large: Student's distribution takes 95 % and not 68 % for its measure."""
SYSTEMATIC = {
    "deflection_sensitivity: friction",  # half the difference of approach and retract
    "wedge: flat, N/V",  # the interpolation between loads
    "wedge: flat, dF/dN",
}
"""What is wrong about a model is in these, so that they may be larger."""
EXPECTED = {1.0: math.erf(math.sqrt(0.5)), 2.0: math.erf(math.sqrt(2.0))}
DRAWS = {
    "contact_fit": 24,
    "spring_constant": 90,
    "fit_resonator": 240,
    "wedge": 150,
    "step_height": 150,
    "force_curve": 240,
}


@pytest.mark.parametrize("case", examine.CASES)
def test_truth_is_within_the_uncertainty_as_often_as_it_says(case):
    for row in examine.examine(case, DRAWS.get(case, 400), COLOURS):
        for units, expected in EXPECTED.items():
            chance = SURE * math.sqrt(expected * (1.0 - expected) / row.off.size)
            assert row.within(units) > expected - chance, f"{row.name}: too small"
            if row.name not in SYSTEMATIC:
                assert row.within(units / LARGE) < expected + chance, f"{row.name}: too large"
