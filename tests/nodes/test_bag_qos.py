"""A subscriber with the QoS that is shipped for `ros2 bag record` misses no measurement of a fast run."""

from pathlib import Path

import pytest
import yaml
from afm_msgs.msg import InstrumentStatus, Measurement
from ament_index_python.packages import get_package_share_directory
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from support import Command, Graph, Observer, executable, write_scenario

from afm_node_common import topics

OVERRIDES = yaml.safe_load((Path(get_package_share_directory("afm_bringup")) / "config" / "bag_qos.yaml").read_text())
TICKS = 5000
BLOCKS = (
    topics.CONTROL_TRACE,
    topics.DEFLECTION,
    topics.LATERAL_FORCE,
    topics.TRUTH_LATERAL_FORCE_Y,
    topics.TRUTH_NORMAL_FORCE,
)


def profile(topic: str) -> QoSProfile:
    """The QoS of a topic in the file, as rosbag2 reads it."""
    said = OVERRIDES[f"/{topics.NAMESPACE}/{topic}"]
    return QoSProfile(
        reliability=ReliabilityPolicy.get_from_short_key(said["reliability"]),
        durability=DurabilityPolicy.get_from_short_key(said["durability"]),
        history=HistoryPolicy.get_from_short_key(said["history"]),
        depth=said["depth"],
    )


def test_file_names_the_topics_of_the_instrument() -> None:
    assert set(OVERRIDES) == {f"/{topics.NAMESPACE}/{topic}" for topic in (topics.MEASUREMENT, *BLOCKS)}


@pytest.mark.parametrize("topic", [topics.MEASUREMENT, *BLOCKS])
def test_qos_of_a_topic_is_that_of_rosbag2(topic: str) -> None:
    assert profile(topic).depth >= topics.MEASUREMENT_QOS.depth >= TICKS
    assert profile(topic).reliability == ReliabilityPolicy.RELIABLE


def test_recorder_that_falls_behind_gets_every_measurement(tmp_path: Path) -> None:
    run = {"run.duration": TICKS * 20e-6, "plant.control_period": 20e-6, "run.start_paused": True}
    scenario = write_scenario(tmp_path / "short.yaml", afm_sim_node=run)
    arguments = ["--ros-args", "--params-file", scenario]
    command = Command(executable("afm_bringup", "composed"), *arguments, folder=tmp_path)
    # The graph is up as long as the process: what is sent again is asked for by the recorder.
    with Graph() as graph, command as process:
        observer = graph.add(Observer())
        recorder = graph.add(Node("recorder", namespace=topics.NAMESPACE))
        got: list[bytes] = []
        recorder.create_subscription(Measurement, topics.MEASUREMENT, got.append, profile(topics.MEASUREMENT), raw=True)
        topic = observer.resolve_topic_name(topics.MEASUREMENT)
        process.wait_until(lambda: observer.count_subscribers(topic) == 2, graph)
        process.wait_until(lambda: observer.status.state == InstrumentStatus.WAITING, graph)
        assert observer.call(graph, topics.PLAY).success
        process.wait_until(lambda: observer.status.state == InstrumentStatus.FINISHED, graph)
        process.wait_until(lambda: len(got) >= TICKS, graph)
        sequences = [deserialize_message(data, Measurement).sequence for data in got]
        assert sequences == list(range(TICKS))
        process.interrupt()
        assert process.wait(graph) == 0
