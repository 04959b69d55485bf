"""The run is held while nothing is recorded (safety.unrecorded)."""

from afm_msgs.msg import RecorderStatus
from rclpy.node import Node

from afm_model.run import Run
from afm_node_common import topics
from afm_node_common.subscriptions import Subscriptions

from .streams import Streams


class RecorderWatch:
    """Reports to a run whether it is recorded.

    Parameters
    ----------
    node : Node
    run : Run
    streams : Streams
    """

    def __init__(self, node: Node, run: Run, streams: Streams) -> None:
        self._run, self._streams = run, streams
        self._problem = ""
        Subscriptions(node).subscribe(RecorderStatus, topics.RECORDER_STATUS, self._on_status, topics.LATCHED_QOS)

    def _on_status(self, status: RecorderStatus) -> None:
        self._problem = "" if status.writing else status.detail or "the recorder cannot write"

    def look(self) -> None:
        """Hold the run, or let it go on."""
        nobody = "" if self._streams.subscribers else "no recorder receives every stream"
        self._run.tell_recorder(self._problem or nobody)
