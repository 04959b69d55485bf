"""Runs in virtual time: latencies from a seed, and recorded drives played again."""

import math
import re

import numpy as np
import pytest
from numpy.typing import NDArray

from afm_model import (
    Controller,
    ControllerParameters,
    DivergenceError,
    DriveError,
    ParameterError,
    SimParameters,
    build,
    flatten,
    simulate,
)
from afm_model.parts.signals import Measurement
from afm_model.run import Latency, RealtimeSimulation, Replay, RunState, recorded_parameters, simulate_realtime

PERIOD = 1e-3
"""Wall time of a control period [s]."""
TICKS = 400
IN_TIME = Latency(median=0.3 * PERIOD, spread=0.0)


def parameters(**values: object) -> SimParameters:
    given = {
        "plant.control_period": 5e-6,
        "run.duration": TICKS * 5e-6,
        "run.real_time_factor": 5e-6 / PERIOD,
        "reference.z_r": 1e-13,
        "score.start": 0.0,
    }
    return build(SimParameters, given | values)  # type: ignore[arg-type]


def law() -> Controller:
    return Controller(build(ControllerParameters, {"law.kind": "tanh", "law.alpha": 0.4}))


def run(latency: Latency, **values: object) -> RealtimeSimulation:
    return simulate_realtime(parameters(**values), law(), latency)


class Counting:
    """A law with a memory: x counts the measurements."""

    def __init__(self) -> None:
        self.count = 0

    def answer(self, measurement: NDArray[np.float64]) -> NDArray[np.float64]:
        self.count += 1
        return np.array([1e-3 * self.count, 0.0, measurement.view(Measurement)[0].drive[2]])


def test_drives_that_come_within_the_period_give_the_lockstep_run_to_the_last_bit() -> None:
    realtime = run(IN_TIME)
    assert realtime.trajectory_sha256 == simulate(parameters(), law()).trajectory_sha256
    counts = realtime.snapshot.counts
    assert (realtime.snapshot.state, realtime.snapshot.ticks, counts.drives_lost) == (RunState.FINISHED, TICKS, 0)
    assert realtime.round_trips == pytest.approx(0.3 * PERIOD)
    assert realtime.snapshot.elapsed == pytest.approx(TICKS * PERIOD)


@pytest.mark.parametrize("periods", [1, 2])
def test_constant_latency_is_a_delay_of_the_drive_in_ticks(periods: int) -> None:
    """Until the first one comes the drive of the start is held, as in the delay line."""
    late = run(Latency(median=(periods + 0.3) * PERIOD, spread=0.0))
    delayed = simulate(parameters(**{"plant.delay_ticks": periods}), law())
    assert late.trajectory_sha256 == delayed.trajectory_sha256
    assert late.snapshot.counts.drives_lost == periods


def test_same_seed_gives_the_same_bits_and_another_one_others() -> None:
    latency = Latency(median=0.8 * PERIOD, spread=0.5, loss=0.05, seed=7)
    first, again = run(latency), run(latency)
    other = run(latency.model_copy(update={"seed": 8}))
    assert first.trajectory_sha256 == again.trajectory_sha256 != other.trajectory_sha256
    assert first.snapshot.counts == again.snapshot.counts
    assert first.snapshot.counts.drives_lost > 0


def test_lost_drives_are_ticks_on_a_held_one_and_change_no_latency() -> None:
    whole, lossy = (run(Latency(median=0.3 * PERIOD, spread=0.2, loss=loss, seed=1)) for loss in (0.0, 0.25))
    lost = np.isnan(lossy.round_trips)
    assert lossy.snapshot.counts.drives_lost == lost.sum()
    assert lost.sum() == pytest.approx(0.25 * TICKS, abs=4.0 * math.sqrt(TICKS * 0.25 * 0.75))  # four sigma
    assert np.array_equal(lossy.round_trips[~lost], whole.round_trips[~lost])


def test_controller_whose_drives_get_lost_has_a_score_that_says_so() -> None:
    told = "scored ticks .* ran on a held drive, because no new one had come"
    whole, some, most = (run(Latency(median=0.3 * PERIOD, spread=0.0, loss=loss)) for loss in (0.0, 0.25, 0.75))
    assert (whole.doubts, whole.warning) == ([], "")
    assert some.doubts == [] and re.search(told, some.warning)
    assert most.warning == "" and re.search(told, most.doubts[0])


def test_drives_that_overtake_one_another_are_put_in_force_by_their_sequence() -> None:
    late = simulate_realtime(parameters(), Counting(), Latency(median=2.0 * PERIOD, spread=1.0, seed=2))
    assert late.snapshot.counts.drives_outdated > 10
    assert np.all(np.diff(late.drive[:, 0]) >= 0.0)


@pytest.mark.parametrize("kind", ["lognormal", "normal"])
def test_latencies_have_the_median_the_spread_and_the_floor_asked_for(kind: str) -> None:
    latency = build(Latency, {"kind": kind, "median": 2.0, "spread": 0.1, "floor": 1.5, "seed": 3})
    draw = latency.draw()
    drawn = np.array([draw() for _ in range(20_000)])
    assert np.median(drawn) == pytest.approx(2.0, rel=5e-3)  # four sigma of the median are 0.35 %
    inner = np.percentile(np.log(drawn) if kind == "lognormal" else drawn / 2.0, [15.865, 84.135])
    assert np.diff(inner)[0] / 2.0 == pytest.approx(0.1, rel=0.05)
    assert drawn.min() == 1.5


@pytest.mark.parametrize("name", ["median", "spread", "floor", "loss", "seed"])
def test_latency_that_cannot_be_is_refused(name: str) -> None:
    with pytest.raises(ParameterError, match=f"{name} = -1"):
        build(Latency, {name: -1})


def test_silent_spell_retracts_the_sample_and_the_replay_of_its_drives_gives_the_same_bits() -> None:
    class Moody(Counting):
        """Sends nothing of use for a while."""

        def answer(self, measurement: NDArray[np.float64]) -> NDArray[np.float64]:
            drive = super().answer(measurement)
            return drive * np.nan if 100 < self.count < 200 else drive * [1.0, 1.0, 0.0]

    values = {"run.watchdog_timeout": 20.5 * PERIOD, "run.retract_time": 1e-4}
    live = simulate_realtime(parameters(**values), Moody(), IN_TIME)
    counts = live.snapshot.counts
    assert (counts.drives_refused, counts.ticks_retracted) == (99, 79)
    assert live.score.contact_fraction < 1.0
    replayed = simulate(parameters(**values), Replay(live.drive))
    assert replayed.trajectory_sha256 == live.trajectory_sha256


@pytest.mark.parametrize("values", [{}, {"plant.delay_ticks": 3}, {"piezo.dac_bits": 12, "piezo.limit": 5.0}])
def test_replay_of_recorded_drives_gives_the_trajectory_to_the_last_bit(values: dict[str, object]) -> None:
    live = run(Latency(median=0.9 * PERIOD, spread=0.3, seed=5), **values)
    replayed = simulate(parameters(**values), Replay(live.drive, parameters(**values).plant.delay_ticks))
    assert replayed.trajectory_sha256 == live.trajectory_sha256
    assert np.array_equal(replayed.drive, live.drive)


def test_recorded_parameters_are_told_from_what_else_a_node_has() -> None:
    given = parameters(**{"plant.seed": 9})
    recorded = flatten(given) | {"use_sim_time": False, "qos_overrides./clock.depth": 1}
    assert recorded_parameters(recorded) == given
    with pytest.raises(ParameterError, match=r"unknown parameter plant\.sead: did you mean plant\.seed"):
        recorded_parameters({"plant.sead": 9})


def test_replay_begins_again_when_it_is_reset() -> None:
    drives = np.arange(6.0).reshape(2, 3)
    replay = Replay(drives)
    told = [replay.answer(np.zeros(23)).tolist() for _ in range(3)]
    assert told == [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0], [3.0, 4.0, 5.0]]
    replay.reset()
    assert replay.answer(np.zeros(23)).tolist() == told[0]


@pytest.mark.parametrize(
    ("drives", "told"),
    [
        (np.zeros((4, 2)), r"shape \(4, 2\) cannot be replayed"),
        (np.zeros((0, 3)), r"shape \(0, 3\) cannot be replayed"),
        (np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0]]), "1 gaps cannot be replayed .the first at tick 1"),
    ],
)
def test_drives_that_cannot_be_replayed_are_refused(drives: NDArray[np.float64], told: str) -> None:
    with pytest.raises(ParameterError, match=told):
        Replay(drives)


class Short:
    """A law that forgets z."""

    def answer(self, measurement: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.zeros(2)


def test_endless_run_a_drive_that_is_none_and_a_motion_that_diverges_are_told() -> None:
    with pytest.raises(ParameterError, match=r"run\.duration = 0 s"):
        run(IN_TIME, **{"run.duration": 0.0})
    with pytest.raises(DriveError, match=r"drive \[0\.0, 0\.0\] is not allowed: it must be three voltages"):
        simulate_realtime(parameters(), Short(), IN_TIME)
    absurd = Replay(np.full((1, 3), 1.7e308))
    told = r"^the drives came too late, they were up to 4 .* old, the last late one \d+ periods before .*diverged"
    with pytest.raises(DivergenceError, match=told):
        simulate_realtime(parameters(), absurd, Latency(median=3.5 * PERIOD, spread=0.0))
