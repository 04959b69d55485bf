"""The controller as DiagnosticStatus, for ordinary tools."""

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

from afm_node_common.diagnostics import entry, stamped


class Diagnostics:
    """Publishes how the controller is."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._answers = self._dropped = 0

    def publish(self, law: str, answers: int, dropped: int, problem: str, last_dropped: str, remark: str) -> None:
        """Publish the entry.

        Parameters
        ----------
        law : str
            Present law.
        answers, dropped : int
            Measurements answered, and messages that could not be read, since the start.
        problem : str
            What is wrong with the simulator; empty: nothing.
        last_dropped : str
            Message about the last message dropped.
        remark : str
            What the law has to say of itself; empty: nothing.
        """
        level, message = DiagnosticStatus.OK, "answering" if answers > self._answers else "waiting for measurements"
        if problem:
            level, message = DiagnosticStatus.ERROR, problem
        elif dropped > self._dropped:
            level, message = DiagnosticStatus.WARN, last_dropped
        elif remark:
            level, message = DiagnosticStatus.WARN, remark
        self._answers, self._dropped = answers, dropped
        values = {"law": law, "measurements answered": answers, "messages dropped": dropped}
        status = entry(f"{self._node.get_fully_qualified_name()}: controller", level, message, values)
        self._publisher.publish(stamped(self._node, status))
