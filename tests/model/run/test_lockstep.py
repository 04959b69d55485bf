"""Lockstep under a clock of the test's own."""

import math

import numpy as np
import pytest

from afm_model import Instrument
from afm_model.run import RunState

from .hand import PERIOD, START, Bench


def started(ticks: int = 0, **values: object) -> Bench:
    bench = Bench("lockstep", ticks, **values)
    assert bench.run.step()
    return bench


def test_run_starts_when_everybody_is_there_and_asks_for_the_first_drive() -> None:
    bench = Bench("lockstep")
    bench.link.is_ready = False
    assert not bench.run.step()
    assert (bench.state, bench.run.ticking, bench.link.published) == (RunState.WAITING, False, [])
    bench.link.is_ready = True
    assert bench.run.step()
    assert (bench.state, bench.run.ticking, bench.link.published) == (RunState.RUNNING, True, [0])
    assert bench.run.deadline is None


def test_each_answer_is_one_tick_and_the_end_is_told_once() -> None:
    bench = started(5, **{"plant.seed": 3})
    expected = Instrument(bench.parameters)
    for k in range(5):
        expected.tick(np.array([0.01 * k, 0.0, bench.rest]))
        assert bench.answer(0.01 * k)
    assert (bench.state, bench.ends, bench.ticks, bench.counts()) == (RunState.FINISHED, 1, 5, {})
    assert bench.link.published == [0, 1, 2, 3, 4]
    assert bench.run.instrument.trajectory_sha256() == expected.trajectory_sha256()
    assert not bench.run.step()
    assert bench.states == [RunState.RUNNING, RunState.FINISHED]


def test_blocks_join_and_the_last_one_comes_before_the_end() -> None:
    bench = started(7, block_ticks=3)
    for _ in range(7):
        bench.answer()
    assert [(block.first_tick, len(block.drives)) for block in bench.blocks] == [(0, 3), (3, 3), (6, 1)]
    assert len(bench.round_trips) == 7


def test_wrong_sequences_are_counted_by_kind_and_move_nothing() -> None:
    bench = started()
    bench.answer()
    for sequence in (0, 5, 0, 6, 7):
        bench.link.send(sequence, x=9.0)
        assert bench.run.step()
    assert (bench.ticks, bench.counts()) == (1, {"drives_outdated": 2, "drives_ahead": 3})
    bench.answer()
    assert bench.ticks == 2


def test_silence_stalls_the_run_and_an_answer_goes_on() -> None:
    bench = started()
    bench.answer()
    bench.now += 5.0
    assert not bench.run.step()
    assert bench.state == RunState.RUNNING  # not longer than run.lockstep_timeout
    bench.now += 0.01
    bench.run.step()
    sentence = "/afm/hand has not answered measurement 1 within 5 s (run.lockstep_timeout); still waiting"
    assert bench.told[-1] == (RunState.STALLED, sentence)
    bench.now += 100.0
    bench.answer()
    assert (bench.state, bench.ticks) == (RunState.RUNNING, 2)


def test_stall_says_what_the_controller_sends_in_place_of_an_answer() -> None:
    bench = started()
    for _ in range(5):
        bench.answer()
    for sequence in (17, 18, 17):
        bench.link.send(sequence)
        bench.run.step()
    bench.now += 5.01
    bench.run.step()
    assert bench.told[-1] == (
        RunState.STALLED,
        "/afm/hand sends drives with sequence 17, 18; measurement 5 has been waiting for 5 s (run.lockstep_timeout)",
    )


def test_stall_says_that_what_the_controller_sends_cannot_be_read() -> None:
    bench = started()
    bench.answer()
    bench.link.send_nonsense()
    bench.run.step()
    bench.now += 5.01
    bench.run.step()
    assert bench.told[-1] == (
        RunState.STALLED,
        "no drive but 2 bytes that are no PiezoDrive from /afm/hand; measurement 1 has been waiting for 5 s "
        "(run.lockstep_timeout)",
    )
    bench.answer()
    assert (bench.state, bench.ticks, bench.counts()) == (
        RunState.RUNNING,
        2,
        {"drives_lost": 1, "drives_malformed": 1},
    )


def test_what_cannot_be_read_and_has_come_before_the_start_is_counted_and_does_no_harm() -> None:
    bench = Bench("lockstep")
    bench.link.send_nonsense()
    bench.link.send(0, 9.0)
    bench.link.send_nonsense()
    assert bench.run.step()
    bench.answer()
    assert (bench.state, bench.ticks, bench.counts()) == (RunState.RUNNING, 1, {"drives_malformed": 2})
    assert bench.drives[0, 0] == 0.0


def test_stall_is_told_although_wrong_drives_keep_coming() -> None:
    bench = started()
    for sequence in range(100, 120):
        bench.now += 0.5
        bench.link.send(sequence)
        bench.run.step()
    assert bench.state == RunState.STALLED
    assert bench.run.snapshot().detail.startswith("/afm/hand sends drives with sequence ")
    # What it says is kept up to date: the last four it has sent.
    assert "114, 115, 116, 117;" in bench.run.snapshot().detail


def test_controller_that_begins_to_send_wrong_drives_after_the_stall_is_told_too() -> None:
    bench = started()
    bench.now += 5.01
    bench.run.step()
    assert "has not answered" in bench.run.snapshot().detail
    bench.link.send(17)
    bench.now += 1.01
    bench.run.step()
    assert "sends drives with sequence 17; measurement 0 has been waiting" in bench.run.snapshot().detail
    assert bench.states == [RunState.RUNNING, RunState.STALLED, RunState.STALLED]


def test_wrong_drives_of_an_earlier_measurement_are_not_named() -> None:
    bench = started()
    bench.link.send(17)
    bench.run.step()
    bench.answer()
    bench.now += 5.01
    bench.run.step()
    assert "has not answered measurement 1" in bench.run.snapshot().detail


def test_measurement_is_sent_again_each_second_and_counted_once() -> None:
    bench = started()
    bench.now += 1.01
    bench.run.step()
    assert (bench.link.published, bench.counts()) == ([0, 0], {})  # the first may have gone out too soon
    bench.answer()
    for _ in range(3):
        bench.now += 1.01
        bench.run.step()
    assert bench.link.published == [0, 0, 1, 1, 1, 1]
    assert bench.counts() == {"drives_lost": 1}


def test_round_trip_leaves_out_discovery_resending_and_pauses_but_the_trace_does_not() -> None:
    bench = started(6)
    waits = [7.0, 1e-3, 1e-3, 1.5, 1e-3, 1e-3]
    for k, wait in enumerate(waits):
        if k == 4:
            bench.run.pause()
            bench.run.play()
            wait = 2.0
        bench.now += wait
        if wait == 1.5:
            bench.run.step()
        bench.answer()
    p50, _, _, largest = bench.run.delays().round_trip
    assert p50 == pytest.approx(1e-3, rel=0.02)
    assert largest == pytest.approx(1e-3)
    assert bench.round_trips == pytest.approx([7.0, 1e-3, 1e-3, 1.5, 2.0, 1e-3])


def test_pause_stops_between_two_ticks_and_the_answer_that_came_meanwhile_counts() -> None:
    bench = started()
    bench.answer()
    assert bench.run.pause() == ""
    assert bench.run.pause() == ""
    bench.link.send(1)
    bench.now += 100.0
    assert not bench.run.step()
    assert (bench.state, bench.ticks, bench.run.ticking) == (RunState.PAUSED, 1, False)
    assert bench.run.play() == ""
    assert bench.run.step()
    assert (bench.state, bench.ticks, bench.counts()) == (RunState.RUNNING, 2, {})
    assert bench.states == [RunState.RUNNING, RunState.PAUSED, RunState.RUNNING]
    # Nobody was late while the run was paused.
    assert bench.run.snapshot().elapsed == 0.0


def test_pause_of_a_stalled_run_gives_the_controller_its_time_again() -> None:
    bench = started()
    bench.now += 5.01
    bench.run.step()
    assert bench.state == RunState.STALLED
    bench.run.pause()
    bench.run.play()
    bench.now += 4.0
    bench.run.step()
    assert bench.state == RunState.RUNNING
    bench.now += 1.01
    bench.run.step()
    assert bench.state == RunState.STALLED


@pytest.mark.parametrize("asked_by", ["parameter", "pause"])
def test_run_that_is_held_waits_for_play(asked_by: str) -> None:
    bench = Bench("lockstep", **{"run.start_paused": asked_by == "parameter"})
    if asked_by == "pause":
        assert bench.run.pause() == ""
    assert not bench.run.step()
    assert bench.state == RunState.WAITING
    assert bench.run.play() == ""
    assert bench.run.step()
    assert bench.state == RunState.RUNNING


def test_run_that_is_over_is_neither_played_nor_paused_until_reset() -> None:
    bench = started(1)
    bench.answer()
    assert bench.run.play() == "the run is over: call reset first"
    assert bench.run.pause() == "the run is over: there is nothing to pause"
    bench.run.reset()
    assert (bench.state, bench.ticks, bench.run.pause()) == (RunState.WAITING, 0, "")


def test_reset_of_a_paused_run_waits_for_play() -> None:
    bench = started(3)
    bench.answer()
    bench.run.pause()
    bench.run.reset()
    bench.run.step()
    assert (bench.state, bench.ticks) == (RunState.WAITING, 0)
    bench.run.play()
    bench.run.step()
    assert bench.state == RunState.RUNNING


def test_reset_repeats_the_run_with_counts_from_zero_and_forgets_drives_on_their_way() -> None:
    bench = started(3)
    hashes = []
    for _ in range(2):
        bench.now += 2.0
        for k in range(3):
            bench.link.send(99)
            bench.run.step()
            bench.answer(0.01 * k)
        hashes.append(bench.run.instrument.trajectory_sha256())
        assert bench.counts() == {"drives_ahead": 3}
        assert bench.run.snapshot().elapsed == pytest.approx(2.0)
        bench.link.send(0, x=5.0)
        bench.run.reset()
        assert (bench.state, bench.ticks, bench.counts()) == (RunState.WAITING, 0, {})
        assert np.isnan(bench.run.delays().round_trip).all()
        bench.run.step()
    assert hashes[0] == hashes[1]


def test_drive_that_is_not_finite_ends_the_run_and_hands_on_what_was_recorded() -> None:
    bench = started()
    bench.answer()
    bench.answer(math.nan)
    assert bench.told[-1] == (
        RunState.FAULT,
        "drive x = nan V is not allowed: every voltage must be a finite number "
        "(answer to measurement 1 from /afm/hand)",
    )
    assert bench.counts() == {"drives_refused": 1}
    assert [len(block.drives) for block in bench.blocks] == [1]
    assert not bench.run.step()


def test_motion_that_diverges_ends_the_run() -> None:
    bench = started()
    bench.answer(1e308)
    assert bench.state == RunState.FAULT
    assert "diverged" in bench.run.snapshot().detail


def test_time_of_the_run_is_counted_while_it_runs() -> None:
    bench = Bench("lockstep")
    bench.now += 10.0
    bench.run.step()
    bench.now += 2.0
    bench.answer()
    snapshot = bench.run.snapshot()
    assert snapshot.elapsed == 2.0
    assert snapshot.real_time_factor == PERIOD / 2.0
    assert bench.now == START + 12.0


# Company.


def test_run_with_a_rival_does_not_start_and_says_why_until_it_is_alone() -> None:
    bench = Bench("lockstep")
    bench.link.rival = "two simulators"
    assert not bench.run.step()
    assert not bench.run.step()
    assert bench.told == [(RunState.WAITING, "two simulators")]
    bench.link.rival = ""
    assert bench.run.step()
    assert bench.told[1:] == [(RunState.RUNNING, "")]


def test_run_that_has_had_a_rival_ends_in_a_fault_and_not_with_a_score() -> None:
    bench = started(2)
    bench.answer()
    bench.link.rival = "two simulators"
    bench.answer()
    assert bench.told[-1] == (RunState.FAULT, "two simulators")
    assert (bench.ends, sum(len(block.drives) for block in bench.blocks)) == (0, 2)


@pytest.mark.parametrize("state", [RunState.RUNNING, RunState.STALLED, RunState.PAUSED])
def test_run_that_cannot_be_trusted_fails_from_every_state_in_which_it_has_started(state: RunState) -> None:
    bench = started()
    if state == RunState.STALLED:
        bench.now += 5.01
        bench.run.step()
    elif state == RunState.PAUSED:
        bench.run.pause()
    assert bench.state == state
    bench.run.tell_why_waiting("it does not wait")
    bench.run.fail("two simulators")
    assert bench.told[-1] == (RunState.FAULT, "two simulators")
    bench.run.fail("again")
    assert bench.told[-1] == (RunState.FAULT, "two simulators")


def test_run_that_waits_or_is_over_does_not_fail() -> None:
    bench = Bench("lockstep", 1)
    bench.run.fail("two simulators")
    assert bench.state == RunState.WAITING
    bench.run.step()
    bench.answer()
    bench.run.fail("two simulators")
    assert bench.state == RunState.FINISHED
