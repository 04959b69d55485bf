"""Bags of `ros2 bag`: a recording becomes one that other programs read; one of live topics is read as a recording."""

import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from afm_msgs.msg import ControlTrace, Event, InstrumentStatus, Score, Waveform
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from recorded import CONTROL_PERIOD, Run
from rerun.chunk import McapReader
from support import Command, Graph, Observer, executable, write_scenario

from afm_bringup.replay_command import main as replay
from afm_model.microscope.image import Image, Line
from afm_model.microscope.verbs import Scan
from afm_node_common import topics
from afm_recorder_node import layout
from afm_recorder_node.inspect_command import main as inspect
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import Recording, RecordingError
from afm_recorder_node.scan_lines import ScanLine
from afm_recorder_node.writer import RecordingWriter

pytest.importorskip("rosbags.highlevel", reason="an extra of the recorder; `make test` installs it")
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from afm_recorder_node.bag import PARAMETER_EVENTS, kind_of, typestore
from afm_recorder_node.mcap import export

TICKS = 3000
SPACE = f"/{topics.NAMESPACE}"


def recorded(path: Path) -> Recording:
    """A recording with all that there may be in one, and a gap."""
    run = Run(TICKS)
    writer = RecordingWriter(path)
    writer.parameters(
        "afm_sim_node", {"plant.control_period": CONTROL_PERIOD, "cantilever.a": 3e-9, "plant.kind": "compliant"}
    )
    writer.parameters("afm_controller_node", {"law.alpha": 20.0})
    writer.event(0, "RUNNING")
    for start in (*range(0, 1500, 500), *range(2000, TICKS, 500)):
        run.write(writer, start, start + 500)
    extra = layout.signal("piezo/current", "A")
    writer.channel(extra, 0, 1e-5, np.arange(300.0))
    scan = Scan(size_x=1e-6, pixels=4, lines=2, channels="height")
    for number in range(4):
        way = ("trace", "retrace")[number % 2]
        line = Line(number // 2, way, 1e-3 * number, {"height": np.arange(4.0) * 1e-9 + number})
        writer.line(ScanLine(1, scan, line, {"height": "m"}))
    writer.parameter_change(4_000_000, "afm_controller_node", "law.alpha", 20.0, 5.0)
    writer.event(5_000_000, "noise has begun", "WARN")
    writer.event(6_000_000, "FINISHED: all is done")
    trip = {"p50": 1e-5, "p99": 2e-5, "p99_9": 3e-5, "max": 4e-5}
    writer.score(
        6_000_000,
        {
            "ticks": TICKS,
            "rms": {"x": 1e-9, "y": 2e-9, "z": 3e-9},
            "round_trip": trip,
            "faults": ["noise"],
            "valid": True,
        },
    )
    writer.close()
    return read_recording(path)


def test_bag_of_a_recording_is_that_recording_again_to_the_round_off_of_its_units(tmp_path: Path) -> None:
    one = recorded(tmp_path / "run.rrd")
    export(one, tmp_path / "bag")
    for place in (tmp_path / "bag", tmp_path / "bag" / "bag.mcap"):
        other = read_recording(place)
        for name in ("time_ticks", "time_samples", "drive"):
            np.testing.assert_array_equal(getattr(other, name), getattr(one, name))
        assert len(one.time_ticks) == 2500
        for name in ("position", "reference", "error", "round_trip"):
            np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=2e-15, atol=2e-23)
        assert other.channels.keys() == one.channels.keys()
        for name, channel in one.channels.items():
            np.testing.assert_array_equal(other.channels[name].time, channel.time)
            np.testing.assert_allclose(other.channels[name].values, channel.values, rtol=1e-15)
            assert other.channels[name].unit == channel.unit
        assert other.deflection_scale == one.deflection_scale
        assert other.events == one.events and other.event_levels == one.event_levels
        assert other.event_levels[other.events.index((0.005, "noise has begun"))] == "WARN"
        assert other.parameters["afm_sim_node"] == one.parameters["afm_sim_node"]
        assert [(each.time, each.name, each.new) for each in other.parameter_changes] == [(0.004, "law.alpha", 5.0)]
        assert isinstance(one.score, dict) and isinstance(other.score, dict)
        assert {name: other.score[name] for name in one.score} == one.score
        np.testing.assert_equal(other.images[0].data, one.images[0].data)
        assert isinstance(other.images[0], Image) and other.images[0].times == one.images[0].times
    with pytest.raises(OSError, match="exists"):
        export(one, tmp_path / "bag")


def test_bag_is_read_by_programs_of_others_with_the_types_of_our_messages(tmp_path: Path) -> None:
    one = recorded(tmp_path / "run.rrd")
    count = export(one, tmp_path / "bag")
    with AnyReader([tmp_path / "bag"]) as bag:  # by the definitions in the bag alone
        assert bag.message_count == count
        messages = [(c.topic, time, bag.deserialize(raw, c.msgtype)) for c, time, raw in bag.messages()]
    traces: list[Any] = [message for topic, _, message in messages if topic == f"{SPACE}/control_trace"]
    drives = np.concatenate([each.drive.reshape(-1, 3) for each in traces])
    np.testing.assert_array_equal(drives, one.drive)
    assert {each.control_period for each in traces} == {CONTROL_PERIOD}
    shown: list[Any] = [message for topic, _, message in messages if topic == f"{SPACE}/telemetry"]
    np.testing.assert_array_equal([each.drive_y for each in shown], one.drive[:, 1])
    for topic, time, message in messages:
        if topic != PARAMETER_EVENTS:
            assert time == message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
    read = McapReader(tmp_path / "bag" / "bag.mcap")
    entities = {chunk.entity_path for chunk in read.stream()}
    assert {f"{SPACE}/control_trace", f"{SPACE}/deflection", f"{SPACE}/telemetry"} <= entities


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
            connection = bag.add_connection(f"{SPACE}/{name}", f"afm_msgs/msg/{kind.__name__}", typestore=typestore())

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
    fields = get_types_from_msg("std_msgs/Header header\nuint64 tick\nstring text\n", kind_of(Event()))
    before.register(fields)
    kinds = before.types
    header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](0, 5_000), "")
    event = kinds[kind_of(Event())](header, 3, "Approach was done")
    block = Waveform(first_sample=0, sample_period=1e-6, samples=[1.0], scale=1.0, unit="m")
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as made:
        first = made.add_connection(f"{SPACE}/deflection", kind_of(block), typestore=typestore())
        made.write(first, 0, serialize_message(block))
        second = made.add_connection(f"{SPACE}/events", kind_of(Event()), typestore=before)
        made.write(second, 0, before.serialize_cdr(event, kind_of(Event())))
    found = read_recording(tmp_path / "bag")
    assert (found.events, found.event_levels) == ([(5e-6, "Approach was done")], ["INFO"])


def test_bags_that_cannot_be_read_rightly_are_refused_in_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def bag(name: str, *messages: tuple[str, Any]) -> Path:
        with Writer(tmp_path / name, version=9, storage_plugin=StoragePlugin.MCAP) as made:
            known: dict[str, Any] = {}
            for time, (topic, message) in enumerate(messages):
                known[topic] = known.get(topic) or made.add_connection(topic, kind_of(message), typestore=typestore())
                made.write(known[topic], time, serialize_message(message))
        return tmp_path / name

    block = Waveform(first_sample=0, sample_period=1e-6, samples=[1.0], scale=1.0, unit="m")
    other = Waveform(first_sample=0, sample_period=-1.0, samples=[1.0], scale=1.0, unit="m")
    for path, told in (
        (bag("empty", (PARAMETER_EVENTS, ParameterEvent())), "neither control_trace nor a waveform"),
        (bag("two", ("/a/deflection", block), ("/b/deflection", block)), "several instruments"),
        (bag("again", (f"{SPACE}/deflection", block), (f"{SPACE}/deflection", block)), "several runs"),
        (bag("bad", (f"{SPACE}/deflection", other)), "is not valid: period"),
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
    with pytest.raises(RecordingError, match="afm_msgs/msg/Waveform of another version"):
        read_recording(tmp_path / "version")
    content = next(bag("good", (f"{SPACE}/deflection", block)).glob("*.mcap")).read_bytes()
    rng = random.Random(4)
    for _ in range(30):
        (tmp_path / "cut.mcap").write_bytes(content[: rng.randrange(len(content) - 40)])
        with pytest.raises(RecordingError):
            read_recording(tmp_path / "cut.mcap")
