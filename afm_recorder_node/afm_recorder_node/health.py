"""State of the recorder on the topics recorder_status and /diagnostics."""

import time
from dataclasses import asdict, dataclass

from afm_msgs.msg import RecorderStatus
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node
from std_msgs.msg import Header

from afm_node_common import topics
from afm_node_common.diagnostics import entry, stamped
from afm_node_common.stamps import stamp

from .recorder import RecordedCounts

_DIAGNOSTICS_PERIOD = 1.0
"""Wall time between two messages on /diagnostics [s]; sooner if the recorder has begun or stopped to work."""


@dataclass(frozen=True)
class Health(RecordedCounts):
    """The fields of afm_msgs/RecorderStatus, which describes them."""

    ready: bool
    messages_dropped: int
    writing: bool
    detail: str


class HealthPublisher:
    """Publishes the health of the recorder when it has changed."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._status = node.create_publisher(RecorderStatus, topics.RECORDER_STATUS, topics.LATCHED_QOS)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._published: Health | None = None
        self._diagnosed: tuple[bool, int] | None = None
        self._diagnose_at = 0.0

    def publish(self, health: Health, time_ns: int) -> None:
        """Publish `health` if it has changed; `time_ns`: last simulated time received [ns]."""
        if health != self._published:
            self._published = health
            header = Header(stamp=stamp(time_ns), frame_id=topics.FRAME)
            self._status.publish(RecorderStatus(header=header, **asdict(health)))
        now, changes = time.monotonic(), (health.writing, health.messages_dropped)
        if changes != self._diagnosed or now >= self._diagnose_at:
            self._diagnosed, self._diagnose_at = changes, now + _DIAGNOSTICS_PERIOD
            self._diagnose(health)

    def _diagnose(self, health: Health) -> None:
        level, message = DiagnosticStatus.OK, "recording" if health.ticks else "waiting for an instrument"
        if not health.writing:
            level, message = DiagnosticStatus.ERROR, health.detail
        elif health.detail or health.ticks_lost or health.samples_lost or health.ticks_unwritten or health.lines_lost:
            level, message = DiagnosticStatus.WARN, health.detail or "some of the run is missing in the recording"
        values = {key.replace("_", " "): value for key, value in asdict(health).items()}
        status = entry(f"{self._node.get_fully_qualified_name()}: recorder", level, message, values)
        self._diagnostics.publish(stamped(self._node, status))
