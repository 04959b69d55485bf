"""Bags: a record is one, which other programs read; one of `ros2 bag record` is read as a recording."""

import random
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recorded
from afm_msgs.msg import ControlTrace, Event, InstrumentStatus, Measurement, PiezoDrive, Score, Waveform
from mcap.reader import make_reader
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from recorded import CONTROL_PERIOD, Run
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore
from support import Command, Graph, Observer, executable, write_scenario

from afm_bringup.replay_command import main as replay
from afm_controller_node.node import ControllerNode
from afm_node_common import topics
from afm_recorder_node.bag import PARAMETER_EVENTS
from afm_recorder_node.definitions import definition, kind_of
from afm_recorder_node.inspect_command import main as inspect
from afm_recorder_node.node import RecorderNode
from afm_recorder_node.reader import read_recording
from afm_recorder_node.record import open_record
from afm_recorder_node.recording import RecordingError
from afm_sim_node.node import SimNode

TICKS = 3000
SPACE = f"/{topics.NAMESPACE}"


@cache
def typestore(*kinds: str) -> Typestore:
    """The types of ROS, and ours."""
    types = get_typestore(Stores.ROS2_JAZZY)
    for kind in kinds:
        found = get_types_from_msg(definition(kind), kind)
        types.register({name: what for name, what in found.items() if name not in types.fielddefs})
    return types


def test_record_is_read_by_programs_of_others_with_the_definitions_in_it(tmp_path: Path) -> None:
    run = Run(TICKS)
    path = recorded.record(tmp_path / "run.mcap", run.messages())
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert len(summary.chunk_indexes) > 0
        times = [message.log_time for _, channel, message in reader.iter_messages(topics=["control_trace"])]
    assert times == [round(1e9 * CONTROL_PERIOD) * first for first in range(0, TICKS, 500)]
    with AnyReader([path]) as bag:
        assert bag.message_count == summary.statistics.message_count
        found = [(each.topic, bag.deserialize(raw, each.msgtype)) for each, _, raw in bag.messages()]
    traces: list[Any] = [message for topic, message in found if topic.endswith("control_trace")]
    assert np.array_equal(np.concatenate([each.drive.reshape(-1, 3) for each in traces]), run.drive)
    waves: list[Any] = [message for topic, message in found if topic.endswith("truth/normal_force")]
    assert np.array_equal(np.concatenate([each.samples for each in waves]), run.samples[3])
    assert {each.run_id for each in (*traces, *waves)} == {1}


def test_measurements_of_a_record_played_to_a_controller_alone_give_its_drives_to_the_last_bit(tmp_path: Path) -> None:
    ticks, path = 300, tmp_path / "run.mcap"
    run = {"run.duration": ticks * 20e-6, "plant.control_period": 20e-6, "run.wait_for_recorder": True}
    files = {"path": str(path), "exchanges": True, "view": False}
    scenario = write_scenario(tmp_path / "run.yaml", afm_sim_node=run, afm_recorder_node=files)
    arguments = ["--ros-args", "--params-file", str(scenario)]
    with Graph(arguments) as graph:
        observer, recorder = graph.add(Observer()), graph.add(RecorderNode())
        graph.add(SimNode())
        graph.add(ControllerNode())
        graph.spin_until(lambda: observer.scores and recorder.recorder.present.scored)
        recorder.finish(lambda timeout: graph.spin())
    kept: dict[str, list[Any]] = {topics.MEASUREMENT: [], topics.PIEZO_DRIVE: []}
    kinds = {topics.MEASUREMENT: Measurement, topics.PIEZO_DRIVE: PiezoDrive}
    for entry in open_record(path).raw():
        if entry.topic in kept:
            kept[entry.topic].append(deserialize_message(entry.data, kinds[entry.topic]))
    assert [each.sequence for each in kept[topics.MEASUREMENT]] == list(range(ticks))
    answers: list[PiezoDrive] = []
    with Graph(arguments) as graph:
        player = graph.add(Node("player", namespace=topics.NAMESPACE))
        publisher = player.create_publisher(Measurement, topics.MEASUREMENT, topics.MEASUREMENT_QOS)
        player.create_subscription(PiezoDrive, topics.PIEZO_DRIVE, answers.append, topics.CONTROL_QOS)
        graph.add(ControllerNode())
        graph.spin_until(lambda: publisher.get_subscription_count() and player.count_publishers(topics.PIEZO_DRIVE))
        for measurement in kept[topics.MEASUREMENT]:
            publisher.publish(measurement)
            graph.spin_until(lambda count=measurement.sequence + 1: len(answers) == count)
    assert [serialize_message(each) for each in answers] == [
        serialize_message(each) for each in kept[topics.PIEZO_DRIVE]
    ]


def test_bag_of_live_topics_is_inspected_and_replayed_to_the_last_bit(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = {"run.duration": TICKS * 20e-6, "plant.control_period": 20e-6, "run.start_paused": True, "score.start": 0.0}
    scenario = write_scenario(tmp_path / "short.yaml", afm_sim_node=run)
    command = Command(executable("afm_bringup", "composed"), "--ros-args", "--params-file", scenario, folder=tmp_path)
    listened = {
        topics.CONTROL_TRACE: (ControlTrace, topics.STREAM_QOS),
        topics.DEFLECTION: (Waveform, topics.STREAM_QOS),
        topics.STATUS: (InstrumentStatus, topics.EVERY_STATE_QOS),
        topics.SCORE: (Score, topics.LATCHED_QOS),
    }
    bag = Writer(tmp_path / "live", version=9, storage_plugin=StoragePlugin.MCAP)
    with Graph() as graph, command as process, bag:
        observer = graph.add(Observer())
        recorder = graph.add(Node("bag", namespace=topics.NAMESPACE))
        number = ticks = samples = scores = 0

        def listen(name: str, kind: Any, qos: Any) -> None:
            connection = bag.add_connection(f"{SPACE}/{name}", kind_of(kind), typestore=typestore(kind_of(kind)))

            def take(raw: bytes) -> None:
                nonlocal number, ticks, samples, scores
                number += 1
                bag.write(connection, number, raw)
                ticks += len(deserialize_message(raw, kind).deflection) if kind is ControlTrace else 0
                samples += len(deserialize_message(raw, kind).samples) if kind is Waveform else 0
                scores += kind is Score

            recorder.create_subscription(kind, name, take, qos, raw=True)

        for name, (kind, qos) in listened.items():
            listen(name, kind, qos)
        trace = observer.resolve_topic_name(topics.CONTROL_TRACE)
        process.wait_until(lambda: observer.count_publishers(trace) == 1, graph)
        process.wait_until(lambda: observer.status.state == InstrumentStatus.WAITING, graph)
        assert observer.call(graph, topics.PLAY).success
        process.wait_until(lambda: observer.status.state == InstrumentStatus.FINISHED, graph)
        process.wait_until(lambda: bool(observer.scores) and scores, graph)
        process.wait_until(lambda: ticks == TICKS and samples == observer.status.samples, graph)
        process.interrupt()
        assert process.wait(graph) == 0
    place = str(tmp_path / "live")
    assert inspect([place]) == 0
    said = capsys.readouterr().out
    assert f"{TICKS} ticks of 20 µs" in said
    assert observer.scores[-1].trajectory_sha256 in said
    assert "FINISHED" in said
    assert replay([place]) == 1
    assert "--scenario" in capsys.readouterr().err
    assert replay([place, "--scenario", str(scenario)]) == 0
    assert observer.scores[-1].trajectory_sha256 in capsys.readouterr().out


def test_events_of_bags_from_before_they_had_levels_are_read(tmp_path: Path) -> None:
    before = get_typestore(Stores.ROS2_JAZZY)
    fields = get_types_from_msg("std_msgs/Header header\nuint64 tick\nstring text\n", kind_of(Event))
    before.register(fields)
    kinds = before.types
    header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](0, 5_000), "")
    event = kinds[kind_of(Event)](header, 3, "Approach was done")
    block = Waveform(first_sample=0, sample_period=1e-6, samples=[1.0], scale=1.0, unit="m")
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as made:
        first = made.add_connection(f"{SPACE}/deflection", kind_of(block), typestore=typestore(kind_of(block)))
        made.write(first, 0, serialize_message(block))
        second = made.add_connection(f"{SPACE}/events", kind_of(Event), typestore=before)
        made.write(second, 0, before.serialize_cdr(event, kind_of(Event)))
    found = read_recording(tmp_path / "bag")
    assert (found.events, found.event_levels) == ([(5e-6, "Approach was done")], ["INFO"])


def test_bags_that_cannot_be_read_rightly_are_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def bag(name: str, *messages: tuple[str, Any]) -> Path:
        with Writer(tmp_path / name, version=9, storage_plugin=StoragePlugin.MCAP) as made:
            known: dict[str, Any] = {}
            for time, (topic, message) in enumerate(messages):
                known[topic] = known.get(topic) or made.add_connection(
                    topic, kind_of(message), typestore=typestore(kind_of(message))
                )
                made.write(known[topic], time, serialize_message(message))
        return tmp_path / name

    block = Waveform(first_sample=0, sample_period=1e-6, samples=[1.0], scale=1.0, unit="m")
    other = Waveform(first_sample=0, sample_period=-1.0, samples=[1.0], scale=1.0, unit="m")
    for path, told in (
        (bag("empty", (PARAMETER_EVENTS, ParameterEvent())), "no control_trace and no waveform"),
        (bag("two", ("/a/deflection", block), ("/b/deflection", block)), "several instruments"),
        (bag("again", (f"{SPACE}/deflection", block), (f"{SPACE}/deflection", block)), "several runs"),
        (bag("bad", (f"{SPACE}/deflection", other)), "period -1 s"),
    ):
        with pytest.raises(RecordingError, match=told):
            read_recording(path)
        assert inspect([str(path)]) == 2
        assert told in capsys.readouterr().err
    other_version = get_typestore(Stores.ROS2_JAZZY)
    kind = kind_of(block)
    fields = get_types_from_msg("std_msgs/Header header\nuint64 first_sample\nfloat64[] samples\n", kind)
    other_version.register(fields)
    with Writer(tmp_path / "version", version=9, storage_plugin=StoragePlugin.SQLITE3) as made:
        made.write(
            made.add_connection(f"{SPACE}/deflection", kind, typestore=other_version), 0, serialize_message(block)
        )
    with pytest.raises(RecordingError, match="version is no readable recording"):
        read_recording(tmp_path / "version")
    content = next(bag("good", (f"{SPACE}/deflection", block)).glob("*.mcap")).read_bytes()
    rng = random.Random(4)
    for _ in range(30):
        (tmp_path / "cut.mcap").write_bytes(content[: rng.randrange(len(content) - 40)])
        with pytest.raises(RecordingError):
            read_recording(tmp_path / "cut.mcap")
