"""Lockstep over real topics: the answer k makes tick k, whatever else arrives, however long it takes."""

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from afm_msgs.msg import ControlTrace, InstrumentStatus, Measurement, PiezoDrive, Score
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from hand_controller import HandController, answer, run_in_process
from numpy.typing import NDArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from support import Command, Graph, Observer, executable, ros_arguments, wait_until

from afm_model import Instrument, SimParameters, build
from afm_node_common import topics
from afm_sim_node.node import SimNode

PERIOD = 2e-6
TICKS = 300


def push(sequence: int) -> tuple[float, float]:
    """A drive [V] that shows in the trajectory which ticks it was applied to."""
    return 0.2 * math.sin(0.05 * sequence), 0.001 * (sequence % 7)


def honest(measurement: Measurement) -> list[PiezoDrive]:
    return [answer(measurement, *push(measurement.sequence))]


def expected_sha(ticks: int = TICKS) -> str:
    """Trajectory of `push`, without any topic between."""
    instrument = Instrument(build(SimParameters, {"plant.control_period": PERIOD}))
    z = instrument.drive[2]

    def law(_: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([*push(instrument.ticks), z])

    return run_in_process(instrument, law, ticks).trajectory_sha256()


class Bench:
    """A simulator in this process, a hand-made controller, and somebody who watches."""

    def __init__(self, graph: Graph, law: Callable[[Measurement], Sequence[PiezoDrive]]) -> None:
        self.graph = graph
        self.observer = graph.add(Observer())
        self.controller = graph.add(HandController(law))
        self.simulator = graph.add(SimNode())

    @property
    def sequences(self) -> list[int]:
        return [measurement.sequence for measurement in self.controller.seen]

    def run_until(self, state: int) -> InstrumentStatus:
        self.graph.spin_until(lambda: self.observer.status.state == state)
        return self.observer.status

    def run_to_the_end(self) -> Score:
        """Score of the run that ends next."""
        count = len(self.observer.scores)
        self.graph.spin_until(lambda: len(self.observer.scores) > count)
        self.run_until(InstrumentStatus.FINISHED)
        return self.observer.scores[-1]

    def call(self, service: str) -> tuple[bool, str]:
        response = self.observer.call(self.graph, service)
        return response.success, response.message


@contextmanager
def bench(
    law: Callable[[Measurement], Sequence[PiezoDrive]] = honest, ticks: int = TICKS, **run: object
) -> Iterator[Bench]:
    parameters = {"plant.control_period": PERIOD, "run.duration": ticks * PERIOD}
    parameters |= {f"run.{name}": value for name, value in run.items()}
    with Graph(ros_arguments(parameters)) as graph:
        yield Bench(graph, law)


# Answers.


def test_each_measurement_is_asked_once_and_each_answer_is_one_tick() -> None:
    with bench() as b:
        score = b.run_to_the_end()
        assert b.sequences == list(range(TICKS))
        assert score.trajectory_sha256 == expected_sha()
        status = b.observer.status
        assert (status.ticks, status.drives_lost, status.drives_refused) == (TICKS, 0, 0)
        assert (status.plant, status.mode, status.controllers) == ("compliant", "lockstep", ["/afm/hand_made"])
        assert (status.control_period, status.duration, status.samples) == (PERIOD, TICKS * PERIOD, 2 * TICKS)


def test_stale_duplicate_and_future_answers_are_ignored() -> None:
    def eager(measurement: Measurement) -> list[PiezoDrive]:
        past = [-1] if measurement.sequence else []
        *before, duplicate = [answer(measurement, 9.0, -9.0, 9.0, ahead) for ahead in (*past, 5, 1000, 0)]
        return [*before, *honest(measurement), duplicate]

    with bench(eager) as b:
        score = b.run_to_the_end()
        assert b.sequences == list(range(TICKS))
        assert score.trajectory_sha256 == expected_sha()
        status = b.observer.status
        # Of the last measurement the duplicate comes too late to be seen.
        assert (status.drives_lost, status.drives_outdated, status.drives_ahead) == (0, 2 * (TICKS - 1), 2 * TICKS)
        assert (score.drives_outdated, score.drives_ahead) == (status.drives_outdated, status.drives_ahead)


@pytest.mark.parametrize(
    ("x", "z", "named"),
    [(math.nan, 0.0, "x = nan V"), (0.0, -math.inf, "z = -inf V"), (math.inf, math.nan, "x = inf V, z = nan V")],
)
def test_drive_that_is_not_finite_ends_the_run_and_is_told_with_axis_value_and_sender(
    x: float, z: float, named: str
) -> None:
    def broken(measurement: Measurement) -> list[PiezoDrive]:
        return [answer(measurement, x, 0.0, z)] if measurement.sequence == 20 else honest(measurement)

    with bench(broken) as b:
        reports: list[DiagnosticArray] = []
        b.observer.create_subscription(DiagnosticArray, "/diagnostics", reports.append, 10)
        status = b.run_until(InstrumentStatus.FAULT)
        assert status.detail == (
            f"drive {named} is not allowed: every voltage must be a finite number "
            "(answer to measurement 20 from /afm/hand_made)"
        )
        assert (status.ticks, status.drives_refused) == (20, 1)
        b.graph.spin_until(lambda: reports and reports[-1].status[0].message == status.detail)
        assert reports[-1].status[0].level == DiagnosticStatus.ERROR
        assert b.call(topics.PLAY) == (False, "the run is over: call reset first")
        # A repaired controller needs no restart of the instrument.
        b.controller.law = honest
        assert b.call(topics.RESET)[0]
        assert b.run_to_the_end().trajectory_sha256 == expected_sha()


@pytest.mark.parametrize("axis", ["x", "z"])
def test_motion_beyond_all_numbers_is_told_and_never_reaches_a_controller(axis: str) -> None:
    def absurd(measurement: Measurement) -> list[PiezoDrive]:
        drive = answer(measurement, 0.0, 0.0)
        setattr(drive.voltage, axis, 1e308)
        return [drive]

    with bench(absurd) as b:
        status = b.run_until(InstrumentStatus.FAULT)
        assert "diverged" in status.detail
        assert "e+308" in status.detail
        assert status.ticks < TICKS
        assert np.isfinite([measurement.position.z for measurement in b.controller.seen]).all()
        assert np.isfinite([measurement.deflection for measurement in b.controller.seen]).all()


# Silence.


def test_silent_controller_is_named_and_the_run_goes_on_when_it_answers() -> None:
    silent = {20}
    asked: list[int] = []

    def moody(measurement: Measurement) -> list[PiezoDrive]:
        asked.append(measurement.sequence)
        return [] if measurement.sequence in silent else honest(measurement)

    with bench(moody, lockstep_timeout=0.1) as b:
        status = b.run_until(InstrumentStatus.STALLED)
        assert status.detail == (
            "/afm/hand_made has not answered measurement 20 within 0.1 s (run.lockstep_timeout); still waiting"
        )
        assert status.ticks == 20
        # It has not lost the measurement: it is asked again, and answers at last.
        b.graph.spin_until(lambda: asked.count(20) > 1)
        silent.clear()
        score = b.run_to_the_end()
        assert score.trajectory_sha256 == expected_sha()
        assert sorted(set(asked)) == list(range(TICKS))
        assert b.observer.status.drives_lost == 1
        states = [status.state for status in b.observer.statuses]
        assert InstrumentStatus.RUNNING in states[states.index(InstrumentStatus.STALLED) :]


def test_stall_says_what_the_controller_sends_in_place_of_an_answer() -> None:
    """As one does that counts on by itself after a pause of its own."""

    def confused(measurement: Measurement) -> list[PiezoDrive]:
        return (
            honest(measurement)
            if measurement.sequence < 5
            else [answer(measurement, 0.0, 0.0, 0.0, a) for a in (12, 13)]
        )

    # Longer than a machine that stands still for a moment, and shorter than the second after which it is asked again.
    with bench(confused, lockstep_timeout=0.6) as b:
        status = b.run_until(InstrumentStatus.STALLED)
        assert status.detail == (
            "/afm/hand_made sends drives with sequence 17, 18; "
            "measurement 5 has been waiting for 0.6 s (run.lockstep_timeout)"
        )
        assert (status.ticks, status.drives_ahead) == (5, 2)
        b.graph.spin_until(
            lambda: "2 drives answered a measurement that has not been published" in b.observer.status.warning
        )
        b.controller.law = honest
        assert b.run_to_the_end().trajectory_sha256 == expected_sha()


def test_round_trip_of_the_score_leaves_out_discovery_and_what_was_sent_again() -> None:
    """The first answer and one more come only when they are asked for again, after a second."""
    asked: list[int] = []

    def slow(measurement: Measurement) -> list[PiezoDrive]:
        asked.append(measurement.sequence)
        forgetful = measurement.sequence in (0, 20) and asked.count(measurement.sequence) == 1
        return [] if forgetful else honest(measurement)

    with bench(slow) as b:
        traces: list[ControlTrace] = []
        b.observer.create_subscription(ControlTrace, topics.CONTROL_TRACE, traces.append, topics.STREAM_QOS)
        score = b.run_to_the_end()
        b.graph.spin_until(lambda: sum(len(trace.round_trip) for trace in traces) == TICKS)
        trips = np.concatenate([trace.round_trip for trace in traces])
        assert trips[0] > 1.0
        assert trips[20] > 1.0
        assert score.round_trip.max == np.delete(trips, [0, 20]).max()
        assert score.drives_lost == 1


def test_stalled_run_is_not_said_to_be_over() -> None:
    with bench(
        lambda measurement: [] if measurement.sequence == 5 else honest(measurement), lockstep_timeout=0.05
    ) as b:
        b.run_until(InstrumentStatus.STALLED)
        assert "over" not in b.call(topics.PLAY)[1]
        assert b.call(topics.PAUSE) == (True, "")
        assert b.run_until(InstrumentStatus.PAUSED).ticks == 5
        assert b.call(topics.PLAY) == (True, "")
        b.run_until(InstrumentStatus.STALLED)


def test_restarted_controller_is_given_the_measurement_that_its_forerunner_did_not_answer() -> None:
    with bench(lambda measurement: honest(measurement) if measurement.sequence < 20 else []) as b:
        b.graph.spin_until(lambda: b.sequences[-1:] == [20])
        b.graph.remove(b.controller)
        b.controller = b.graph.add(HandController(honest, name="hand_made_again"))
        score = b.run_to_the_end()
        assert b.sequences == list(range(20, TICKS))
        assert score.trajectory_sha256 == expected_sha()
        assert b.observer.status.controllers == ["/afm/hand_made_again"]


# Play, pause, reset.


def test_run_waits_for_play_and_pauses_between_two_ticks() -> None:
    with bench(start_paused=True) as b:
        # Everybody is there; several reports later it still waits.
        count = len(b.observer.statuses)
        b.graph.spin_until(lambda: len(b.observer.statuses) > count + 2)
        assert (b.observer.status.state, b.observer.status.ticks) == (InstrumentStatus.WAITING, 0)
        assert b.call(topics.PLAY) == (True, "")
        b.graph.spin_until(lambda: len(b.controller.seen) > 20)
        assert b.call(topics.PAUSE) == (True, "")
        paused_at = b.run_until(InstrumentStatus.PAUSED).ticks
        assert 0 < paused_at < TICKS
        count = len(b.observer.statuses)
        b.graph.spin_until(lambda: len(b.observer.statuses) > count + 2)
        assert (b.observer.status.state, b.observer.status.ticks) == (InstrumentStatus.PAUSED, paused_at)
        assert b.call(topics.PLAY) == (True, "")
        score = b.run_to_the_end()
        assert b.sequences == list(range(TICKS))
        assert score.trajectory_sha256 == expected_sha()
        assert b.call(topics.PLAY) == (False, "the run is over: call reset first")
        assert b.call(topics.PAUSE) == (False, "the run is over: there is nothing to pause")


def test_reset_repeats_the_trajectory_from_anywhere() -> None:
    with bench() as b:
        b.graph.spin_until(lambda: len(b.controller.seen) > 50)
        assert b.call(topics.RESET) == (True, "")
        first = b.run_to_the_end()
        assert b.call(topics.RESET) == (True, "")
        second = b.run_to_the_end()
        assert first.trajectory_sha256 == second.trajectory_sha256 == expected_sha()
        starts = [i for i, sequence in enumerate(b.sequences) if sequence == 0]
        assert len(starts) == 3
        assert b.sequences[starts[2] :] == list(range(TICKS))
        assert b.observer.status.ticks == TICKS


def test_reset_of_a_run_that_started_paused_waits_for_play_again() -> None:
    with bench(start_paused=True) as b:
        b.call(topics.PLAY)
        b.run_to_the_end()
        b.call(topics.RESET)
        count = len(b.observer.statuses)
        b.graph.spin_until(lambda: len(b.observer.statuses) > count + 2)
        assert (b.observer.status.state, b.observer.status.ticks) == (InstrumentStatus.WAITING, 0)
        b.call(topics.PLAY)
        assert b.run_to_the_end().trajectory_sha256 == expected_sha()


# What it tells.


def test_who_joins_late_is_told_the_last_state_and_the_score() -> None:
    with bench(ticks=20) as b:
        b.run_to_the_end()
        # Only the late one is served: what it hears has been said before it came.
        late, alone = Observer("late"), SingleThreadedExecutor()
        b.graph.nodes.append(late)
        alone.add_node(late)
        wait_until(lambda: late.statuses and late.scores, lambda: late.told, lambda: alone.spin_once(timeout_sec=0.01))
        assert late.statuses[0].state == InstrumentStatus.FINISHED
        assert [score.wall for score in late.scores] == [b.observer.scores[-1].wall]


def test_clock_ends_with_the_run() -> None:
    with bench(ticks=500) as b:
        times: list[float] = []
        b.observer.create_subscription(
            Clock, "/clock", lambda message: times.append(message.clock.sec + 1e-9 * message.clock.nanosec), 10
        )
        b.run_to_the_end()
        b.graph.spin_until(lambda: times and times[-1] == pytest.approx(500 * PERIOD, abs=1e-9))
        assert times == sorted(times)


# As a process.


def test_instrument_without_direct_takes_gives_the_same_run_and_still_serves(tmp_path: Path) -> None:
    """The path of an rclpy whose wait set is not at hand: everything goes through an executor."""
    program = (
        "import sys; from afm_node_common.direct import Inbox; Inbox._make_wait_set = staticmethod(lambda node: None); "
        "from afm_sim_node.node import main; sys.exit(main())"
    )
    parameters = {"plant.control_period": PERIOD, "run.duration": TICKS * PERIOD}
    with (
        Graph() as graph,
        Command(sys.executable, "-c", program, *ros_arguments(parameters), folder=tmp_path) as simulator,
    ):
        observer, controller = graph.add(Observer()), graph.add(HandController(honest))
        simulator.wait_until(lambda: len(controller.seen) > 20, graph)
        assert observer.call(graph, topics.PAUSE).success
        graph.spin_until(lambda: observer.status.state == InstrumentStatus.PAUSED)
        assert observer.call(graph, topics.PLAY).success
        simulator.wait_until(lambda: observer.scores, graph)
        assert observer.scores[0].trajectory_sha256 == expected_sha()
        assert observer.call(graph, topics.RESET).success
        simulator.interrupt()
        assert simulator.wait(graph) == 0, simulator.told


@pytest.mark.parametrize(("x", "last", "code"), [(0.1, 49, 0), (math.nan, 0, 1)], ids=["finished", "fault"])
def test_simulator_that_may_exit_does_so_when_the_run_is_over(tmp_path: Path, x: float, last: int, code: int) -> None:
    parameters = {"run.duration": 50 * PERIOD, "plant.control_period": PERIOD, "run.exit_when_finished": True}
    program = executable("afm_sim_node", "afm_sim_node")
    with Graph() as graph, Command(program, *ros_arguments(parameters), folder=tmp_path) as simulator:
        controller = graph.add(HandController(lambda measurement: [answer(measurement, x, 0.0)]))
        assert simulator.wait(graph) == code, simulator.told
        assert controller.seen[-1].sequence == last


def test_controller_that_cannot_be_heard_is_told_why() -> None:
    with bench() as b:
        b.graph.remove(b.controller)
        deaf = b.graph.add(Observer("best_effort"))
        publisher = deaf.create_publisher(PiezoDrive, topics.PIEZO_DRIVE, qos_profile_sensor_data)
        b.graph.spin_until(lambda: b.observer.status.detail)
        assert b.observer.status.detail == ("/afm/best_effort publishes piezo_drive best effort: it must be reliable")
        assert (b.observer.status.state, b.observer.status.controllers) == (InstrumentStatus.WAITING, [])
        deaf.destroy_publisher(publisher)
        b.graph.spin_until(lambda: not b.observer.status.detail)
        b.graph.add(HandController(honest))
        assert b.run_to_the_end().trajectory_sha256 == expected_sha()
