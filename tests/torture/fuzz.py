"""Messages that are none, drawn by hypothesis, on every topic that a node listens to; and parameters of wrong types."""

import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from random import Random

import numpy as np
from afm_msgs.msg import InstrumentStatus, Measurement, PiezoDrive, RecorderStatus
from hand_controller import run_in_process
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st
from malformed import SIZE, nonsense, read
from numpy.typing import NDArray
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters
from rclpy.node import Node
from rclpy.qos import qos_profile_parameter_events
from recorder_bench import BLOCK, FakeInstrument
from support import Command, Graph, Observer, executable, ros_arguments

from afm_model import Controller, ControllerParameters, Instrument, SimParameters, build
from afm_node_common import topics
from afm_node_common.cdr import measurement_codec
from afm_node_common.drive_codec import drive_codec
from afm_recorder_node.reader import read_recording
from torture.family import Try
from torture.listener import Listener
from torture.outcome import Outcome
from torture.senseless import EVENTS, senseless
from torture.trio import CONTROLLER, RECORDER, SIMULATOR

_PERIOD = 2e-6
_AT_ONCE = 2
"""Before each message that is one: fewer than a queue holds."""
_DEEP = 10
"""Messages at once on a topic that keeps many."""
_ROUNDS = 2
DRIVES, MEASUREMENTS, STREAMS, PARAMETERS = 100, 50, _ROUNDS * (3 * _DEEP + 2), 12
"""Of one try."""
_TICKS = DRIVES // _AT_ONCE
_NUMBERS = (ParameterType.PARAMETER_INTEGER, ParameterType.PARAMETER_DOUBLE)


def drawn(strategy: st.SearchStrategy[bytes], count: int, number: int) -> list[bytes]:
    """So many examples of hypothesis, by seed."""
    found: list[bytes] = []

    @seed(number)
    @settings(
        max_examples=count,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def collect(data: bytes) -> None:
        found.append(data)

    while len(found) < count:
        collect()
    return found[:count]


@cache
def bad(kind: type) -> st.SearchStrategy[bytes]:
    """Bytes that are no message of this type, by the rules of CDR alone.

    Not without bytes: Fast DDS does not deliver such a message, nor the next ones of the same publisher, until its
    queue has gone over it. And none that are one when filled up to four bytes: on the way they are.
    """

    def none(data: bytes) -> bool:
        return bool(data) and read(data + bytes(-len(data) % 4), kind) is None

    spoiled = st.randoms(use_true_random=False).map(lambda rng: nonsense(rng, kind))
    return (spoiled | st.binary(max_size=300)).filter(none)


def drive(sequence: int, z: float) -> NDArray[np.float64]:
    """What answers a measurement [V]."""
    return np.array([1e-3 * (sequence % 5), 0.0, z])


class Hand(Node):
    """Plays the controller: some messages that are none before each answer, by one publisher and so in order."""

    def __init__(self, namespace: str, z: float) -> None:
        super().__init__("hand", namespace=namespace)
        self.bad: list[bytes] = []
        """Still to be sent."""
        self._z, self._answered = z, (0, -1)
        self._publisher = self.create_publisher(PiezoDrive, topics.PIEZO_DRIVE, topics.CONTROL_QOS)
        self._decode, self._encode = measurement_codec().decode, drive_codec().encode
        self.create_subscription(Measurement, topics.MEASUREMENT, self._on_measurement, topics.CONTROL_QOS, raw=True)

    def _on_measurement(self, data: bytes) -> None:
        run_id, sequence, stamp_ns, _ = self._decode(data)
        # One that comes again, on a slow machine, has its answer: several more would fill a queue.
        if (run_id, sequence) == self._answered:
            return
        self._answered = run_id, sequence
        for _ in range(_AT_ONCE):
            self._publisher.publish(self.bad.pop())
        self._publisher.publish(self._encode(run_id, sequence, stamp_ns, drive(sequence, self._z)))


class Plant:
    """A simulator in lockstep, and the hand that answers it."""

    def __init__(self, graph: Graph, folder: Path, namespace: str) -> None:
        values = {"plant.control_period": _PERIOD, "run.duration": _TICKS * _PERIOD, "run.exit_when_finished": False}
        self.command = node(SIMULATOR, folder, namespace, **values)
        instrument = Instrument(build(SimParameters, {"plant.control_period": _PERIOD}))
        self._graph, self._observer = graph, graph.add(Observer(namespace=namespace))
        self._hand: Hand | None = None
        self._namespace, self._z = namespace, float(instrument.drive[2])
        run_in_process(instrument, lambda _: drive(instrument.ticks, self._z), _TICKS)
        self._sha256 = instrument.trajectory_sha256()

    def try_one(self, rng: Random) -> None:
        """One run among nonsense: all of it is counted, and the trajectory is the same to the last bit."""
        bad_drives = drawn(bad(PiezoDrive), DRIVES, rng.getrandbits(32))
        scores = self._observer.scores
        before = len(scores)
        if self._hand is None:
            self._hand = Hand(self._namespace, self._z)
            self._hand.bad = bad_drives
            self._graph.add(self._hand)
        else:
            self._hand.bad = bad_drives
            self._observer.call(self._graph, topics.RESET)
        self.command.wait_until(lambda: len(scores) > before, self._graph)
        score = scores[-1]
        assert score.drives_malformed == DRIVES, f"{score.drives_malformed} of {DRIVES} counted"
        assert score.trajectory_sha256 == self._sha256, "the trajectory is another one"


class Law(Node):
    """A controller, and somebody who sends it measurements."""

    def __init__(self, graph: Graph, folder: Path, namespace: str) -> None:
        super().__init__("measurer", namespace=namespace)
        self.command = node(CONTROLLER, folder, namespace, **{"law.kind": "tanh"})
        self._graph, self._law = graph, Controller(build(ControllerParameters, {"law.kind": "tanh"}))
        self._publisher = self.create_publisher(Measurement, topics.MEASUREMENT, topics.CONTROL_QOS)
        self._drives: list[PiezoDrive] = []
        self.create_subscription(PiezoDrive, topics.PIEZO_DRIVE, self._drives.append, 100)
        self._listener = graph.add(Listener(namespace, each=False))
        self._codec, self._sent, self._sequence = measurement_codec(), 0, 0
        graph.add(self)

    def try_one(self, rng: Random) -> None:
        """Each measurement among nonsense gets the answer that it gets without."""
        waiting = drawn(bad(Measurement), MEASUREMENTS, rng.getrandbits(32))
        listening = lambda: self._publisher.get_subscription_count() and self.count_publishers("piezo_drive")  # noqa: E731
        self.command.wait_until(listening, self._graph)
        values = 1e-9 * np.array([rng.gauss(0.0, 1.0) for _ in range(SIZE[Measurement])])
        while waiting:
            for _ in range(_AT_ONCE):
                self._publisher.publish(waiting.pop())
                self._sent += 1
            number = len(self._drives)
            self._publisher.publish(self._codec.encode(1, self._sequence, self._sequence * 1000, values))
            self.command.wait_until(lambda number=number: len(self._drives) > number, self._graph)
            told = self._drives[-1]
            expected = self._law.answer(values, self._sequence * 1e-6)
            assert told.sequence == self._sequence
            assert [told.voltage.x, told.voltage.y, told.voltage.z] == expected.tolist(), "another answer"
            self._sequence += 1
        self.command.wait_until(lambda: self._listener.dropped >= self._sent, self._graph)
        assert self._listener.dropped == self._sent, f"{self._listener.dropped} of {self._sent} counted"


class Tape:
    """A recorder, and somebody who sends it blocks."""

    def __init__(self, graph: Graph, folder: Path, namespace: str) -> None:
        self._path = folder / "run.mcap"
        self.command = node(RECORDER, folder, namespace, path=str(self._path))
        self._graph, self._told = graph, RecorderStatus()
        self._instrument = graph.add(FakeInstrument(namespace))
        self._instrument.create_subscription(RecorderStatus, topics.RECORDER_STATUS, self._on_told, topics.LATCHED_QOS)
        self._instrument.controller = self._instrument.get_fully_qualified_name()
        self._events = self._instrument.create_publisher(
            ParameterEvent, "/parameter_events", qos_profile_parameter_events
        )
        self._sent = self._blocks = 0

    def _on_told(self, message: RecorderStatus) -> None:
        self._told = message

    def try_one(self, rng: Random) -> None:
        """Nonsense between blocks is dropped and counted; the blocks are recorded."""
        instrument = self._instrument
        heard = lambda: all(one.get_subscription_count() for one in instrument.all)  # noqa: E731
        self.command.wait_until(lambda: heard() and self._told.path, self._graph)
        instrument.publish_status(InstrumentStatus.RUNNING, self._blocks * BLOCK)
        publishers = {
            topics.CONTROL_TRACE: instrument.trace,
            topics.DEFLECTION: instrument.waveforms[topics.DEFLECTION],
            topics.STATUS: instrument.status,
            topics.SCORE: instrument.score,
            EVENTS: self._events,
        }
        messages = st.randoms(use_true_random=False)
        for _ in range(_ROUNDS):
            for topic, publisher in publishers.items():
                # Of a topic that keeps one value the recorder may see the last one only.
                count = 1 if topic in (topics.STATUS, topics.SCORE) else _DEEP
                strategy = messages.map(lambda source, topic=topic: senseless(source, topic))
                for data in drawn(strategy, count, rng.getrandbits(32)):
                    publisher.publish(data)
                    self._sent += 1
            self.command.wait_until(lambda: self._told.messages_dropped >= self._sent, self._graph)
        assert self._told.messages_dropped == self._sent, f"{self._told.messages_dropped} of {self._sent} counted"
        instrument.publish_block(self._blocks * BLOCK)
        self._blocks += 1
        self.command.wait_until(lambda: self._told.ticks >= self._blocks * BLOCK, self._graph)

    def check(self) -> None:
        """End the recorder; its recording holds the blocks and nothing else."""
        ticks = self._blocks * BLOCK
        self._instrument.end_run(ticks)
        self.command.process.send_signal(signal.SIGINT)
        assert self.command.wait(self._graph) == 0, self.command.text
        recording = read_recording(self._path)
        assert recording.complete and len(recording.time_ticks) == ticks, f"{len(recording.time_ticks)} of {ticks}"
        assert np.array_equal(recording.drive[:, 0], np.arange(ticks, dtype=float)), "the numbers are others"


class Setter(Node):
    """Sets parameters of the three nodes to values of types that they do not have."""

    def __init__(self, graph: Graph, nodes: Sequence[str]) -> None:
        super().__init__("setter")
        self._graph, self._nodes = graph, nodes
        self._asked_for = {
            name: (
                self.create_client(ListParameters, f"{name}/list_parameters"),
                self.create_client(GetParameters, f"{name}/get_parameters"),
                self.create_client(SetParameters, f"{name}/set_parameters"),
            )
            for name in nodes
        }
        graph.add(self)

    def try_one(self, rng: Random) -> None:
        """Each call is refused or changes nothing."""
        for name, (lists, gets, sets) in self._asked_for.items():
            self._graph.spin_until(sets.service_is_ready)
            names = sorted(self._graph.result(lists.call_async(ListParameters.Request())).result.names)
            before = self._graph.result(gets.call_async(GetParameters.Request(names=names))).values
            types = dict(zip(names, (value.type for value in before), strict=True))
            for _ in range(PARAMETERS // len(self._nodes)):
                chosen = rng.choice(names)
                value = ParameterValue(bool_value=True, string_value="x" * rng.randrange(100))
                # A whole number is taken for a real one.
                like = {types[chosen], *_NUMBERS} if types[chosen] in _NUMBERS else {types[chosen]}
                value.type = rng.choice([kind for kind in (*range(10), *range(10, 256, 35)) if kind not in like])
                request = SetParameters.Request(parameters=[Parameter(name=chosen, value=value)])
                (result,) = self._graph.result(sets.call_async(request)).results
                assert not result.successful, f"{name}: {chosen} was set to a value of type {value.type}"
            after = self._graph.result(gets.call_async(GetParameters.Request(names=names))).values
            assert list(after) == list(before), f"parameters of {name} have changed"


@contextmanager
def family(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
    """Nonsense on all topics: no node ends, none of it reaches the plant, and all of it is counted."""
    folder.mkdir(parents=True, exist_ok=True)
    names = [f"{namespace}_{letter}" for letter in "abc"]
    plant, law, tape = Plant(graph, folder, names[0]), Law(graph, folder, names[1]), Tape(graph, folder, names[2])
    nodes = [f"/{space}/{name}" for space, name in zip(names, (SIMULATOR, CONTROLLER, RECORDER), strict=True)]
    setter = Setter(graph, nodes)

    def one(rng: Random, outcome: Outcome) -> None:
        for each in (plant, law, tape, setter):
            each.try_one(rng)
        messages = DRIVES + MEASUREMENTS + STREAMS
        outcome.what = f"{messages} messages dropped and counted, {PARAMETERS} parameters refused"

    yield one
    tape.check()
    for each in (plant, law):
        each.command.process.send_signal(signal.SIGINT)
        assert each.command.wait(graph) == 0, each.command.text


def node(name: str, folder: Path, namespace: str, **parameters: object) -> Command:
    """A node on its own."""
    arguments = [*ros_arguments(parameters), "-r", f"__ns:=/{namespace}"]
    return Command(executable(name, name), *arguments, folder=folder)
