"""Steps while paused: so many ticks and no more, and the same trajectory through any mix of them with the rest."""

import pytest

from afm_model.run import RunState

from .hand import PERIOD, START, Bench


def test_steps_are_so_many_ticks_and_the_run_is_paused_again() -> None:
    bench = Bench("lockstep")
    bench.run.step()
    bench.answer()
    bench.run.pause()
    assert bench.run.step_by(3) == ""
    for left in (3, 2, 1):
        assert (bench.state, bench.run.steps_left) == (RunState.RUNNING, left)
        bench.answer()
    assert (bench.state, bench.ticks, bench.run.steps_left) == (RunState.PAUSED, 4, 0)
    # What is sent now waits.
    assert not bench.answer()
    assert bench.run.step_by(1) == ""
    assert bench.run.step()
    assert (bench.state, bench.ticks) == (RunState.PAUSED, 5)
    assert bench.link.published == [0, 1, 2, 3, 4, 5]


def test_steps_in_real_time_follow_the_clock() -> None:
    bench = Bench("realtime")
    bench.at(0)
    bench.at(1)
    bench.run.pause()
    bench.at(100)
    assert bench.run.step_by(2) == ""
    assert bench.run.deadline == START + 101 * PERIOD
    assert not bench.at(100.5)
    bench.at(101)
    bench.at(102)
    assert (bench.state, bench.ticks, bench.counts()["drives_lost"]) == (RunState.PAUSED, 3, 3)
    assert not bench.at(200)
    bench.run.play()
    bench.at(201)
    bench.at(202)
    assert (bench.state, bench.ticks) == (RunState.RUNNING, 5)


def test_run_that_waits_for_play_may_start_with_steps() -> None:
    bench = Bench("lockstep", **{"run.start_paused": True})
    assert bench.run.step_by(2) == ""
    bench.run.step()
    bench.answer()
    bench.answer()
    assert (bench.state, bench.ticks) == (RunState.PAUSED, 2)
    bench.run.reset()
    assert (bench.state, bench.run.step()) == (RunState.WAITING, False)


@pytest.mark.parametrize("ticks", [0, -1])
def test_steps_that_are_none_are_refused(ticks: int) -> None:
    bench = Bench("lockstep")
    bench.run.step()
    bench.run.pause()
    assert bench.run.step_by(ticks) == f"{ticks} ticks are not allowed: it must be 1 at least"
    assert bench.state == RunState.PAUSED


def test_run_that_is_not_paused_makes_no_steps() -> None:
    bench = Bench("lockstep", 1)
    assert bench.run.step_by(1) == "the run is waiting: it must be paused"
    bench.run.step()
    assert bench.run.step_by(1) == "the run is running: it must be paused"
    bench.answer()
    assert bench.run.step_by(1) == "the run is finished: it must be paused"


def test_steps_end_with_the_run() -> None:
    bench = Bench("lockstep", 2)
    bench.run.step()
    bench.run.pause()
    bench.run.step_by(5)
    bench.answer()
    bench.answer()
    assert (bench.state, bench.run.steps_left) == (RunState.FINISHED, 0)


@pytest.mark.parametrize("command", ["play", "pause", "reset"])
def test_steps_are_given_up_for_another_command(command: str) -> None:
    bench = Bench("lockstep")
    bench.run.step()
    bench.run.pause()
    bench.run.step_by(2)
    bench.answer()
    getattr(bench.run, command)()
    assert bench.run.steps_left == 0
    expected = {"play": RunState.RUNNING, "pause": RunState.PAUSED, "reset": RunState.WAITING}[command]
    assert bench.state == expected
    for _ in range(3):
        bench.answer()
    # A run that was stepped waits for `play` after a reset, as one that is paused does.
    assert (bench.state, bench.ticks) == (expected, {"play": 4, "pause": 1, "reset": 0}[command])
