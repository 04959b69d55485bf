"""A scan over topics, line by line, beside the same scan in process: what the topics cost it; and goals meanwhile."""

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from afm_msgs.msg import MicroscopeStatus, ScanLine
from machine import cpu_seconds, executable, running
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from sensor_msgs.msg import Image

from afm_model import load_scenario
from afm_model.microscope.image import DIRECTIONS
from afm_model.microscope.local import Local
from afm_model.microscope.verb import Verb
from afm_model.microscope.verbs import Approach, MoveTo, Scan
from afm_node_common import topics
from afm_node_common.verb_codec import ACTIONS, goal_of

SCENARIO = "two_materials"
CHANNELS = ("height", "error", "lateral")
_PATIENCE = 300.0


class Client:
    """Asks for verbs, and receives what a client with a picture on its screen does."""

    def __init__(self, node: Node) -> None:
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(node)
        self.node = node
        self.lines: list[bytes] = []
        self.images = 0
        node.create_subscription(ScanLine, topics.SCAN_LINE, self.lines.append, topics.SCAN_LINE_QOS, raw=True)
        node.create_subscription(MicroscopeStatus, topics.MICROSCOPE, lambda message: None, topics.LATCHED_QOS)
        for name in CHANNELS:
            for way in DIRECTIONS:
                topic = f"{topics.IMAGE}/{name}_{way}"
                node.create_subscription(Image, topic, self._on_image, topics.LATCHED_QOS, raw=True)
        self.actions = {
            name: ActionClient(node, ACTIONS[name], name) for name in (Approach.name, MoveTo.name, Scan.name)
        }

    def _on_image(self, data: bytes) -> None:
        self.images += 1

    def spin_until(self, predicate: Callable[[], object]) -> None:
        limit = time.monotonic() + _PATIENCE
        while not predicate():
            if time.monotonic() > limit:
                raise RuntimeError(f"waited {_PATIENCE:g} s for the simulator")
            self.executor.spin_once(timeout_sec=0.1)

    def do(self, verb: Verb) -> Any:
        """Result of a verb."""
        client = self.actions[verb.name]
        self.spin_until(client.server_is_ready)
        goal = client.send_goal_async(goal_of(verb), feedback_callback=lambda message: None)
        self.spin_until(goal.done)
        result = goal.result().get_result_async()
        self.spin_until(result.done)
        told = result.result().result
        if not told.success:
            raise RuntimeError(told.message)
        return told

    def close(self) -> None:
        for client in self.actions.values():
            client.destroy()
        self.node.destroy_node()


def _over_topics(folder: Path, scan: Scan, law: str, repeats: int) -> list[dict[str, float]]:
    file = str(load_scenario(SCENARIO).path)
    arguments = ["--ros-args", "--params-file", file, "-p", f"law.kind:={law}"]
    command = [executable("afm_sim_node", "afm_sim_node"), *arguments]
    rclpy.init()
    try:
        with running(command, log=folder / "bench.log") as (process,):
            client = Client(Node("bench", namespace=topics.NAMESPACE))
            client.do(Approach())
            figures = []
            for _ in range(repeats):
                used, begin, count = cpu_seconds(process.pid), time.monotonic(), len(client.lines)
                client.do(scan)
                client.spin_until(lambda count=count: len(client.lines) == count + 2 * scan.lines)
                wall = time.monotonic() - begin
                figures.append({"wall_s": wall, "cpu_s": cpu_seconds(process.pid) - used})
            client.close()
        return figures
    finally:
        rclpy.shutdown()


def _in_process(scan: Scan, repeats: int) -> list[dict[str, float]]:
    scenario = load_scenario(SCENARIO)
    local = Local(scenario.sim, scenario.controller, hashed=True)
    local.execute(Approach())
    figures = []
    for _ in range(repeats):
        used, begin = time.process_time(), time.monotonic()
        local.execute(scan)
        figures.append({"wall_s": time.monotonic() - begin, "cpu_s": time.process_time() - used})
    return figures


def answers(folder: Path, *, composed: bool, goals: int = 200) -> dict[str, float]:
    """Wall time from a goal to its acceptance, and to its result, while the loop runs as fast as it can [s].

    A scan is going on, so that each goal is answered at once: another verb is going on.
    """
    file = str(load_scenario(SCENARIO).path)
    name = ("afm_bringup", "composed") if composed else ("afm_sim_node", "afm_sim_node")
    law = [] if composed else ["-p", f"law.kind:={load_scenario(SCENARIO).controller.law.kind}"]
    accepted, ended = [], []
    rclpy.init()
    try:
        with running([executable(*name), "--ros-args", "--params-file", file, *law], log=folder / "bench.log"):
            client = Client(Node("bench", namespace=topics.NAMESPACE))
            client.do(Approach())
            scan = Scan(size_x=1e-6, pixels=64, lines=2000, line_rate=2.0)
            going = client.actions[Scan.name].send_goal_async(goal_of(scan))
            client.spin_until(going.done)
            move = client.actions[MoveTo.name]
            client.spin_until(move.server_is_ready)
            for _ in range(goals):
                begin = time.monotonic()
                goal = move.send_goal_async(goal_of(MoveTo(x=0.0, y=0.0)))
                client.spin_until(goal.done)
                accepted.append(time.monotonic() - begin)
                result = goal.result().get_result_async()
                client.spin_until(result.done)
                ended.append(time.monotonic() - begin)
                if result.result().result.success:
                    raise RuntimeError("the scan has come to its end")
            cancelled = going.result().cancel_goal_async()
            client.spin_until(cancelled.done)
            client.close()
    finally:
        rclpy.shutdown()
    quantile = statistics.quantiles(accepted, n=100)
    return {
        "accepted_p50_s": quantile[49],
        "accepted_p99_s": quantile[98],
        "accepted_max_s": max(accepted),
        "result_p50_s": statistics.median(ended),
    }


def measure(folder: Path, lines: int = 128, repeats: int = 3) -> dict[str, Any]:
    """Both take turns; `wall_s` and `cpu_s` are medians."""
    law = load_scenario(SCENARIO).controller.law.kind
    scan = Scan(size_x=1e-6, pixels=128, lines=lines, line_rate=5.0)
    over, inside = [], []
    for _ in range(repeats):
        inside += _in_process(scan, 1)
        over += _over_topics(folder, scan, law, 1)
    result: dict[str, Any] = {"lines": lines, "over_topics": over, "in_process": inside}
    result["answers"] = {
        name: answers(folder, composed=composed) for name, composed in (("law inside", False), ("composed", True))
    }
    for name in ("wall_s", "cpu_s"):
        result[name] = {
            "over_topics": statistics.median(each[name] for each in over),
            "in_process": statistics.median(each[name] for each in inside),
        }
    return result
