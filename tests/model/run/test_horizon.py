"""Drives sent ahead, in a run: played when the next answer is late, counted, dropped when it comes."""

import numpy as np
import pytest

from afm_model import Command, Controller, ControllerParameters, SimParameters, build
from afm_model.run import Latency, RunState, simulate_realtime

from .hand import PERIOD, Bench

PATIENCE = 4.5
"""run.watchdog_timeout in periods."""


def started(mode: str = "realtime", ticks: int = 0, **values: object) -> Bench:
    bench = Bench(mode, ticks, **{"run.watchdog_timeout": PATIENCE * PERIOD, **values})
    assert bench.at(0)
    return bench


def test_ticks_without_a_new_drive_play_the_horizon_and_are_counted_apart() -> None:
    bench = started(ticks=5)
    bench.link.send_horizon(0, 0.1, 0.2, 0.3)
    for k in range(5):
        bench.at(k + 1)
    assert bench.drives[:, 0].tolist() == [0.1, 0.2, 0.3, 0.3, 0.3]
    assert bench.counts() == {"horizon_ticks": 2, "drives_lost": 2}


def test_newer_answer_drops_the_horizon_and_an_older_one_does_not() -> None:
    bench = started(ticks=5)
    bench.at(1)
    bench.link.send_horizon(1, 0.1, 0.2, 0.3, 0.4)
    bench.at(2)
    bench.link.send(0, 9.0)
    bench.at(3)
    bench.link.send(3, 0.7)
    bench.at(4)
    bench.at(5)
    assert bench.drives[:, 0].tolist() == [0.0, 0.1, 0.2, 0.7, 0.7]
    assert bench.counts() == {"drives_lost": 2, "horizon_ticks": 1, "drives_outdated": 1}


def test_late_answer_is_put_in_force_where_its_times_say() -> None:
    bench = started(ticks=4)
    bench.at(1)
    bench.at(2)
    bench.link.send_horizon(0, 0.1, 0.2, 0.3, 0.4)
    bench.at(3)
    bench.at(4)
    assert bench.drives[:, 0].tolist() == [0.0, 0.0, 0.3, 0.4]


def test_periods_left_out_are_no_simulated_time_of_a_horizon() -> None:
    bench = started(ticks=3)
    bench.link.send_horizon(0, 0.1, 0.2, 0.3)
    bench.at(1)
    bench.at(4.5)  # simulated time stood still meanwhile
    assert bench.drives[:, 0].tolist() == [0.1, 0.2]


def test_silent_controller_is_noticed_with_a_horizon_left_and_the_retract_begins_at_the_drive_in_force() -> None:
    bench = started()
    bench.link.send_horizon(0, *(0.01 * k for k in range(1, 40)))
    for k in range(8):
        bench.at(k + 1)
    assert bench.state == RunState.RETRACTED
    x, z = bench.drives[:, 0], bench.drives[:, 2]
    assert x.tolist() == [0.01, 0.02, 0.03, 0.04, 0.05, 0.05, 0.05, 0.05]
    assert z[4] == bench.rest and np.all(np.diff(z[4:]) < 0.0)


@pytest.mark.parametrize("mode", ["realtime", "lockstep"])
def test_answer_that_cannot_be_a_drive_is_refused_with_its_sentence(mode: str) -> None:
    bench = started(mode)
    bench.link.send_refused(0, "a horizon of 200 drives is not allowed: 128 are the most")
    bench.at(1)
    assert bench.counts()["drives_refused"] == 1
    assert bench.run.snapshot().refusal == (
        "a horizon of 200 drives is not allowed: 128 are the most (answer to measurement 0 from /afm/hand)"
    )
    assert bench.state == (RunState.FAULT if mode == "lockstep" else RunState.RUNNING)


def test_nan_in_a_horizon_is_refused_in_realtime_and_the_drive_before_stays() -> None:
    bench = started()
    bench.link.send_horizon(0, 0.1, 0.2)
    bench.at(1)
    bench.link.send_horizon(1, 0.5, float("nan"))
    bench.at(2)
    assert bench.drives[:, 0].tolist() == [0.1, 0.2]
    assert bench.counts() == {"horizon_ticks": 1, "drives_refused": 1}
    assert "drive 0 of the horizon" in bench.run.snapshot().refusal


class Foresight:
    """A law that knows its drives long before: x is the tick at which each is in force, in mV."""

    def __init__(self, ahead: int) -> None:
        self._ahead = ahead
        self._k = 0

    def answer(self, measurement: np.ndarray) -> Command:
        drives = np.zeros((self._ahead + 1, 3))
        drives[:, 0] = 1e-3 * (self._k + np.arange(self._ahead + 1))
        self._k += 1
        return Command(drives[0], drives[1:], PERIOD)


def test_horizon_longer_than_the_latency_leaves_no_trace_of_it() -> None:
    values = {"plant.control_period": PERIOD, "plant.dt": 2.0**-20, "detector.sample_period": PERIOD}
    parameters = build(
        SimParameters, values | {"run.duration": 200 * PERIOD, "score.start": 0.0, "run.watchdog_timeout": 1.0}
    )
    latency = Latency(median=2.5 * PERIOD, spread=0.5, loss=0.2, seed=3)
    late = simulate_realtime(parameters, Foresight(60), latency)
    first = np.flatnonzero(late.drive[:, 0] > 0.0)[0]
    assert np.array_equal(late.drive[first:, 0], 1e-3 * np.arange(first, 200))
    counts = late.snapshot.counts
    assert counts.horizon_ticks > 20 and counts.drives_lost == first


def test_law_in_a_simulated_link_is_told_the_time_of_each_measurement() -> None:
    """A law of ours gets the time that a message would carry."""
    parameters = build(SimParameters, {"run.duration": 1e-4, "run.real_time_factor": 1e-3, "score.start": 0.0})
    times: list[float] = []

    class Watched(Controller):
        def answer(self, measurement, time=0.0):
            times.append(time)
            return super().answer(measurement, time)

    simulate_realtime(parameters, Watched(build(ControllerParameters, {})), Latency(median=1e-6, spread=0.0))
    assert times == pytest.approx([2e-6 * k for k in range(50)])
