"""Realtime under a clock of the test's own: exact counts, without one sleep. Times are in periods since the start."""

import math

import numpy as np
import pytest

from afm_model.run import RunState

from .hand import PERIOD, START, Bench

PATIENCE = 4.5
"""run.watchdog_timeout in periods."""


def started(ticks: int = 0, **values: object) -> Bench:
    bench = Bench("realtime", ticks, **{"run.watchdog_timeout": PATIENCE * PERIOD, **values})
    assert bench.at(0)
    return bench


def silent(bench: Bench, since: int, until: int) -> None:
    for k in range(since + 1, until + 1):
        bench.at(k)


def test_ticks_follow_the_clock_and_the_newest_drive_acts_from_the_next_tick_on() -> None:
    bench = started(4)
    assert (bench.state, bench.run.deadline, bench.link.published) == (RunState.RUNNING, START + PERIOD, [0])
    for k in range(4):
        bench.link.send(k, 0.01 * (k + 1))
        assert not bench.at(k + 0.999)
        assert bench.run.deadline == START + (k + 1) * PERIOD
        assert bench.at(k + 1)
    assert (bench.state, bench.ends, bench.run.deadline) == (RunState.FINISHED, 1, None)
    assert bench.drives[:, 0].tolist() == [0.01, 0.02, 0.03, 0.04]
    assert (bench.link.published, bench.counts()) == ([0, 1, 2, 3], {})
    assert bench.run.snapshot().real_time_factor == 1.0


def test_period_follows_the_real_time_factor_while_running() -> None:
    bench = started(**{"run.real_time_factor": 0.5})
    assert not bench.at(1)
    assert bench.at(2)
    run = bench.parameters.run.model_copy(update={"real_time_factor": 2.0})
    bench.run.adapt(bench.parameters.model_copy(update={"run": run}))
    assert bench.run.deadline == START + 2.5 * PERIOD
    assert not bench.at(2.4)
    assert bench.at(2.5) and bench.at(3.0)
    # What changes no period changes no deadline either.
    bench.now += 0.25 * PERIOD
    bench.run.adapt(bench.parameters.model_copy(update={"run": run.model_copy(update={"watchdog_timeout": 9.0})}))
    assert bench.run.deadline == START + 3.5 * PERIOD


# Drives: late, early, missing, in a burst.


def test_missing_drive_is_a_tick_on_the_one_before_and_is_counted() -> None:
    bench = started(4)
    for k in range(4):
        if k != 2:
            bench.link.send(k, 0.01 * (k + 1))
        bench.at(k + 1)
    assert bench.drives[:, 0].tolist() == [0.01, 0.02, 0.02, 0.04]
    assert bench.counts() == {"drives_lost": 1}
    assert np.isnan(bench.round_trips).tolist() == [False, False, True, False]


def test_drive_that_comes_two_periods_late_acts_then() -> None:
    bench = started(6)
    for k in range(6):
        if k >= 2:
            bench.link.send(k - 2, 0.01 * (k - 1))
        bench.at(k + 1)
    assert bench.drives[:, 0].tolist() == [0.0, 0.0, 0.01, 0.02, 0.03, 0.04]
    assert bench.counts() == {"drives_lost": 2}


def test_burst_puts_the_highest_sequence_in_force_whatever_the_order() -> None:
    bench = started(4)
    bench.at(1)
    bench.at(2)
    bench.at(3)
    for sequence in (1, 3, 0, 2):
        bench.link.send(sequence, 0.01 * (sequence + 1))
    bench.at(4)
    assert bench.drives[-1, 0] == 0.04
    assert bench.counts() == {"drives_lost": 3, "drives_outdated": 2}


def test_drive_for_an_older_measurement_that_comes_later_is_counted_and_not_put_in_force() -> None:
    bench = started(4)
    bench.at(1)
    bench.link.send(1, 0.05)
    bench.at(2)
    bench.link.send(0, 9.0)
    bench.at(3)
    bench.link.send(1, 8.0)  # the same measurement again: the first answer stands
    bench.at(4)
    assert bench.drives[:, 0].tolist() == [0.0, 0.05, 0.05, 0.05]
    assert bench.counts() == {"drives_lost": 3, "drives_outdated": 2}


def test_drive_for_a_measurement_that_is_not_published_is_counted_and_not_put_in_force() -> None:
    bench = started(2)
    bench.link.send(1, 9.0)
    bench.link.send(2**63, 9.0)
    bench.at(1)
    # What came too early does not keep the right one out.
    bench.link.send(1, 0.05)
    bench.at(2)
    assert bench.drives[:, 0].tolist() == [0.0, 0.05]
    assert bench.counts() == {"drives_lost": 1, "drives_ahead": 2}


def test_drive_that_is_not_finite_is_refused_and_named_and_the_one_before_holds() -> None:
    bench = started(3)
    bench.link.send(0, 0.05)
    bench.at(1)
    bench.link.send(1, math.nan)
    bench.at(2)
    bench.link.send(2, 0.0, z=-math.inf)
    bench.at(3)
    assert bench.drives[:, 0].tolist() == [0.05] * 3
    assert bench.counts() == {"drives_lost": 2, "drives_refused": 2}
    assert bench.run.snapshot().refusal == (
        "drive [0.0, 0.0, -inf] V is not allowed: it must be finite (answer to measurement 2 from /afm/hand)"
    )


def test_what_cannot_be_read_is_counted_and_keeps_no_drive_behind_it_from_its_tick() -> None:
    bench = started(3)
    for _ in range(3):
        bench.link.send_nonsense()
    bench.link.send(0, 0.05)
    bench.link.send_nonsense()
    bench.at(1)
    bench.link.send_nonsense()
    bench.at(2)
    bench.at(3)
    assert bench.drives[:, 0].tolist() == [0.05] * 3
    assert bench.counts() == {"drives_lost": 2, "drives_malformed": 5}
    assert bench.run.snapshot().unreadable == "2 bytes that are no PiezoDrive from /afm/hand"


def test_drive_for_a_measurement_too_old_to_be_known_is_outdated() -> None:
    bench = started(**{"run.watchdog_timeout": 1e6})
    for k in range(1, 4098):
        bench.at(k)
    bench.link.send(1, 9.0)
    bench.at(4098)
    bench.link.send(3, 0.05)
    bench.at(4099)
    assert bench.drives[-2:, 0].tolist() == [0.0, 0.05]
    assert bench.counts() == {"drives_lost": 4098, "drives_outdated": 1}


# Ticks: late, missed.


def test_late_tick_leaves_out_what_it_missed_and_never_makes_up_for_it() -> None:
    bench = started(**{"run.watchdog_timeout": 1e6})
    bench.at(1)
    bench.at(2.75)  # late, but by less than a period
    assert bench.counts() == {"drives_lost": 2}
    assert bench.run.deadline == START + 3 * PERIOD
    bench.at(7.25)  # due at 3: the ticks at 4, 5, 6, 7 are left out
    assert bench.counts() == {"drives_lost": 3, "late_ticks": 1, "periods_missed": 4}
    assert bench.ticks == 3
    # The grid of the deadlines stays.
    assert not bench.run.step()
    assert bench.run.deadline == START + 8 * PERIOD
    bench.at(8)
    assert (bench.ticks, bench.link.published) == (4, [0, 1, 2, 3, 4])
    bench.run.flush()
    assert bench.run.delays().lateness[3] == pytest.approx(4.25 * PERIOD)
    snapshot = bench.run.snapshot()
    assert (snapshot.time, snapshot.real_time_factor) == (4 * PERIOD, 0.5)


def test_pause_is_no_lateness_and_no_silence() -> None:
    bench = started()
    bench.at(1)
    bench.run.pause()
    assert (bench.state, bench.run.deadline) == (RunState.PAUSED, None)
    assert not bench.at(1000)
    bench.now += 0.25 * PERIOD
    bench.run.play()
    assert bench.run.deadline == START + 1001.25 * PERIOD
    bench.at(1001.25)
    assert (bench.state, bench.ticks, bench.counts()) == (RunState.RUNNING, 2, {"drives_lost": 2})
    # The controller has its time again, from the end of the pause on.
    bench.at(1004.25)
    assert bench.state == RunState.RUNNING
    bench.at(1005.25)
    assert bench.state == RunState.RETRACTED


# Wall times.


def test_round_trip_is_measured_at_the_arrival_of_the_drive_and_the_age_of_the_command_at_the_tick() -> None:
    bench = started(4)
    for k in range(4):
        # Measurement k goes out at k, its drive comes a quarter of a period later and waits for the tick.
        bench.link.send(k, arrived=START + (k + 0.25) * PERIOD)
        bench.at(k + 1)
    assert bench.round_trips == [0.25 * PERIOD] * 4
    assert bench.run.delays().round_trip[3] == 0.25 * PERIOD
    assert bench.run.delays().command_age[3] == PERIOD


def test_age_of_the_command_grows_while_a_drive_is_held() -> None:
    bench = started(3)
    bench.link.send(0)
    for k in range(1, 4):
        bench.at(k)
    assert bench.run.delays().command_age[3] == 3 * PERIOD
    assert bench.round_trips[0] == 0.0
    assert np.isnan(bench.round_trips[1:]).all()


def test_round_trip_leaves_out_what_was_published_before_the_first_drive_arrived() -> None:
    """While the nodes find each other measurements wait in a queue: that is discovery, not the controller."""
    bench = started(8, **{"run.watchdog_timeout": 1e6})
    for k in range(1, 4):
        bench.at(k)
    for sequence in range(4):
        bench.link.send(sequence, arrived=START + 3.5 * PERIOD)
    bench.at(4)
    assert np.isnan(bench.run.delays().round_trip).all()
    for k in range(4, 8):
        bench.link.send(k, arrived=START + (k + 0.125) * PERIOD)
        bench.at(k + 1)
    assert bench.run.delays().round_trip[3] == 0.125 * PERIOD
    # The trace has them all.
    assert bench.round_trips[3:] == [0.5 * PERIOD, *[0.125 * PERIOD] * 4]


def test_arrival_that_cannot_be_is_taken_for_the_nearest_that_can() -> None:
    """The middleware's clock is not ours and may be set."""
    bench = started(2)
    bench.link.send(0, arrived=START - 50.0)
    bench.at(1)
    bench.link.send(1, arrived=START + 50.0)
    bench.at(2)
    assert bench.round_trips == [0.0, PERIOD]


# Reset, faults.


@pytest.mark.parametrize(
    "state", [RunState.RUNNING, RunState.PAUSED, RunState.RETRACTED, RunState.FINISHED, RunState.FAULT]
)
def test_reset_goes_back_to_the_start_from_every_state(state: RunState) -> None:
    bench = started(8)
    bench.link.send(0, 0.05)
    silent(bench, 0, {RunState.RETRACTED: 6, RunState.FINISHED: 8}.get(state, 2))
    if state == RunState.PAUSED:
        bench.run.pause()
    elif state == RunState.FAULT:
        bench.run.fail("two simulators")
    assert bench.state == state
    bench.link.send(5, 9.0)  # still on its way
    bench.run.reset()
    assert (bench.state, bench.ticks, bench.counts()) == (RunState.WAITING, 0, {})
    bench.blocks.clear()
    now = 100
    if state == RunState.PAUSED:
        assert not bench.at(now)
        bench.run.play()
    assert bench.at(now)
    # Sequence 0 is new again, and the drive of before is not held.
    bench.at(now + 1)
    bench.link.send(0, 0.02)
    bench.at(now + 2)
    assert bench.drives[:, 0].tolist() == [0.0, 0.02]
    assert bench.counts() == {"drives_lost": 1}


def test_motion_that_diverges_is_told_with_the_age_of_the_drives() -> None:
    bench = started()
    bench.at(1)
    bench.link.send(0, 1.7e308)
    bench.at(2)
    detail = bench.run.snapshot().detail
    assert bench.state == RunState.FAULT
    assert detail.startswith("the motion diverged")
    assert detail.endswith("; the drives came in time, they were up to 2 control periods old")
    assert bench.run.deadline is None


def test_retracted_run_that_cannot_be_trusted_fails() -> None:
    bench = started()
    silent(bench, 0, 6)
    assert bench.state == RunState.RETRACTED
    bench.run.fail("two simulators")
    assert bench.told[-1] == (RunState.FAULT, "two simulators")
