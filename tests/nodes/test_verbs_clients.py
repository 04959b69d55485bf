"""A goal ends early when its own client has gone, and with nobody else."""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from action_msgs.msg import GoalStatus
from quick_lever import INSTRUMENT, LAW
from rclpy.action import ActionClient
from support import Command, Graph, ros_arguments
from verbs_bench import ENDLESS, Bench

from afm_node_common import topics
from afm_node_common.verb_codec import ACTIONS
from afm_sim_node import clients

FEEDBACK = "scan/_action/feedback"
PLAIN = Path(__file__).with_name("one_goal.py")
REMOTE = """
from verbs_bench import ENDLESS
from afm_bringup.remote import Remote
Remote().execute(ENDLESS)
"""
WATCHER = """
import rclpy
from afm_msgs.action import Scan
from rclpy.action import ActionClient
rclpy.init()
node = rclpy.create_node("watcher", namespace="afm")
client = ActionClient(node, Scan, "scan")
rclpy.spin(node)
"""


@pytest.fixture
def bench() -> Iterator[Bench]:
    with Graph(ros_arguments(INSTRUMENT | LAW)) as graph:
        yield Bench(graph)


@pytest.fixture
def path(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is run here finds what this process finds."""
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))


def listeners(bench: Bench, topic: str = FEEDBACK) -> int:
    """Subscriptions that the middleware knows of: those of a killed process for twenty seconds."""
    return len(bench.client.get_subscriptions_info_by_topic(f"/{topics.NAMESPACE}/{topic}"))


def client_topics(bench: Bench) -> list[str]:
    return [name for name, _ in bench.client.get_topic_names_and_types() if "/client_" in name]


def lasts(bench: Bench, stop: Callable[[], object]) -> bool:
    """Whether the verb goes on for long after its client would have counted as gone."""
    stop()
    limit = time.monotonic() + 2.0 * clients.SILENCE
    bench.graph.spin_until(lambda: time.monotonic() > limit or not bench.simulator.run.operator.busy)
    return bool(bench.simulator.run.operator.busy)


def said(bench: Bench) -> str:
    """How the last verb has ended."""
    bench.graph.spin_until(lambda: bench.states[-1].doing == "")
    return str(bench.states[-1].last)


def idle(bench: Bench) -> bool:
    return not bench.simulator.run.operator.busy


def test_client_that_was_killed_does_not_end_the_scan_of_the_next_one(bench: Bench, tmp_path: Path) -> None:
    bench.approach()
    with Command(sys.executable, PLAIN, folder=tmp_path) as process:
        bench.graph.spin_until(lambda: not idle(bench))
        process.process.kill()
        # Its goal is ended, because nobody else listens.
        bench.graph.spin_until(lambda: idle(bench))
    assert "its client has gone" in said(bench)
    bench.approach()
    handle = bench.begin(ENDLESS)
    assert listeners(bench) == 2, "the middleware has missed the killed client already: this test shows nothing"
    assert lasts(bench, lambda: None)
    bench.graph.result(handle.cancel_goal_async())
    assert bench.end(handle).status == GoalStatus.STATUS_CANCELED


def test_one_that_only_listens_is_not_missed(bench: Bench, tmp_path: Path) -> None:
    bench.approach()
    with Command(sys.executable, "-c", WATCHER, folder=tmp_path) as watcher:
        bench.graph.spin_until(lambda: listeners(bench) == 1)
        handle = bench.begin(ENDLESS)
        assert lasts(bench, watcher.process.kill)
    bench.graph.result(handle.cancel_goal_async())
    assert bench.end(handle).status == GoalStatus.STATUS_CANCELED


@pytest.mark.usefixtures("path")
@pytest.mark.parametrize("way", [signal.SIGKILL, signal.SIGSTOP])
def test_our_client_is_missed_before_the_middleware_misses_it_whoever_else_listens(
    bench: Bench, tmp_path: Path, way: signal.Signals
) -> None:
    bench.approach()
    others = [ActionClient(bench.client, ACTIONS["scan"], "scan") for _ in range(2)]
    with Command(sys.executable, "-c", REMOTE, folder=tmp_path) as process:
        process.wait_until(lambda: not idle(bench), bench.graph)
        (known,) = client_topics(bench)
        process.process.send_signal(way)
        bench.graph.spin_until(lambda: idle(bench))
        assert listeners(bench, known.rpartition("/")[2]) == 1
    assert "its client has gone" in said(bench)
    for other in others:
        other.destroy()


def test_plain_client_that_leaves_without_a_word_is_missed_whoever_else_listens(bench: Bench, tmp_path: Path) -> None:
    bench.approach()
    other = ActionClient(bench.client, ACTIONS["scan"], "scan")
    with Command(sys.executable, PLAIN, folder=tmp_path) as process:
        process.wait_until(lambda: not idle(bench), bench.graph)
        process.interrupt()
        bench.graph.spin_until(lambda: idle(bench))
    assert "its client has gone" in said(bench)
    assert listeners(bench) == 1
    other.destroy()
