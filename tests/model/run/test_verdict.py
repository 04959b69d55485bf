"""What is told about the quality of a run."""

import math

import pytest

from afm_model.run import Counts, RunState, Snapshot, reasons, retracted_fraction, shortfall, verdict, warning, warnings

from .hand import PERIOD, Bench


def look(ticks: int, elapsed: float, factor: float | None = 1.0, **counts: int) -> Snapshot:
    return Snapshot(
        state=RunState.RUNNING,
        detail="",
        ticks=ticks,
        time=ticks * 1e-3,
        stamp_ns=0,
        samples=0,
        elapsed=elapsed,
        wanted_factor=factor,
        in_contact=True,
        counts=Counts(**counts),
        refusal="",
    )


def test_run_without_trouble_has_no_warning() -> None:
    assert warnings(look(0, 0.0), look(1000, 1.0)) == []
    assert warnings(look(10, 0.0), look(10, 1.0)) == []


def test_missed_periods_are_told_with_their_share_and_the_factor_reached_since_the_last_look() -> None:
    before = look(1000, 1.0, periods_missed=5, late_ticks=5)
    assert warnings(before, look(1250, 2.0, periods_missed=755, late_ticks=6)) == [
        "750 of the last 1000 periods were missed (75 %): the run reaches 0.25 of real time in place of 1"
    ]
    assert warnings(before, before) == []


@pytest.mark.parametrize(("missed", "told"), [(10, 0), (11, 1)])
def test_one_period_in_a_hundred_may_be_missed(missed: int, told: int) -> None:
    assert len(warnings(look(0, 0.0), look(990, 1.0, periods_missed=missed))) == told


@pytest.mark.parametrize(("lost", "told"), [(500, 0), (501, 1)])
def test_half_of_the_ticks_may_run_on_a_held_drive(lost: int, told: int) -> None:
    sentence = "501 of the last 1000 ticks had no new drive and held an older one"
    assert warnings(look(0, 0.0), look(1000, 1.0, drives_lost=lost)) == [sentence] * told
    # In lockstep it means something else: measurements sent again.
    assert warnings(look(0, 0.0, None), look(1, 1.0, None, drives_lost=lost)) == []


def test_drives_that_were_not_put_in_force_are_told_by_kind() -> None:
    before = look(0, 0.0, None, drives_outdated=2, drives_ahead=1)
    assert warnings(before, look(5, 1.0, None, drives_outdated=5, drives_ahead=5)) == [
        "3 drives answered an older measurement than one before them and were not put in force",
        "4 drives answered a measurement that has not been published and were not put in force",
    ]


def silent_run(ticks: int, **values: object) -> Bench:
    bench = Bench("realtime", ticks, **{"run.watchdog_timeout": 4.5 * PERIOD, **values})
    bench.at(0)
    for k in range(1, ticks + 1):
        bench.at(k)
    assert bench.state == RunState.FINISHED
    return bench


def test_run_with_the_sample_retracted_is_not_valid_and_says_why() -> None:
    bench = silent_run(20)
    summary, end = bench.run.instrument.score(), bench.run.snapshot()
    assert retracted_fraction(summary, end) == 0.8
    assert verdict(summary, end) == ("the sample was retracted in 16 of 20 scored ticks (80 %), because no drive came")


def test_run_that_is_retracted_only_before_it_is_scored_is_valid() -> None:
    bench = Bench("realtime", 20, **{"run.watchdog_timeout": 4.5 * PERIOD, "score.start": 15 * PERIOD})
    bench.at(0)
    for k in range(1, 21):
        if k > 10:
            bench.link.send(k - 1)
        bench.at(k)
    summary, end = bench.run.instrument.score(), bench.run.snapshot()
    assert bench.counts()["ticks_retracted"] == 6
    assert (retracted_fraction(summary, end), verdict(summary, end)) == (0.0, "")


def test_run_of_which_nothing_is_scored_has_no_verdict() -> None:
    bench = silent_run(20, **{"score.start": 1.0})
    summary, end = bench.run.instrument.score(), bench.run.snapshot()
    assert math.isnan(retracted_fraction(summary, end))
    assert verdict(summary, end) == ""


@pytest.mark.parametrize(
    ("answered", "valid", "warned"),
    [
        (1000, True, False),
        (991, True, False),
        (985, True, True),
        (500, True, True),
        (494, False, False),
        (47, False, False),
    ],
)
def test_score_on_held_drives_has_a_warning_and_with_more_than_half_of_them_it_is_not_valid(
    answered: int, valid: bool, warned: bool
) -> None:
    """At the start a few ticks run before they are scored: these do not count."""
    bench = Bench("realtime", 1020, **{"run.watchdog_timeout": 2000 * PERIOD, "score.start": 20 * PERIOD})
    bench.at(0)
    for k in range(1, 1021):
        if k > 20 and (k - 20) * answered // 1000 > (k - 21) * answered // 1000:
            bench.link.send(k - 1)
        bench.at(k)
    summary, end = bench.run.instrument.score(), bench.run.snapshot()
    assert (summary.ticks, end.scored_ticks_held) == (1000, 1000 - answered)
    told = f"{1000 - answered} of 1000 scored ticks ({100 - answered / 10:.3g} %) ran on a held drive"
    found = reasons(summary, end, bench.parameters)
    assert [each.startswith(told) for each in found] == [True] * (not valid)
    assert warning(summary, end).startswith(told) == warned
    assert bool(warning(summary, end)) == warned


def test_run_that_fell_behind_says_what_it_reached() -> None:
    assert shortfall(look(1000, 1.0)) == ""
    assert shortfall(look(1000, 4.0, periods_missed=3000)) == (
        "75 % of the periods were missed (3000 of 4000): the run reached 0.25 of real time in place of 1"
    )
    assert shortfall(look(1000, 4.0, None)) == ""
