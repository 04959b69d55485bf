"""Limits of the instrument: each withdraws the sample, is told, and has a way back, in lockstep and in real time."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from afm_model.run import Cause, RunState, verdict
from afm_model.run.state import REASONS

from ..session import Z_LOOP
from .hand import PERIOD, Bench

RAMP = 8
"""run.retract_time in ticks."""
DISTANCE = 240e-9 / 20e-9
"""run.retract_distance over piezo.sensitivity_z [V]."""
CRASH = 2.0
"""z drive above rest [V] that pushes with 58 nN: the sample is held at 0.6 nN."""
AWAY = -8.0
"""z drive above rest [V] at which the tip comes off."""
LIMITS: dict[Cause, tuple[dict[str, object], tuple[float, float], str]] = {
    Cause.TRAVEL: ({"safety.travel_limit": 1e-9}, (1.0, 0.0), "the scanner is at x = "),
    Cause.FORCE: ({"safety.force_limit": 40e-9}, (0.0, CRASH), "the normal force is "),
    Cause.CONTACT_LOST: ({"safety.contact_timeout": 2 * PERIOD}, (0.0, AWAY), "the tip has been out of contact for"),
    Cause.INVALID: (
        {"safety.validity": True, "plant.dt": 2.0**-19},
        (0.0, 2 * CRASH),
        "the plant holds from -inf to 1.151e-07 N",
    ),
}
"""Limit, drive along x and z above rest [V] that passes it, begin of the sentence."""
FAST: dict[str, object] = {
    "run.retract_time": RAMP * PERIOD,
    "run.watchdog_timeout": 1e6,
    "safety.approach_speed": 20e-9 * 0.25 / PERIOD,
    "safety.settle_time": 3 * PERIOD,
}


class Hand:
    """A bench whose controller asks the same thing at each tick."""

    def __init__(self, mode: str, ticks: int = 0, **values: object) -> None:
        self.bench = Bench(mode, ticks, **(FAST | values))
        self.bench.run.step()

    def ticks(self, count: int, x: float = 0.0, z: float = 0.0) -> None:
        """So many ticks, each with a drive of its own; z above rest."""
        bench = self.bench
        for _ in range(count):
            bench.link.send(bench.ticks, x, bench.rest + z)
            bench.now += PERIOD
            bench.run.step()

    def until(self, state: RunState, x: float = 0.0, z: float = 0.0, most: int = 400) -> None:
        """Ticks until the run is in a state."""
        for _ in range(most):
            if self.bench.state == state:
                return
            self.ticks(1, x, z)
        raise AssertionError(f"not {state.title} after {most} ticks: {self.bench.told}")


def tripped(mode: str, cause: Cause, **values: object) -> Hand:
    limits, (x, z), _ = LIMITS[cause]
    hand = Hand(mode, **(limits | values))
    hand.ticks(1)
    hand.until(RunState.WITHDRAWN, x, z)
    return hand


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
@pytest.mark.parametrize("cause", LIMITS)
def test_limit_that_is_passed_withdraws_the_sample_and_is_told(cause: Cause, mode: str) -> None:
    hand = tripped(mode, cause)
    bench = hand.bench
    _, (x, z), sentence = LIMITS[cause]
    at = bench.drives[-1]
    snapshot = bench.run.snapshot()
    assert (snapshot.state, snapshot.reason) == (RunState.WITHDRAWN, REASONS[cause])
    assert snapshot.detail.startswith(sentence) or sentence in snapshot.detail
    assert snapshot.detail.endswith(": the sample is withdrawn")
    hand.ticks(RAMP + 4, x, z)
    # From where it was, by the same step at each tick, and then held.
    down = min(at[2], 0.0) - DISTANCE
    told = bench.drives[-(RAMP + 4) :]
    ramp = at[2] + (down - at[2]) * np.minimum(np.arange(1, RAMP + 5) / RAMP, 1.0)
    assert told[:, 2] == pytest.approx(ramp)
    held = at[0] * np.maximum(1.0 - np.arange(1, RAMP + 5) / RAMP, 0.0) if cause == Cause.TRAVEL else at[0]
    assert told[:, 0] == pytest.approx(held)
    assert not bench.run.instrument.in_contact
    counts = bench.counts()
    assert (counts["withdrawals"], counts["ticks_withdrawn"]) == (1, RAMP + 4)


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
@pytest.mark.parametrize("cause", LIMITS)
def test_sample_is_brought_back_within_the_force_limit_and_the_controller_has_the_drive_again(
    cause: Cause, mode: str
) -> None:
    hand = tripped(mode, cause, **{"safety.approach_force": 1e-6})
    bench = hand.bench
    hand.ticks(RAMP)
    while refused := bench.run.resume():
        # The scanner has come off and swings.
        assert (
            cause == Cause.TRAVEL and refused.startswith("the scanner is at x = ") and bench.state == RunState.WITHDRAWN
        )
        hand.ticks(20)
    assert bench.state == RunState.APPROACHING
    assert bench.run.snapshot().reason == REASONS[cause]
    hand.until(RunState.RUNNING)
    assert bench.run.instrument.in_contact
    assert bench.run.snapshot().reason == ""
    hand.ticks(1, 0.01)
    assert bench.drives[-1].tolist() == [0.01, 0.0, bench.rest]
    assert bench.counts()["withdrawals"] == 1


def test_nothing_is_withdrawn_within_the_limits() -> None:
    everything = {name: value for limits, *_ in LIMITS.values() for name, value in limits.items()}
    del everything["plant.dt"]
    hand = Hand("lockstep", **everything)
    hand.ticks(20, 0.01)
    assert hand.bench.states == [RunState.RUNNING]
    free = Hand("lockstep")
    free.ticks(20, 0.01)
    assert hand.bench.run.instrument.trajectory_sha256() == free.bench.run.instrument.trajectory_sha256()


def test_first_touch_of_an_approach_is_gentler_than_its_limit() -> None:
    """Raised by 5 nm in a tick: at 58 nN for 2 V of 20 nm that is 7 nN, and the snap-in pulls."""
    hand = tripped("lockstep", Cause.FORCE, **{"safety.approach_force": 1e-6})
    hand.ticks(RAMP)
    hand.bench.run.resume()
    forces = []
    while hand.bench.state == RunState.APPROACHING:
        hand.ticks(1)
        forces.append(hand.bench.run.instrument.truth.normal_force)
    assert 0.0 < len(forces) < 100
    assert max(forces) < 40e-9


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"safety.approach_timeout": 10 * PERIOD}, "no contact within"),
        ({"safety.approach_force": 1e-12}, "in the approach (safety.approach_force: 1e-12 N)"),
    ],
    ids=["no contact", "too much force"],
)
def test_approach_that_fails_withdraws_again_and_says_why(values: dict[str, object], told: str) -> None:
    hand = tripped("lockstep", Cause.CONTACT_LOST, **values)
    bench = hand.bench
    hand.ticks(RAMP)
    bench.run.resume()
    hand.until(RunState.WITHDRAWN)
    assert told in bench.run.snapshot().detail
    assert (bench.run.snapshot().reason, bench.counts()["withdrawals"]) == ("contact lost", 2)
    hand.ticks(RAMP + 1)
    assert not bench.run.instrument.in_contact
    assert bench.run.resume() == ""


def test_resume_by_itself_needs_nobody_and_is_the_same_to_the_last_bit_whatever_is_paused_and_stepped() -> None:
    def run(disturb: Callable[[Bench], object]) -> tuple[str, list[RunState]]:
        hand = Hand("lockstep", 120, **{"safety.force_limit": 40e-9, "safety.resume_after": 20 * PERIOD})
        for k in range(120):
            disturb(hand.bench)
            hand.ticks(1, 0.001 * k, CRASH if k == 30 else 0.0)
        assert hand.bench.state == RunState.FINISHED
        return hand.bench.run.instrument.trajectory_sha256(), hand.bench.states

    def pause(bench: Bench) -> None:
        bench.run.pause()
        assert not bench.run.step()
        bench.run.play()

    def step(bench: Bench) -> None:
        bench.run.pause()
        assert bench.run.step_by(1 + bench.ticks % 3) == ""

    quiet, states = run(lambda bench: None)
    assert states[:4] == [RunState.RUNNING, RunState.WITHDRAWN, RunState.APPROACHING, RunState.RUNNING]
    assert run(pause)[0] == run(step)[0] == quiet


def test_silence_of_a_withdrawn_run_in_lockstep_is_a_stall_and_it_is_still_withdrawn_when_the_answer_comes() -> None:
    hand = tripped("lockstep", Cause.FORCE, **{"run.lockstep_timeout": 0.5})
    bench = hand.bench
    bench.now += 0.6
    bench.run.step()
    assert (bench.state, bench.run.snapshot().reason) == (RunState.STALLED, "force limit")
    hand.ticks(1)
    assert bench.state == RunState.WITHDRAWN
    hand.ticks(RAMP)
    assert bench.run.resume() == ""
    bench.now += 0.6
    bench.run.step()
    hand.ticks(1)
    assert bench.states[-3:] == [RunState.APPROACHING, RunState.STALLED, RunState.APPROACHING]


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_pause_does_not_bring_a_withdrawn_sample_back(mode: str) -> None:
    hand = tripped(mode, Cause.FORCE)
    run = hand.bench.run
    assert run.resume().startswith("the normal force is ")
    hand.ticks(RAMP)
    run.pause()
    assert run.resume() == "the run is paused: call play first"
    run.play()
    assert hand.bench.state == RunState.WITHDRAWN
    run.resume()
    run.pause()
    run.play()
    assert hand.bench.states[-4:] == [RunState.WITHDRAWN, RunState.APPROACHING, RunState.PAUSED, RunState.APPROACHING]


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_reset_gives_the_drive_to_the_controller(mode: str) -> None:
    hand = tripped(mode, Cause.FORCE)
    hand.ticks(3)
    hand.bench.run.reset()
    assert hand.bench.run.step()
    hand.bench.blocks.clear()
    hand.ticks(3, 0.01)
    assert (hand.bench.state, hand.bench.counts()) == (RunState.RUNNING, {})
    assert hand.bench.drives[:, 0].tolist() == [0.01] * 3


def test_drive_that_is_not_finite_is_refused_of_a_withdrawn_run_as_well() -> None:
    hand = tripped("lockstep", Cause.FORCE)
    hand.ticks(1, math.nan)
    assert (hand.bench.state, hand.bench.counts()["drives_refused"]) == (RunState.FAULT, 1)
    other = tripped("realtime", Cause.FORCE)
    other.ticks(1, math.nan)
    assert (other.bench.state, other.bench.counts()["drives_refused"]) == (RunState.WITHDRAWN, 1)


def test_limit_is_one_of_a_retracted_sample_too_but_lost_contact_is_not() -> None:
    values = {"run.watchdog_timeout": 4.5 * PERIOD, "safety.contact_timeout": PERIOD, "safety.travel_limit": 1e-9}
    bench = Bench("realtime", **(FAST | values))
    bench.run.step()
    bench.link.send(0, 0.01)
    for k in range(1, 30):
        bench.at(k)
    assert (bench.state, bench.run.instrument.in_contact) == (RunState.RETRACTED, False)
    bench.run.reset()
    bench.run.step()
    bench.link.send(0, 1.0, bench.rest)
    while bench.state != RunState.WITHDRAWN:
        bench.now += PERIOD
        bench.run.step()
    assert RunState.RETRACTED in bench.states
    assert bench.run.snapshot().reason == "travel limit"


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_run_that_cannot_be_recorded_is_held_until_it_can(mode: str) -> None:
    hand = Hand(mode, **{"safety.unrecorded": True})
    bench = hand.bench
    hand.ticks(3)
    bench.run.tell_recorder("no room on the disk")
    bench.run.tell_recorder("no room on the disk")
    snapshot = bench.run.snapshot()
    assert (snapshot.state, snapshot.reason) == (RunState.HELD, "not recorded")
    assert snapshot.detail == "no room on the disk: the run is held (safety.unrecorded)"
    hand.ticks(4)
    assert (bench.ticks, bench.run.deadline) == (3, None)
    bench.run.tell_recorder("")
    assert bench.state == RunState.RUNNING
    # Held again, and asked to go on all the same: not held again before the recorder has written.
    bench.run.tell_recorder("no room on the disk")
    assert (bench.run.resume(), bench.state) == ("", RunState.RUNNING)
    bench.run.tell_recorder("no room on the disk")
    assert bench.state == RunState.RUNNING
    bench.run.tell_recorder("")
    bench.run.tell_recorder("no room on the disk")
    assert bench.state == RunState.HELD
    bench.run.pause()
    bench.run.play()
    assert bench.state == RunState.RUNNING


def test_recorder_that_cannot_write_holds_no_run_that_has_not_asked_for_it() -> None:
    hand = Hand("lockstep")
    hand.bench.run.tell_recorder("no room on the disk")
    assert hand.bench.state == RunState.RUNNING
    assert hand.bench.run.resume() == "the run is running: there is nothing to resume"


def test_score_of_a_run_that_was_withdrawn_in_scored_ticks_is_not_valid() -> None:
    hand = Hand("lockstep", 20, **{"safety.force_limit": 40e-9, "score.start": 10 * PERIOD})
    hand.until(RunState.WITHDRAWN, 0.0, CRASH)
    hand.until(RunState.FINISHED)
    snapshot, score = hand.bench.run.snapshot(), hand.bench.run.instrument.score()
    assert snapshot.counts.scored_ticks_withdrawn == 10 < snapshot.counts.ticks_withdrawn
    assert verdict(score, snapshot) == (
        "the instrument had the drive in 10 of 10 scored ticks (100 %): it withdrew the sample 1 time, because a limit "
        "was passed"
    )


# A z loop inside the instrument.

LOOP = Z_LOOP | {
    "plant.control_period": 2.0**-14,
    "plant.dt": 2.0**-20,
    "detector.sample_period": 2.0**-20,
    "run.retract_distance": 1e-6,
    "run.retract_time": 64 * 2.0**-14,
    "run.watchdog_timeout": 1e6,
}


def lever(mode: str, **values: object) -> Bench:
    bench = Bench(mode, **(LOOP | values))
    bench.run.step()
    return bench


def tick(bench: Bench, count: int, drive: bool = True) -> None:
    for _ in range(count):
        if drive:
            bench.link.send(bench.ticks, 0.0)
        bench.now += 2.0**-14
        bench.run.step()


def test_loop_inside_gives_z_up_to_a_withdrawal_and_takes_it_back_at_the_first_touch() -> None:
    bench = lever("lockstep", **{"safety.travel_limit": 1e-9, "safety.approach_force": 50e-9})
    instrument = bench.run.instrument
    tick(bench, 10)
    load = instrument.truth.normal_force
    assert load == pytest.approx(0.2 * 50e-9, rel=0.1)
    while bench.state == RunState.RUNNING:
        bench.link.send(bench.ticks, 1.0)
        bench.run.step()
    tick(bench, 80)
    assert bench.state == RunState.WITHDRAWN
    assert not instrument.in_contact
    bench.run.resume()
    forces = []
    while bench.state == RunState.APPROACHING:
        tick(bench, 1)
        forces.append(instrument.truth.normal_force)
    assert bench.state == RunState.RUNNING, bench.told[-1]
    assert max(forces) < 50e-9
    # The loop is back at its setpoint.
    tick(bench, 200)
    assert instrument.truth.normal_force == pytest.approx(load, rel=0.05)


def test_an_approach_that_fails_behind_the_first_touch_takes_z_from_the_loop_again() -> None:
    # The loop goes on to 10 nN, which this approach does not allow.
    limits = {"safety.travel_limit": 1e-9, "safety.approach_force": 8e-9, "safety.settle_time": 0.1}
    bench = lever("lockstep", **limits)
    while bench.state == RunState.RUNNING:
        bench.link.send(bench.ticks, 1.0)
        bench.run.step()
    tick(bench, 80)
    bench.run.resume()
    touched = 0
    while bench.state == RunState.APPROACHING:
        tick(bench, 1)
        touched += bench.run.instrument.in_contact
    assert touched > 1
    assert "in the approach (safety.approach_force: 8e-09 N)" in bench.run.snapshot().detail
    tick(bench, 80)
    assert bench.state == RunState.WITHDRAWN
    assert not bench.run.instrument.in_contact


def test_silent_controller_retracts_the_sample_from_a_loop_inside_too() -> None:
    bench = lever("realtime", **{"run.watchdog_timeout": 4.5 * 2.0**-14})
    tick(bench, 10)
    tick(bench, 80, drive=False)
    assert (bench.state, bench.run.instrument.in_contact) == (RunState.RETRACTED, False)
    tick(bench, 1)
    assert bench.state == RunState.RUNNING
    tick(bench, 3000)
    assert bench.run.instrument.truth.normal_force == pytest.approx(0.2 * 50e-9, rel=0.1)
