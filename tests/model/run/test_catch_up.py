"""Realtime with run.catch_up: a short delay costs no period, a long one costs all of its periods."""

import pytest

from .hand import PERIOD, START, Bench


def patient() -> Bench:
    """A run behind its first tick that makes up for three and a half periods."""
    bench = Bench("realtime", **{"run.catch_up": 3.5 * PERIOD, "run.watchdog_timeout": 1e6})
    bench.at(0)
    bench.at(1)
    return bench


def test_tick_that_is_late_by_no_more_is_made_up_for_and_counted_as_late() -> None:
    bench = patient()
    bench.at(4.25)  # due at 2
    assert (bench.ticks, bench.run.deadline) == (2, START + 3 * PERIOD)
    assert bench.run.step()
    assert bench.run.step()
    assert not bench.run.step()
    assert (bench.ticks, bench.run.deadline) == (4, START + 5 * PERIOD)
    assert bench.counts() == {"drives_lost": 4, "late_ticks": 2}
    assert bench.run.snapshot().real_time_factor == pytest.approx(4 / 4.25)


def test_tick_that_is_later_leaves_out_all_periods_that_have_passed() -> None:
    bench = patient()
    bench.at(5.75)  # due at 2
    assert (bench.ticks, bench.run.deadline) == (2, START + 6 * PERIOD)
    assert not bench.run.step()
    assert bench.counts() == {"drives_lost": 2, "late_ticks": 1, "periods_missed": 3}


def test_without_it_a_tick_may_be_late_by_a_period() -> None:
    bench = Bench("realtime", **{"run.watchdog_timeout": 1e6})
    bench.at(0)
    bench.at(1.75)
    assert (bench.counts(), bench.run.deadline) == ({"drives_lost": 1}, START + 2 * PERIOD)
    bench.at(3.25)
    assert bench.counts() == {"drives_lost": 2, "late_ticks": 1, "periods_missed": 1}
