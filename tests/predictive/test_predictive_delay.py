"""The delay that the friction-predicting law finds by itself."""

from copy import deepcopy
from typing import Any

import pytest
from model.tables import record_of

from afm_model import Controller, Instrument, build
from afm_model.core.records import record_at
from afm_model.law import TimingWarning
from afm_model.parameters import ControllerParameters
from afm_model.parts.signals import Measurement
from afm_model.studies.contender import contender
from afm_model.studies.wrong_models import CASE, Rate, run_case
from afm_predictive.constants import LATER, SLOTS, values
from afm_predictive.flight import find_delay

from .predictive_records import records
from .test_predictive import error, parameters, run


def told(p: Any, s: Any, late: int, at: range) -> None:
    """Tell of drives in force that answer the measurement so many control periods before."""
    for k in at:
        find_delay(k, record_of(Measurement, drive_sequence=max(k - 1 - late, -1)), p, s)


def test_less_delay_is_believed_at_once_and_more_after_ten_answers():
    p, s = records(delay_ticks=2)
    told(p, s, 2, range(8))
    assert (s.delay, s.off_told) == (2, 0)
    told(p, s, 1, range(8, 9))
    assert (s.delay, s.off_told) == (1, -1)
    told(p, s, 3, range(11, 20))
    assert s.delay == 1
    told(p, s, 2, range(20, 21))
    # The least of them.
    assert (s.delay, s.off_told) == (2, 0)


def test_one_answer_in_time_says_that_the_others_were_late():
    p, s = records(delay_ticks=1)
    for begin in range(5, 100, 10):
        told(p, s, 2, range(begin, begin + 9))
        told(p, s, 1, range(begin + 9, begin + 10))
    assert s.delay == 1


def test_answers_that_do_not_arrive_are_no_delay():
    p, s = records(delay_ticks=1)
    for k in range(10, 100):
        find_delay(k, record_of(Measurement, drive_sequence=8), p, s)
    assert s.delay == 1


def test_no_drive_yet_says_nothing():
    p, s = records(delay_ticks=3)
    for k in range(50):
        find_delay(k, record_of(Measurement, drive_sequence=-1), p, s)
    assert s.delay == 3


def test_it_is_found_in_slots_and_not_beyond_what_an_answer_holds():
    p, s = records(delay_ticks=1, packet=20, spare=1)
    told(p, s, 2, range(5, 20))
    assert s.delay == 40
    told(p, s, 9, range(20, 40))
    assert s.delay == (1 + LATER) * 20
    whole = {"law.kind": "predictive", "law.packet": 64, "law.delay_ticks": 1, "law.reserve": SLOTS - 128}
    assert values(build(ControllerParameters, whole))["most_delay"] == 64


def test_as_told_is_believed():
    assert records(delay="nominal")[0].finds_delay == 0
    assert records()[0].finds_delay == 1


@pytest.mark.parametrize("period", [40e-6, 75e-6, 200e-6])
@pytest.mark.parametrize("title", ["told a tick of delay too few", "told a tick of delay too many"])
def test_a_delay_that_is_told_wrong_costs_nothing(period, title):
    rate, law = Rate("", period, 1), contender("predictive surface=observed")
    right, wrong = run_case(CASE["the truth"], rate, law)["third"], run_case(CASE[title], rate, law)["third"]
    assert wrong < 1.5 * right + 0.01


def test_believed_as_told_a_tick_too_many_loses_the_loop():
    law = contender("predictive surface=observed delay=nominal")
    assert not run_case(CASE["told a tick of delay too many"], Rate("", 75e-6, 1), law)["third"] < 100.0


def test_it_is_said():
    with pytest.warns(TimingWarning, match="law.delay_ticks = 1 should be plant.delay_ticks = 2"):
        result = run(1e-4, 1, {"law.surface": "known"}, 1.0, 2.0, plant__delay_ticks=2)
    assert error(result.score) < 0.1
    assert "1 control period later than law.delay_ticks" in result.remark
    assert result.estimates["delay"][-1] == pytest.approx(2e-4)


def test_it_is_found_while_it_changes():
    period, worst = 1e-4, [0.0, 0.0]
    sim, controller = parameters(period, 1, {"law.surface": "known"}, {}, 0.5, 3.0)
    instrument, answers = Instrument(sim, 3000), Controller(controller)
    held = deepcopy(answers.answer(instrument.measurement)), 0
    for tick in range(3000):
        # From a time on the transport takes a period more.
        now = deepcopy(answers.answer(instrument.measurement, tick * period)), tick
        instrument.tick(*(now if tick < 1500 else held))
        held = now
        y = record_at(instrument.measurement, 0, Measurement)
        if tick % 1500 > 700:
            worst[tick // 1500] = max(worst[tick // 1500], *abs(y.position - y.reference_position)[:2] / 5e-11)
    assert worst[0] < 0.1 and worst[1] < 0.1
