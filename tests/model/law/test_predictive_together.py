"""Claims about the filter that estimates position and friction together, from positions and the lateral force."""

import math

import numpy as np
import pytest

from afm_model import Controller, ControllerParameters, Instrument, build
from afm_model.law.predictive.predictive_constants import Constants, values
from afm_model.law.predictive.predictive_state import State, start
from afm_model.law.predictive.together import AT_X, AT_Y, RATIO, SPEED, begin_together, carry, take

from ..tables import record_of
from .test_predictive import NOISE, NOTHING, PERIOD, error, parameters, run, smoothness

MEASURED = {"law.feedback": "measured", **NOTHING}
DIAGONAL = math.sqrt(0.5)


def records(**law):
    """Constants and state of the law that is told nothing but positions, deflection and lateral force."""
    told = {"law.kind": "predictive", "law.feedback": "measured", "law.period": 2e-4}
    made = build(ControllerParameters, told | {f"law.{k}": v for k, v in law.items()})
    p, s = record_of(Constants, **values(made)), record_of(State, **start(made))
    begin_together(p, s)
    return p, s


@pytest.mark.parametrize(("seed", "first", "periods"), [(0, 0.5, 1.0), (1, 2.0, 3.0), (2, 2.0, 3.0)])
def test_positions_alone_are_enough_at_200_us_with_nothing_known(seed, first, periods):
    noise = {name.replace(".", "__"): value for name, value in NOISE.items()}
    result = run(2e-4, 1, MEASURED, first, periods, **noise, plant__seed=seed)
    # 0.26 to 0.41 % rms; the largest of 600 errors is three to four times that.
    assert max(result.score.rms[:2]) < 0.0042 * 5e-9
    assert error(result.score) < 2.4
    assert smoothness(result) < 2.0
    assert result.score.contact_fraction == 1.0


def test_the_estimate_is_four_times_better_than_a_position_and_knows_how_good_it_is():
    sim, controller = parameters(2e-4, 1, MEASURED, NOISE, 0.5, 1.0)
    ticks = round(PERIOD / 2e-4)
    instrument, law = Instrument(sim, ticks), Controller(controller)
    missed, expected = [], []
    for tick in range(ticks):
        answer = law.answer(instrument.measurement, tick * 2e-4)
        if tick > ticks // 2:
            missed.append(law.state.estimate[:2] * sim.scales.x0 - instrument.truth.position[:2])
            expected.append(np.diag(law.state.uncertainty)[:2] * sim.scales.x0**2)
        instrument.tick(answer)
    rms = math.sqrt(np.square(missed).mean())
    assert rms < 5e-11 / 4.0
    assert rms < 1.5 * math.sqrt(np.mean(expected))


def test_friction_is_found_from_below_before_a_tenth_of_a_period_is_over():
    # Told 20 % too little, the law begins at 0.75 of that: the ratio that it has to find is 1.25.
    sim, controller = parameters(2e-4, 1, MEASURED, NOISE, 0.0, 1.0)
    instrument, law = Instrument(sim, 200), Controller(controller)
    ratios = []
    for tick in range(round(0.1 * PERIOD / 2e-4)):
        instrument.tick(law.answer(instrument.measurement, tick * 2e-4))
        ratios.append(float(law.state.ratio[0]))
    assert ratios[0] == pytest.approx(0.75, abs=0.05)
    assert ratios[-1] == pytest.approx(1.25, rel=0.03)
    assert max(ratios) < 1.25 * 1.03


def test_friction_that_is_not_known_makes_the_speed_uncertain_and_nothing_across():
    p, s = records()
    across = s.uncertainty[AT_X, AT_X]
    carry(0.2, DIAGONAL, DIAGONAL, float(p.f_0), p, s)
    assert s.uncertainty[SPEED, SPEED] == pytest.approx((p.of_drive[1] * p.f_0) ** 2, rel=1e-2)
    off = 0.5 * (s.uncertainty[AT_X, AT_X] + s.uncertainty[AT_Y, AT_Y]) - s.uncertainty[AT_X, AT_Y]
    assert off == pytest.approx(across, rel=0.01)


def test_a_measurement_corrects_what_it_is_correlated_with():
    p, s = records()
    carry(0.2, DIAGONAL, DIAGONAL, float(p.f_0), p, s)
    # A tenth more friction than believed: the scanner is slower by what that takes off in a period.
    take(RATIO, 0.1, 1e-6, s)
    assert s.change[RATIO] == pytest.approx(0.1, rel=1e-3)
    assert s.change[SPEED] == pytest.approx(-0.1 * p.of_drive[1] * p.f_0, rel=1e-2)
    assert s.uncertainty[RATIO, RATIO] < 1e-9


@pytest.mark.parametrize(
    ("law", "together"),
    [
        ({}, True),
        ({"surface": "learned"}, False),
        ({"surface": "learned", "packet": 4}, True),
        ({"period": 1e-4}, False),
        ({"surface": "known"}, False),
        ({"friction": "nominal"}, False),
        ({"feedback": "full"}, False),
    ],
)
def test_one_filter_estimates_both_where_nothing_is_known_and_a_period_is_long(law, together):
    p, _ = records(**law)
    assert bool(p.together) == together


def test_uncertainty_stays_symmetric_and_positive():
    sim, controller = parameters(2e-4, 1, MEASURED, NOISE, 0.0, 1.0)
    instrument, law = Instrument(sim, 700), Controller(controller)
    for tick in range(600):
        instrument.tick(law.answer(instrument.measurement, tick * 2e-4))
        known = np.array(law.state.uncertainty)
        assert known == pytest.approx(known.T, abs=1e-12)
        assert np.linalg.eigvalsh(known)[0] > -1e-9
