"""An action server in a node that loops is served while the loop runs at full speed."""

import statistics
import sys
import time
from itertools import pairwise
from pathlib import Path

import pytest
from rclpy.action import ActionClient
from rclpy.node import Node
from support import Command, Graph, write_scenario

from afm_node_common import topics

# Comes with the wheels; under a ROS 2 of one's own it is the package ros-DISTRO-test-msgs.
Fibonacci = pytest.importorskip("test_msgs.action").Fibonacci

SCRIPT = Path(__file__).with_name("ticking_action_server.py")
ENDLESS = {"run.duration": 0.0, "plant.control_period": 20e-6}
GOALS = 25


def test_goals_are_answered_within_50_ms_while_the_loop_ticks(tmp_path: Path) -> None:
    arguments = ["--ros-args", "--params-file", write_scenario(tmp_path / "endless.yaml", afm_sim_node=ENDLESS)]
    with Graph() as graph, Command(sys.executable, SCRIPT, *arguments, folder=tmp_path) as process:
        node = graph.add(Node("client", namespace=topics.NAMESPACE))
        client = ActionClient(node, Fibonacci, "count")
        process.wait_until(client.server_is_ready, graph)
        answered, ticks, served = [], [], []
        for _ in range(GOALS):
            begin = time.monotonic()
            handle = graph.result(client.send_goal_async(Fibonacci.Goal()))
            answered.append(time.monotonic() - begin)
            assert handle.accepted
            now, count = graph.result(handle.get_result_async()).result.sequence
            ticks.append(now)
            served.append(count)
        assert served == list(range(1, GOALS + 1))
        # The loop went on between any two of them.
        assert all(after - before > 10 for before, after in pairwise(ticks)), ticks
        # The median: a machine that stands still for a moment delays a few.
        assert statistics.median(answered) < 0.05, sorted(answered)
        process.interrupt()
        assert process.wait(graph) == 0, process.told
        client.destroy()
