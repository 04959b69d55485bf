"""Claims about the standard deviations that the friction-predicting law publishes: they cover what is true."""

import pytest

from afm_model.studies.wrong_models import RATES

from .law_records import estimates

NOTHING_WRONG = {
    **{f"lateral_gain_{axis}": 1.0 for axis in "xy"},
    "slow_force_x": 0.0,
    "stiffness_x": 1.0,
}
# With a resonance told f times too high a drive seems to push f^2 times too much, and friction as much more.
WRONG = {
    "resonances -5 %": {f"lateral_gain_{axis}": 0.95**2 for axis in "xy"},
    "resonance of x +2 %": {"lateral_gain_x": 1.02**2},
    "lateral gain 0.9": {f"lateral_gain_{axis}": 1.0 / 0.9 for axis in "xy"},
    "along x alone": {},
    "along y alone": {},
}


@pytest.mark.parametrize("rate", range(len(RATES)))
@pytest.mark.parametrize("title", WRONG)
def test_three_deviations_cover_what_is_true(title, rate):
    found = estimates(title, rate, "learned")
    for name, value in (NOTHING_WRONG | WRONG[title]).items():
        for at in (len(found["time"]) // 2, -1):
            off = abs(found[name][at] - value)
            assert off <= 3.0 * found[f"{name}_deviation"][at], f"{name}: {off}"


@pytest.mark.parametrize("surface", ["known", "learned"])
@pytest.mark.parametrize("rate", range(len(RATES)))
def test_an_axis_that_rests_does_not_tell_its_spring(rate, surface):
    # The noise of its position had been taken for a motion that no spring answers: a stiffness of 0.07, +-0.04.
    found = estimates("along y alone", rate, surface)
    deviation = found["stiffness_x_deviation"]
    assert deviation[-1] > 0.5 * deviation[0] and found["stiffness_x"][-1] == pytest.approx(1.0, abs=deviation[-1])
