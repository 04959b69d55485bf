"""The floor under every loop: the same two messages back and forth, with nothing done between.

Run as a program it is the second process: it answers each measurement with a drive.
"""

import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from afm_msgs.msg import Measurement, PiezoDrive
from machine import running
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node

from afm_model.compiled.records import size
from afm_model.parts import signals
from afm_node_common import topics
from afm_node_common.cdr import measurement_codec
from afm_node_common.drive_codec import drive_codec

_NAMESPACE = "bench"


class End:
    """One end of the ping-pong: publishes one type, takes the other, directly from the handles."""

    def __init__(self, name: str, sends: type, receives: type) -> None:
        self.node = Node(name, namespace=_NAMESPACE)
        self._receives = receives
        self._publisher = self.node.create_publisher(sends, sends.__name__, topics.CONTROL_QOS)
        self._subscription = self.node.create_subscription(
            receives, receives.__name__, lambda _: None, topics.CONTROL_QOS, raw=True
        )
        self.publish = self._publisher.publish
        self._wait_set = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, self.node.context.handle)

    @property
    def matched(self) -> bool:
        return bool(self._publisher.get_subscription_count() and self._subscription.get_publisher_count())

    def take(self) -> bytes | None:
        """As a careful program takes: the handle is entered for every message."""
        handle = self._subscription.handle
        with handle:
            taken = handle.take_message(self._receives, True)
        return None if taken is None else taken[0]

    def enter(self) -> None:
        """Enter both handles once and for all."""
        handle = self._subscription.handle
        handle.__enter__()
        self._publisher.handle.__enter__()
        self.publish = self._publisher.handle.publish_raw
        receives = self._receives

        def take() -> bytes | None:
            taken = handle.take_message(receives, True)
            return None if taken is None else taken[0]

        self.take = take  # type: ignore[method-assign]

    def receive(self) -> bytes:
        """Wait for a message and take it."""
        while (data := self.take()) is None:
            self._wait_set.clear_entities()
            self._wait_set.add_subscription(self._subscription.handle)
            self._wait_set.wait(100_000_000)
        return data


def _messages() -> tuple[bytes, bytes]:
    measurement = measurement_codec().encode(0, 0, 0, np.zeros(size(signals.Measurement)))
    return measurement, drive_codec().encode(0, 0, 0, np.zeros(3))


def _wait_until_matched(*ends: End) -> None:
    limit = time.monotonic() + 30.0
    while not all(end.matched for end in ends):
        if time.monotonic() > limit:
            raise RuntimeError("the two ends of the ping-pong have not found each other")
        time.sleep(0.01)  # nobody spins here: discovery goes on in the middleware's own threads


def one_process(rounds: int = 5000, repeats: int = 7) -> dict[str, float]:
    """Round trips a second between two nodes of one process, with handles entered each time, and once for all; and the
    processor time of the former.
    """
    measurement, drive = _messages()
    a, b = End("a", Measurement, PiezoDrive), End("b", PiezoDrive, Measurement)
    _wait_until_matched(a, b)

    def rate(clock: Callable[[], float] = time.perf_counter) -> float:
        publish_a, publish_b, take_a, take_b = a.publish, b.publish, a.take, b.take
        begin = clock()
        for _ in range(rounds):
            publish_a(measurement)
            while take_b() is None:
                pass
            publish_b(drive)
            while take_a() is None:
                pass
        return rounds / (clock() - begin)

    careful = statistics.median(rate() for _ in range(repeats))
    cpu = 1.0 / statistics.median(rate(time.process_time) for _ in range(repeats))
    a.enter()
    b.enter()
    entered = statistics.median(rate() for _ in range(repeats))
    return {"per_second": careful, "cpu_s": cpu, "per_second_handles_entered_once": entered}


def two_processes(folder: Path, rounds: int = 5000, repeats: int = 5) -> dict[str, float]:
    """Round trips a second between two processes that sleep until a message comes."""
    measurement, _ = _messages()
    with running([sys.executable, __file__], log=folder / "bench.log"):
        a = End("a", Measurement, PiezoDrive)
        _wait_until_matched(a)
        rates = []
        for _ in range(repeats):
            begin = time.perf_counter()
            for _ in range(rounds):
                a.publish(measurement)
                a.receive()
            rates.append(rounds / (time.perf_counter() - begin))
    return {"per_second": statistics.median(rates)}


def measure(folder: Path, which: str) -> dict[str, Any]:
    """`which`: one_process or two_processes."""
    rclpy.init()
    try:
        return one_process() if which == "one_process" else two_processes(folder)
    finally:
        rclpy.shutdown()


def _answer() -> None:
    rclpy.init()
    b = End("b", PiezoDrive, Measurement)
    _, drive = _messages()
    try:
        while True:
            b.receive()
            b.publish(drive)
    except (KeyboardInterrupt, rclpy_implementation.RCLError):
        pass
    finally:
        b.node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    _answer()
