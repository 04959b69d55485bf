"""A controller with `use_sim_time` that answers from a timer: /clock at every tick, and what is reported without it."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread

import numpy as np
import pytest
from afm_msgs.msg import InstrumentStatus, Measurement, PiezoDrive
from hand_controller import answer, run_in_process
from rclpy.clock import Clock as RosClock
from rclpy.clock import ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from support import Graph, Observer, ros_arguments

from afm_model import Instrument, ParameterError, SimParameters, build
from afm_node_common import topics
from afm_sim_node.node import SimNode

PERIOD = 1e-3
TICKS = 100
INSTRUMENT = {"plant.control_period": PERIOD, "detector.sample_period": 1e-4, "score.start": 0.0}


class Timed(Node):
    """Keeps the newest measurement and answers it when a timer of 1 kHz of simulated time is due."""

    def __init__(self) -> None:
        simulated = Parameter("use_sim_time", value=True)
        super().__init__("timed", namespace=topics.NAMESPACE, parameter_overrides=[simulated])
        self.newest: Measurement | None = None
        self._publisher = self.create_publisher(PiezoDrive, topics.PIEZO_DRIVE, 10)
        self.create_subscription(Measurement, topics.MEASUREMENT, self._keep, 10)
        self.create_timer(PERIOD, self._answer)

    def _keep(self, measurement: Measurement) -> None:
        self.newest = measurement

    def _answer(self) -> None:
        if self.newest is not None:
            self._publisher.publish(answer(self.newest, *push(self.newest.sequence)))


@contextmanager
def spinning(node: Node) -> Iterator[None]:
    """The node alone in an executor, as in a process: who serves other nodes in between mixes up its callbacks."""
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    thread = Thread(target=executor.spin)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join()
        node.destroy_node()


def push(sequence: int) -> tuple[float, float]:
    return 1e-3 * (sequence % 7), -1e-3 * (sequence % 5)


def expected_sha() -> str:
    instrument = Instrument(build(SimParameters, INSTRUMENT))
    z = instrument.drive[2]
    return run_in_process(instrument, lambda _: np.array([*push(instrument.ticks), z]), TICKS).trajectory_sha256()


def arguments(ticks: int = TICKS, **run: object) -> list[str]:
    given = INSTRUMENT | {"run.duration": ticks * PERIOD} | {f"run.{name}": value for name, value in run.items()}
    return ros_arguments(given)


def test_timer_of_simulated_time_answers_every_measurement_in_lockstep_also_after_a_reset() -> None:
    with Graph(arguments(clock_each_tick=True)) as graph, spinning(Timed()):
        observer = graph.add(Observer())
        graph.add(SimNode())
        graph.spin_until(lambda: observer.scores)
        observer.call(graph, topics.RESET)
        graph.spin_until(lambda: len(observer.scores) > 1)
    for score in observer.scores:
        assert score.trajectory_sha256 == expected_sha()
        # On a machine that stands still one may be sent again.
        assert score.drives_lost < 5


class Waiting(Node):
    """Sleeps until a simulated time in a thread, and has a timer of simulated and one of wall time."""

    def __init__(self, until: float) -> None:
        simulated = Parameter("use_sim_time", value=True)
        super().__init__("waiting", namespace=topics.NAMESPACE, parameter_overrides=[simulated])
        self.simulated, self.wall = 0, 0
        self.woken: list[float] = []
        self.create_timer(PERIOD, self._count_simulated)
        self.create_timer(0.01, self._count_wall, clock=RosClock(clock_type=ClockType.STEADY_TIME))
        self._until = Time(seconds=until, clock_type=ClockType.ROS_TIME)
        self.sleeper = Thread(target=self._sleep)

    def _count_simulated(self) -> None:
        self.simulated += 1

    def _count_wall(self) -> None:
        self.wall += 1

    def _sleep(self) -> None:
        self.get_clock().sleep_until(self._until)
        self.woken.append(self.get_clock().now().nanoseconds * 1e-9)


def test_at_a_reset_timers_go_on_and_a_sleep_until_a_time_lasts_until_the_new_run_has_reached_it() -> None:
    until = 3.5 * TICKS * PERIOD
    with Graph(arguments(ticks=4 * TICKS, clock_each_tick=True)) as graph, spinning(Timed()):
        waiting = Waiting(until)
        with spinning(waiting):
            observer = graph.add(Observer())
            simulator = graph.add(SimNode())
            graph.spin_until(lambda: waiting.get_clock().now().nanoseconds > 0)
            waiting.sleeper.start()
            graph.spin_until(lambda: simulator.run.instrument.ticks > TICKS // 2)
            observer.call(graph, topics.RESET)
            assert not waiting.woken
            before = waiting.simulated, waiting.wall
            graph.spin_until(lambda: observer.scores)
            graph.spin_until(lambda: waiting.woken)
            assert waiting.woken[0] >= until
            # The run after the reset had all of its ticks, and its timers.
            assert waiting.simulated - before[0] > 3 * TICKS
            assert waiting.wall > before[1]
            waiting.sleeper.join()


def test_timer_of_a_controller_that_is_started_again_in_lockstep_goes_on_where_the_other_has_ended() -> None:
    with Graph(arguments(clock_each_tick=True)) as graph:
        observer = graph.add(Observer())
        simulator = graph.add(SimNode())
        with spinning(Timed()):
            graph.spin_until(lambda: simulator.run.instrument.ticks > TICKS // 2)
        with spinning(Timed()):
            graph.spin_until(lambda: observer.scores)
    assert observer.scores[0].trajectory_sha256 == expected_sha()


def test_controller_that_waits_for_simulated_time_is_named_as_the_cause_when_a_run_in_lockstep_stalls() -> None:
    with Graph(arguments(ticks=20_000, lockstep_timeout=0.3)) as graph, spinning(Timed()):
        observer = graph.add(Observer())
        graph.add(SimNode())
        graph.spin_until(lambda: observer.status.state == InstrumentStatus.STALLED)
        assert observer.status.detail == (
            "/afm/timed has not answered measurement 0 within 0.3 s (run.lockstep_timeout); still waiting (/afm/timed "
            "subscribes to /clock (use_sim_time): its timers wait for simulated time. Set run.clock_each_tick to true; "
            "their period must be at most plant.control_period = 0.001 s)"
        )


def test_score_of_a_controller_that_waits_for_simulated_time_in_real_time_names_the_cause() -> None:
    with Graph(arguments(mode="realtime", real_time_factor=0.5, watchdog_timeout=100.0)) as graph, spinning(Timed()):
        observer = graph.add(Observer())
        graph.add(SimNode())
        graph.spin_until(lambda: observer.scores)
        score = observer.scores[0]
    assert not score.valid
    assert "ran on a held drive" in score.reason and "/afm/timed subscribes to /clock" in score.reason


def test_clock_of_a_run_in_real_time_shows_every_tick_on_demand() -> None:
    times: list[int] = []
    with (
        Graph(arguments(mode="realtime", real_time_factor=0.5, watchdog_timeout=100.0, clock_each_tick=True)) as graph,
        spinning(Timed()),
    ):
        observer = graph.add(Observer())
        observer.create_subscription(
            Clock, "/clock", lambda m: times.append(m.clock.sec * 10**9 + m.clock.nanosec), QoSProfile(depth=1000)
        )
        graph.add(SimNode())
        graph.spin_until(lambda: observer.scores and times[-1:] == [TICKS * 10**6])
    assert times == sorted(times)
    assert {*times} >= {k * 10**6 for k in range(TICKS + 1)}


def test_clock_at_every_tick_is_refused_with_a_law_inside_where_nobody_answers() -> None:
    given = INSTRUMENT | {"law.kind": "open_loop", "run.clock_each_tick": True}
    with (
        Graph(ros_arguments(given)),
        pytest.raises(ParameterError, match=r"run\.clock_each_tick = true is not allowed"),
    ):
        SimNode()
