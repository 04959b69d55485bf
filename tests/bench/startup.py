"""Time from starting a node to its first message, and the memory it lives in, beside a node that does nothing."""

import statistics
import sys
import time
from pathlib import Path
from typing import Any

import rclpy
from afm_msgs.msg import InstrumentStatus
from machine import executable, resident_megabytes, running
from rclpy.node import Node

from afm_node_common import topics

_BARE = """
import rclpy
from rclpy.node import Node
from afm_msgs.msg import InstrumentStatus
from afm_node_common import topics
rclpy.init()
node = Node("bare", namespace=topics.NAMESPACE)
publisher = node.create_publisher(InstrumentStatus, topics.STATUS, topics.LATCHED_QOS)
publisher.publish(InstrumentStatus())
try:
    rclpy.spin(node)
except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    pass
"""


def _first_message(command: list[str], folder: Path) -> tuple[float, float]:
    """Seconds to the first status of a process; its resident memory then."""
    rclpy.init()
    try:
        node = Node("bench")
        heard: list[InstrumentStatus] = []
        node.create_subscription(
            InstrumentStatus, f"/{topics.NAMESPACE}/{topics.STATUS}", heard.append, topics.LATCHED_QOS
        )
        begin = time.monotonic()
        with running(command, log=folder / "bench.log") as (process,):
            while not heard:
                if process.poll() is not None or time.monotonic() > begin + 120.0:
                    raise RuntimeError(f"a node did not start: see {folder / 'bench.log'}")
                rclpy.spin_once(node, timeout_sec=0.01)
            seconds = time.monotonic() - begin
            resident = resident_megabytes(process.pid)
        node.destroy_node()
        return seconds, resident
    finally:
        rclpy.shutdown()


def measure(folder: Path, repeats: int = 3) -> dict[str, Any]:
    """Medians; the compiled kernels are in their cache."""
    commands = {"simulator": [executable("afm_sim_node", "afm_sim_node")], "bare": [sys.executable, "-c", _BARE]}
    result: dict[str, Any] = {}
    for name, command in commands.items():
        _first_message(command, folder)
        runs = [_first_message(command, folder) for _ in range(repeats)]
        result[name] = {
            "start_s": statistics.median(seconds for seconds, _ in runs),
            "resident_mb": statistics.median(resident for _, resident in runs),
        }
    return result
