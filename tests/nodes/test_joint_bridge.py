"""The joint bridge over real topics: states of joints out, efforts in, and what answers a measurement."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from afm_msgs.msg import InstrumentStatus, Measurement, PiezoDrive, Score
from builtin_interfaces.msg import Time as TimeMessage
from pd_twin import Twin
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import JointState
from support import Command, Graph, Observer, executable, ros_arguments

from afm_bringup.joint_bridge import AXES, COMMANDS, STATES, JointBridge, efforts, joint_state
from afm_model import SimParameters, build, simulate
from afm_model.parts import record_at
from afm_model.parts.signals import Measurement as SignalsMeasurement
from afm_node_common import topics
from afm_sim_node.node import SimNode

PERIOD = 20e-6
TICKS = 120
RUN: dict[str, object] = {"plant.control_period": PERIOD, "run.duration": TICKS * PERIOD, "score.start": 0.0}
GAINS = {"x": (3e10, 6e5), "y": (3e10, 6e5), "z": (5.2e8, 8.4e4)}
"""Those of the controller of the README, [V/m] and [V s/m]."""

Law = Callable[[JointState], Sequence[dict[str, float]]]


def tracking(state: JointState) -> dict[str, float]:
    """Proportional-derivative tracking from a state of the joints: effort of each axis [V]."""
    given = {}
    for axis, (gain, damping) in GAINS.items():
        error = state.name.index(f"{axis}_error")
        given[axis] = -gain * state.position[error] - damping * state.velocity[error]
    return given


class JointController(Node):
    """A controller that knows joints only, with the QoS of a hardware interface of ros2_control.

    Parameters
    ----------
    law : callable
        Gives commands for a state: of each the efforts by axis [V].
    wall_period : float
        Wall time between two commands, for the newest state [s]; 0: a command for each state.
    """

    def __init__(self, law: Law, wall_period: float = 0.0) -> None:
        super().__init__("joint_controller", namespace=topics.NAMESPACE)
        self.law = law
        self.seen: list[JointState] = []
        self.sent = 0
        self.late: tuple[JointState, dict[str, float]] | None = None
        self._wall = wall_period
        self._publisher = self.create_publisher(JointState, COMMANDS, QoSProfile(depth=1))
        quality = qos_profile_sensor_data if wall_period else topics.CONTROL_QOS
        self.create_subscription(JointState, STATES, self._on_state, quality)
        if wall_period:
            self.create_timer(wall_period, self._answer)

    @property
    def told(self) -> str:
        return f"{len(self.seen)} states of joints"

    def _on_state(self, state: JointState) -> None:
        self.seen.append(state)
        if not self._wall:
            self._answer()

    def _answer(self) -> None:
        if not self.seen:
            return
        if self.late:
            self._send(*self.late)
            self.late = None
        for given in self.law(self.seen[-1]):
            self._send(self.seen[-1], given)

    def _send(self, state: JointState, given: dict[str, float]) -> None:
        self.sent += 1
        self._publisher.publish(JointState(header=state.header, name=list(given), effort=list(given.values())))


class Bench:
    """A simulator, the bridge, a controller of joints, and somebody who watches."""

    def __init__(self, graph: Graph, controller: JointController) -> None:
        self.graph = graph
        self.observer = graph.add(Observer())
        self.controller = graph.add(controller)
        graph.add(JointBridge())
        graph.add(SimNode())
        self.measured: list[Measurement] = []
        self.drives: list[PiezoDrive] = []
        watch = self.observer.create_subscription
        watch(Measurement, topics.MEASUREMENT, self.measured.append, topics.MEASUREMENT_QOS)
        watch(PiezoDrive, topics.PIEZO_DRIVE, self.drives.append, topics.MEASUREMENT_QOS)

    def run_to_the_end(self) -> Score:
        count = len(self.observer.scores)
        self.graph.spin_until(lambda: len(self.observer.scores) > count)
        self.graph.spin_until(lambda: self.observer.status.state == InstrumentStatus.FINISHED)
        return self.observer.scores[-1]


@contextmanager
def bench(law: Law, wall_period: float = 0.0, **parameters: object) -> Iterator[Bench]:
    with Graph(ros_arguments(RUN | parameters)) as graph:
        yield Bench(graph, JointController(law, wall_period))


class InProcess:
    """The same controller without a topic, from the fields of the measurement."""

    def answer(self, measurement: Any) -> list[float]:
        y = record_at(measurement, 0, SignalsMeasurement)
        given = []
        for i, (gain, damping) in enumerate(GAINS.values()):
            position, rate = (y.deflection, y.deflection_rate) if i == 2 else (y.position[i], y.velocity[i])
            given.append(gain * (y.reference_position[i] - position) + damping * (y.reference_velocity[i] - rate))
        return given


def test_controller_that_answers_each_state_of_the_joints_gives_the_bits_of_the_run_without_topics_and_tracks() -> None:
    sim = build(SimParameters, RUN)
    alone = simulate(sim, InProcess())
    with bench(lambda state: [tracking(state)]) as over_topics:
        first = over_topics.run_to_the_end()
        assert over_topics.observer.call(over_topics.graph, topics.RESET).success
        second = over_topics.run_to_the_end()
    assert first.trajectory_sha256 == second.trajectory_sha256 == alone.trajectory_sha256
    assert (first.drives_outdated, first.drives_ahead, first.drives_lost) == (0, 0, 0)
    # As the controller of the README, which has the same gains and damps z by the velocity of the scanner.
    readme = simulate(sim, Twin(sim)).score
    assert (first.rms.x, first.rms.y) == pytest.approx((readme.rms[0], readme.rms[1]), rel=0.01)


def test_command_of_the_run_before_a_reset_does_not_begin_the_next_one() -> None:
    alone = simulate(build(SimParameters, RUN), InProcess()).trajectory_sha256
    kept: list[JointState] = []

    def law(state: JointState) -> list[dict[str, float]]:
        if state.header.stamp == TimeMessage(nanosec=round(50 * PERIOD * 1e9)) and not kept:
            kept.append(state)
            return []
        return [tracking(state)]

    with bench(law) as over_topics:
        over_topics.graph.spin_until(lambda: kept)
        controller = over_topics.controller
        # Both sides are there: the next state is the first one of the new run, and the kept command arrives after it.
        controller.late = (kept[0], tracking(kept[0]))
        assert over_topics.observer.call(over_topics.graph, topics.RESET).success
        score = over_topics.run_to_the_end()
    assert score.trajectory_sha256 == alone
    assert score.drives_outdated == 1


def test_nothing_is_answered_before_a_controller_is_active_and_an_axis_without_one_keeps_its_drive() -> None:
    """As a controller manager: commands come all the time, NaN where no controller is active."""
    nothing, commanded = float("nan"), {"x": 0.25, "z": 0.002}
    active: set[str] = set()
    with bench(lambda _: [{axis: commanded[axis] if axis in active else nothing for axis in AXES}], 0.02) as run:
        # The bridge answers nothing yet, and the controller still has a state to compute with.
        run.graph.spin_until(lambda: run.controller.sent > 5 and run.controller.seen)
        assert not run.drives
        start = run.measured[0].drive
        for name in ("x", "z"):
            active.add(name)
            count = len(run.measured)
            run.graph.spin_until(lambda count=count: len(run.measured) > count + 5)
        active.clear()
        run.graph.spin_until(lambda sent=run.controller.sent: run.controller.sent > sent + 5)
        assert run.observer.status.state == InstrumentStatus.RUNNING
        count = len(run.drives)
        run.graph.spin_until(lambda sent=run.controller.sent: run.controller.sent > sent + 5)
        assert len(run.drives) == count
    sent = [(drive.voltage.x, drive.voltage.y, drive.voltage.z) for drive in run.drives]
    assert list(dict.fromkeys(sent)) == [(0.25, start.y, start.z), (0.25, start.y, 0.002)]


def test_score_says_how_many_answers_of_a_controller_on_a_1_khz_wall_clock_were_outdated(tmp_path: Path) -> None:
    # A tick in 50 ms of wall time: whatever the machine does meanwhile, several commands are for the same one.
    slow = {"plant.control_period": 5e-3, "run.duration": 0.2, "run.mode": "realtime", "run.real_time_factor": 0.1}
    simulator = (executable("afm_sim_node", "afm_sim_node"), *ros_arguments(slow))
    with (
        Command(executable("afm_bringup", "joint_bridge"), folder=tmp_path) as bridge,
        Command(*simulator, folder=tmp_path),
        Graph() as graph,
    ):
        observer = graph.add(Observer())
        controller = graph.add(JointController(lambda _: [dict.fromkeys(AXES, 0.001)], 1e-3))
        bridge.wait_until(lambda: observer.scores, graph)
        bridge.interrupt()
        assert bridge.wait(graph) == 0, bridge.text
    # More than half of the ticks have had a second command; no command is counted twice.
    assert 20 < observer.scores[0].drives_outdated < controller.sent


@pytest.mark.parametrize(
    ("names", "values", "given"),
    [
        ("xyz", (1.0, 2.0, 3.0), {"x": 1.0, "y": 2.0, "z": 3.0}),
        ("z", (-4.0,), {"z": -4.0}),
        (("tip", "z", "elbow", "x"), (0.0, 1.0, 5.0, 2.0), {"z": 1.0, "x": 2.0}),
        # joint_state_topic_hardware_interface names all joints, and lists efforts of those with a command interface.
        (("tip", "z", "x_error", "x"), (1.0, 2.0), {"z": 1.0, "x": 2.0}),
        ((), (), {}),
    ],
)
def test_efforts_are_taken_by_the_names_of_their_joints(
    names: tuple[str, ...], values: tuple[float, ...], given: dict[str, float]
) -> None:
    assert efforts(JointState(name=list(names), effort=values)) == given


@pytest.mark.parametrize(("names", "values"), [("xyz", ()), ("xy", (1.0,)), ((), (1.0, 2.0, 3.0))])
def test_command_with_another_number_of_efforts_is_refused_with_what_to_send(
    names: tuple[str, ...], values: tuple[float, ...]
) -> None:
    with pytest.raises(
        ValueError, match=rf"joint_commands has {len(values)} efforts for the joints .*: send the drive"
    ):
        efforts(JointState(name=list(names), position=[1.0] * len(names), effort=values))


def test_state_names_each_joint_with_position_velocity_and_volts() -> None:
    m = Measurement(deflection=2e-9, deflection_rate=3e-6, deflection_voltage=0.4)
    for k, field in enumerate(("position", "velocity", "reference_position", "reference_velocity", "drive")):
        for i, axis in enumerate(AXES):
            setattr(getattr(m, field), axis, 1e-9 * (10 * k + i + 1))
    state = joint_state(m)
    joints = {
        name: tuple(each) for name, *each in zip(state.name, state.position, state.velocity, state.effort, strict=True)
    }
    expected = {
        "x": (1e-9, 11e-9, 41e-9),
        "y": (2e-9, 12e-9, 42e-9),
        "z": (3e-9, 13e-9, 43e-9),
        "tip": (2e-9, 3e-6, 0.4),
        "x_error": (1e-9 - 21e-9, 11e-9 - 31e-9, 0.0),
        "y_error": (2e-9 - 22e-9, 12e-9 - 32e-9, 0.0),
        "z_error": (2e-9 - 23e-9, 3e-6 - 33e-9, 0.0),
    }
    assert joints.keys() == expected.keys()
    for name, numbers in expected.items():
        assert joints[name] == pytest.approx(numbers, rel=1e-12), name
