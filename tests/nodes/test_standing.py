"""A subscriber that stands still, or was killed, slows the loop: the simulator names it."""

import signal
import sys
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from support import Command, Graph, Observer, remove_shared_memory_left, wait_for_the_end_of

from afm_sim_node.node import SimNode

LISTENER = """
import rclpy
from afm_msgs.msg import Measurement
rclpy.init()
node = rclpy.create_node("listener", namespace="afm")
subscription = node.create_subscription(Measurement, "measurement", print, 10)
rclpy.spin(node)
"""


def test_subscriber_that_is_stopped_or_killed_is_named_in_status_and_diagnostics(tmp_path: Path) -> None:
    with Graph() as graph, Command(sys.executable, "-c", LISTENER, folder=tmp_path) as listener:
        observer = graph.add(Observer())
        entries: list[str] = []
        observer.create_subscription(
            DiagnosticArray, "/diagnostics", lambda array: entries.append(array.status[0].message), 10
        )
        graph.add(SimNode())
        listener.wait_until(lambda: "/afm/listener" in named(observer), graph)
        listener.wait_until(lambda: len(entries) > 2, graph)
        assert not any("listener" in entry for entry in entries)
        who = f"/afm/listener (process {listener.process.pid})"
        listener.process.send_signal(signal.SIGSTOP)
        stopped = f"{who} is stopped and subscribes to /afm/measurement: the loop is slower"
        graph.spin_until(lambda: stopped in observer.status.warning and any(stopped in entry for entry in entries))
        listener.process.send_signal(signal.SIGCONT)
        graph.spin_until(lambda: "listener" not in observer.status.warning)
        listener.process.kill()
        killed = f"{who} was killed and is still listed as a subscriber of /afm/measurement: the loop is slower"
        graph.spin_until(lambda: killed in observer.status.warning)
        listener.process.wait()
        wait_for_the_end_of([listener.process.pid])
    remove_shared_memory_left()


def named(observer: Observer) -> list[str]:
    """Full names of the nodes that subscribe to the measurements."""
    infos = observer.get_subscriptions_info_by_topic("/afm/measurement")
    return [f"{info.node_namespace}/{info.node_name}" for info in infos]
