"""A controller that was killed and started again is one controller; of another name, or alive, it is another one."""

import signal
import sys
from pathlib import Path

from support import Command, Graph, Observer, remove_shared_memory_left, wait_for_the_end_of

from afm_node_common import topics
from afm_node_common.senders import LEASE, Senders

PUBLISHER = """
import sys, rclpy
from afm_msgs.msg import PiezoDrive
rclpy.init()
node = rclpy.create_node(sys.argv[1], namespace="afm")
publisher = node.create_publisher(PiezoDrive, "piezo_drive", 10)
rclpy.spin(node)
"""


def publisher(name: str, folder: Path) -> Command:
    return Command(sys.executable, "-c", PUBLISHER, name, folder=folder)


def test_controller_that_was_killed_and_started_again_is_one_until_both_have_lived_for_a_lease(tmp_path: Path) -> None:
    now = 0.0
    with Graph() as graph:
        observer = graph.add(Observer())
        senders = Senders(observer, topics.PIEZO_DRIVE, lambda: now)

        def listed(ends: int) -> bool:
            assert senders.count() <= 1
            return observer.count_publishers(topics.PIEZO_DRIVE) == ends

        with publisher("mine", tmp_path) as first:
            first.wait_until(lambda: listed(1) and senders.count() == 1, graph)
            first.process.send_signal(signal.SIGKILL)
            first.process.wait()
            wait_for_the_end_of([first.process.pid])
        now += 1.0
        with publisher("mine", tmp_path) as again:
            again.wait_until(lambda: listed(2) and senders.restarted == ["/afm/mine"], graph)
            with publisher("other", tmp_path) as other:
                other.wait_until(lambda: senders.count() == 2, graph)
                other.interrupt()
                other.wait(graph)
            again.wait_until(lambda: senders.count() == 1, graph)
            # Whoever is still listed then has not been killed.
            now += LEASE + 1.0
            ends = observer.count_publishers(topics.PIEZO_DRIVE)
            assert senders.count() == ends
    remove_shared_memory_left()
