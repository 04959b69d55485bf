"""Realtime behind a controller that is silent, or sends nothing of use: the sample is retracted, and comes back."""

import math

import numpy as np
import pytest

from afm_model.run import RunState

from .hand import PERIOD
from .test_realtime import PATIENCE, silent, started

DOWN = -240e-9 / 20e-9
"""Drive of the retracted sample [V]: run.retract_distance over piezo.sensitivity_z."""


def test_silent_controller_has_the_sample_retracted_tick_by_tick_and_its_next_drive_brings_it_back() -> None:
    steps, back = 8, 3.0  # ticks; V in a tick
    speeds = {"run.retract_time": steps * PERIOD, "run.return_speed": back * 20e-9 / PERIOD}
    bench = started(28, **speeds)
    bench.link.send(0)
    bench.at(1)
    silent(bench, 1, 5)
    assert bench.state == RunState.RUNNING
    silent(bench, 5, 6)
    assert bench.told[-1] == (
        RunState.RETRACTED,
        f"no valid drive from /afm/hand for {PATIENCE * PERIOD:g} s (run.watchdog_timeout; 0 refused as NaN or "
        "infinite): the sample is retracted",
    )
    silent(bench, 6, 16)
    assert not bench.run.instrument.in_contact
    bench.link.send(15, 0.02)
    bench.at(17)
    assert bench.state == RunState.RUNNING
    silent(bench, 17, 21)
    x, z = bench.drives[:, 0], bench.drives[:, 2]
    ramp = bench.rest + (DOWN - bench.rest) * np.arange(1, steps + 1) / steps
    assert z[:5].tolist() == [bench.rest] * 5
    assert z[5 : 5 + steps] == pytest.approx(ramp)
    assert z[5 + steps : 16] == pytest.approx(DOWN)
    # What jumps to the tip loses contact again.
    assert z[16:] == pytest.approx([DOWN + 3.0, DOWN + 6.0, DOWN + 9.0, DOWN + 12.0, bench.rest], abs=1e-12)
    assert x[16:].tolist() == [0.02] * 5
    # Ticks 5 to 15; every one but the first and the 17th held a drive.
    assert bench.counts() == {"drives_lost": 19, "ticks_retracted": 11, "scored_ticks_retracted": 11}
    assert bench.states == [RunState.RUNNING, RunState.RETRACTED, RunState.RUNNING]


def test_drive_goes_back_without_a_leap_behind_a_gap_that_was_too_short_for_a_retract() -> None:
    bench = started(**{"run.retract_time": PERIOD, "run.return_speed": 2.0 * 20e-9 / PERIOD})
    for k in (0, 3):  # the first gap is as short as a retract
        bench.link.send(k, 5.0 * (k == 0))
        silent(bench, k, k + 3)
    bench.link.send(6, 5.0)
    silent(bench, 6, 9)
    assert bench.state == RunState.RUNNING
    assert bench.drives[:, 0].tolist() == [5.0] * 3 + [3.0, 1.0, 0.0, 2.0, 4.0, 5.0]


def test_controller_that_answers_with_leaps_has_the_drive_again_in_the_end() -> None:
    bench = started(**{"run.retract_time": PERIOD, "run.return_speed": 240e-9 / (6 * PERIOD)})
    bench.link.send(0)
    bench.at(1)
    silent(bench, 1, 8)
    assert bench.state == RunState.RETRACTED
    # Twice the way of retracting takes twelve ticks at this speed, of 2 V each.
    for k in range(8, 22):
        bench.link.send(k, 5.0 * (-1) ** k)
        bench.at(k + 1)
    x = bench.drives[8:, 0]
    assert np.abs(np.diff(x))[:11] == pytest.approx(2.0)
    assert np.abs(x[12:]).tolist() == [5.0] * 2


def test_sample_that_is_below_already_moves_up_to_the_retracted_position_and_stays() -> None:
    bench = started(**{"run.retract_time": 2 * PERIOD})
    bench.link.send(0, z=DOWN - 4.0)
    bench.at(1)
    silent(bench, 1, 9)
    assert bench.drives[5:, 2] == pytest.approx([DOWN - 2.0, DOWN, DOWN, DOWN])


@pytest.mark.parametrize(
    ("sequence", "x", "told"),
    [
        (None, math.nan, "5 refused as NaN or infinite)"),
        (0, 0.0, "0 refused as NaN or infinite, 5 for an older measurement)"),
        (9999, 0.0, "0 refused as NaN or infinite, 5 for a future one)"),
    ],
    ids=["nan", "always the first measurement", "the future"],
)
def test_controller_that_sends_nothing_of_use_is_as_silent_as_none_and_told_why(
    sequence: int | None, x: float, told: str
) -> None:
    bench = started()
    bench.link.send(0)
    bench.at(1)
    for k in range(2, 7):
        assert bench.state == RunState.RUNNING
        bench.link.send(bench.ticks if sequence is None else sequence, x)
        bench.at(k)
    assert bench.state == RunState.RETRACTED
    assert told in bench.run.snapshot().detail


def test_run_that_ends_while_retracted_is_finished() -> None:
    bench = started(8)
    silent(bench, 0, 8)
    assert bench.states == [RunState.RUNNING, RunState.RETRACTED, RunState.FINISHED]
    assert bench.counts() == {"drives_lost": 8, "ticks_retracted": 4, "scored_ticks_retracted": 4}


def test_only_scored_ticks_count_as_scored_ones_retracted() -> None:
    bench = started(10, **{"score.start": 7 * PERIOD})
    silent(bench, 0, 10)
    assert bench.counts() == {"drives_lost": 10, "ticks_retracted": 6, "scored_ticks_retracted": 3}


def test_pause_of_a_retracted_run_gives_the_controller_its_time_again() -> None:
    bench = started()
    silent(bench, 0, 6)
    assert bench.state == RunState.RETRACTED
    bench.run.pause()
    bench.at(500)
    bench.run.play()
    assert bench.states[-2:] == [RunState.PAUSED, RunState.RUNNING]
    silent(bench, 500, 504)
    assert bench.state == RunState.RUNNING
    bench.at(505)
    assert bench.state == RunState.RETRACTED


def test_change_of_a_parameter_is_no_drive() -> None:
    bench = started()
    silent(bench, 0, 5)
    assert bench.state == RunState.RETRACTED
    run = bench.parameters.run.model_copy(update={"lockstep_timeout": 7.0})
    bench.run.adapt(bench.parameters.model_copy(update={"run": run}))
    bench.at(6)
    assert bench.state == RunState.RETRACTED
