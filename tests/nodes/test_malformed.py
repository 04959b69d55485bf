"""Bytes that are no message: each is dropped, counted and named; no node ends of them, and the plant does not move."""

import functools
import random
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import pytest
from afm_msgs.msg import InstrumentStatus, Measurement, PiezoDrive
from hand_controller import HandController, answer, run_in_process
from malformed import SIZE, message, nonsense, read, spoiled
from rclpy.node import Node
from support import Graph, Observer, ros_arguments

from afm_controller_node.node import ControllerNode
from afm_model import Command, Controller, ControllerParameters, DriveError, Instrument, SimParameters, build
from afm_model.core.errors import MalformedError
from afm_node_common import topics
from afm_node_common.cdr import Codec, measurement_codec
from afm_node_common.drive_codec import drive_codec
from afm_sim_node.node import SimNode

SEED = 20
MESSAGES = 10_000
PERIOD = 2e-6
TICKS = 100
CODEC: dict[type, Callable[..., Codec]] = {
    PiezoDrive: functools.cache(drive_codec),
    Measurement: functools.cache(measurement_codec),
}


# The codec.


@pytest.mark.parametrize("fast", [True, False])
@pytest.mark.parametrize("kind", [PiezoDrive, Measurement])
def test_ten_thousand_spoiled_messages_are_read_right_or_refused(kind: type, fast: bool) -> None:
    rng, decode = random.Random(SEED), CODEC[kind](fast=fast).decode
    refused = 0
    for number in range(MESSAGES // 4):
        data = message(rng, kind)
        data = data if number % 10 == 0 else spoiled(rng, data)
        expected = read(data, kind)
        if expected is None:
            refused += 1
            with pytest.raises(MalformedError, match=kind.__name__):
                decode(data)
        else:
            *head, values = decode(data)
            assert tuple(head) == expected[:3], (number, data.hex())
            # A horizon that cannot be one is refused as a drive, not as bytes.
            if not isinstance(values, DriveError):
                first = values.voltage if isinstance(values, Command) else values
                assert first.tobytes() == expected[3], (number, data.hex())
    # Both kinds are there in number.
    assert 0.5 < refused / (MESSAGES // 4) < 0.9


@pytest.mark.parametrize("fast", [True, False])
@pytest.mark.parametrize("kind", [PiezoDrive, Measurement])
def test_refusal_says_what_is_wrong(kind: type, fast: bool) -> None:
    codec, name = CODEC[kind](fast=fast), kind.__name__
    whole = codec.encode(1, 7, 11, np.arange(SIZE[kind], dtype=float))

    def changed(at: int, news: bytes) -> bytes:
        return whole[:at] + news + whole[at + len(news) :]

    for data, sentence in (
        (b"\0\1", f"2 bytes that are no {name} (RMWError)"),
        (b"", f"0 bytes that are no {name} (they begin with 0x: plain CDR begins with 0x0001 or 0x0000)"),
        (whole + b"\0" * 8, f"{len(whole) + 8} bytes for a {name} of {len(whole)}"),
        (changed(4, struct.pack("<i", -1)), f"a {name} with stamp -1 s + 11 ns: it must be a time since the start"),
        (
            changed(8, struct.pack("<I", 10**9)),
            f"a {name} with stamp 0 s + 1000000000 ns: it must be a time since the start",
        ),
        (changed(17, b"\xff"), f"a {name} whose frame_id is no text in UTF-8"),
    ):
        with pytest.raises(MalformedError) as caught:
            codec.decode(data)
        assert str(caught.value) == sentence


# Over topics.


class Saboteur(Node):
    """Publishes any bytes on one topic of the control loop."""

    def __init__(self, kind: type, topic: str) -> None:
        super().__init__("saboteur", namespace=topics.NAMESPACE)
        self._publisher = self.create_publisher(kind, topic, topics.CONTROL_QOS)
        self._rng, self._kind, self.sent = random.Random(SEED), kind, 0

    @property
    def heard(self) -> bool:
        return bool(self._publisher.get_subscription_count())

    def send(self, count: int) -> None:
        """Some messages that are none; no more at once than a queue holds."""
        for _ in range(count):
            self._publisher.publish(bytes.fromhex("0001") if self.sent == 0 else nonsense(self._rng, self._kind))
            self.sent += 1


def push(measurement: Measurement) -> PiezoDrive:
    return answer(measurement, 1e-3 * (measurement.sequence % 5), 0.0)


@contextmanager
def bench(**parameters: object) -> Iterator[tuple[Graph, Observer, SimNode, Saboteur]]:
    values = {"plant.control_period": PERIOD, "run.duration": TICKS * PERIOD} | parameters
    with Graph(ros_arguments(values)) as graph:
        observer, saboteur = graph.add(Observer()), graph.add(Saboteur(PiezoDrive, topics.PIEZO_DRIVE))
        yield graph, observer, graph.add(SimNode()), saboteur


def test_lockstep_run_among_nonsense_is_the_same_to_the_last_bit_and_all_of_it_is_counted() -> None:
    with bench() as (graph, observer, simulator, saboteur):

        def law(measurement: Measurement) -> Sequence[PiezoDrive]:
            saboteur.send(3)
            return [push(measurement)]

        graph.add(HandController(law))
        graph.spin_until(lambda: observer.scores)
        instrument = Instrument(build(SimParameters, {"plant.control_period": PERIOD}))
        z = instrument.drive[2]
        run_in_process(instrument, lambda _: np.array([1e-3 * (instrument.ticks % 5), 0.0, z]), TICKS)
        assert observer.scores[0].trajectory_sha256 == instrument.trajectory_sha256()
        graph.spin_until(lambda: observer.status.state == InstrumentStatus.FINISHED)
        # What was sent with the last answer may come after it.
        assert 3 * TICKS - 3 <= observer.status.drives_malformed <= saboteur.sent
        assert observer.scores[0].drives_malformed == observer.status.drives_malformed
        assert "PiezoDrive" in simulator.run.snapshot().unreadable
        assert "from /afm/hand_made and /afm/saboteur" in simulator.run.snapshot().unreadable


def test_realtime_run_among_nonsense_goes_on_with_the_drives_and_warns() -> None:
    with bench(
        **{
            "plant.control_period": 1e-3,
            "detector.sample_period": 1e-4,
            "run.mode": "realtime",
            "run.duration": 0.0,
            "run.watchdog_timeout": 1000.0,
        }
    ) as (graph, observer, simulator, saboteur):
        counts = lambda: simulator.run.snapshot().counts  # noqa: E731
        controller = graph.add(HandController(lambda measurement: [push(measurement)]))
        graph.spin_until(lambda: simulator.run.ticking and saboteur.heard and len(controller.seen) > 5)
        for _ in range(40):
            saboteur.send(5)
            graph.spin_until(lambda: counts().drives_malformed == saboteur.sent)
        graph.spin_until(lambda: "could not be read and were dropped, the last: " in observer.status.warning)
        assert observer.status.state == InstrumentStatus.RUNNING
        # Drives went on being put in force.
        assert counts().drives_lost < simulator.run.snapshot().ticks
        assert counts().drives_refused == 0


def test_controller_among_nonsense_answers_as_if_there_were_none() -> None:
    with Graph(ros_arguments({"law.kind": "tanh"})) as graph:
        controller = graph.add(ControllerNode())
        saboteur = graph.add(Saboteur(Measurement, topics.MEASUREMENT))
        drives: list[PiezoDrive] = []
        saboteur.create_subscription(PiezoDrive, topics.PIEZO_DRIVE, drives.append, 100)
        law = Controller(build(ControllerParameters, {"law.kind": "tanh"}))
        codec, rng = measurement_codec(), np.random.default_rng(SEED)
        publisher = saboteur.create_publisher(Measurement, topics.MEASUREMENT, topics.CONTROL_QOS)
        graph.spin_until(lambda: saboteur.heard and publisher.get_subscription_count())
        for sequence in range(60):
            saboteur.send(5)
            values = 1e-9 * rng.standard_normal(SIZE[Measurement])
            publisher.publish(codec.encode(1, sequence, sequence * 1000, values))
            graph.spin_until(
                lambda sequence=sequence: len(drives) == sequence + 1 and controller.drops.count == saboteur.sent
            )
            expected = law.answer(values, sequence * 1e-6)
            told = drives[-1]
            assert told.sequence == sequence
            assert [told.voltage.x, told.voltage.y, told.voltage.z] == expected.tolist()
        assert "a message on /afm/measurement from /afm/saboteur was dropped: " in controller.drops.last
