"""An action server in a node that loops is served while the loop runs at full speed.

How many milliseconds that takes is a figure of `make bench` ("a goal, sent to accepted").
"""

import statistics
import sys
from itertools import pairwise
from pathlib import Path

import pytest
from rclpy.action import ActionClient
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from support import Command, Graph, write_scenario

from afm_node_common import topics

# Comes with the wheels; under a ROS 2 of one's own it is the package ros-DISTRO-test-msgs.
Fibonacci = pytest.importorskip("test_msgs.action").Fibonacci

SCRIPT = Path(__file__).with_name("ticking_action_server.py")
ENDLESS = {"run.duration": 0.0, "plant.control_period": 20e-6}
GOALS = 25


def test_goals_are_answered_sooner_than_the_clock_is_told_twice_while_the_loop_ticks(tmp_path: Path) -> None:
    """The loop's own beat is the measure: on a busy machine it is late as well."""
    arguments = ["--ros-args", "--params-file", write_scenario(tmp_path / "endless.yaml", afm_sim_node=ENDLESS)]
    with Graph() as graph, Command(sys.executable, SCRIPT, *arguments, folder=tmp_path) as process:
        node = graph.add(Node("client", namespace=topics.NAMESPACE))
        client = ActionClient(node, Fibonacci, "count")
        beats: list[Clock] = []
        node.create_subscription(Clock, topics.clock(node.get_namespace()), beats.append, 1)
        process.wait_until(client.server_is_ready, graph)
        process.wait_until(lambda: beats, graph)
        missed, ticks, served = [], [], []
        for _ in range(GOALS):
            before = len(beats)
            handle = graph.result(client.send_goal_async(Fibonacci.Goal()))
            missed.append(len(beats) - before)
            assert handle.accepted
            now, count = graph.result(handle.get_result_async()).result.sequence
            ticks.append(now)
            served.append(count)
        assert served == list(range(1, GOALS + 1))
        # The loop went on between any two of them, on a busy machine by a few ticks.
        assert all(after > before for before, after in pairwise(ticks)), ticks
        assert ticks[-1] - ticks[0] > 10 * GOALS, ticks
        # The median: a machine that stands still for a moment delays a few.
        assert statistics.median(missed) < 2, missed
        process.interrupt()
        assert process.wait(graph) == 0, process.told
