"""What an instrument publishes, and when it came: the witness against which a recording is held."""

import struct
import time
from collections.abc import Callable

from afm_msgs.msg import ControlTrace, InstrumentStatus, Measurement, RecorderStatus, Score
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from afm_node_common import topics

_NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)


class Listener(Node):
    """Listens to one instrument.

    Parameters
    ----------
    namespace : str
    each : bool
        To each measurement too.
    """

    def __init__(self, namespace: str, *, each: bool) -> None:
        super().__init__("listener", namespace=namespace)
        self.status, self.recorder = InstrumentStatus(), RecorderStatus()
        self.statuses: list[tuple[float, InstrumentStatus]] = []
        self.recorded: list[tuple[float, RecorderStatus]] = []
        self.scores: list[Score] = []
        self.blocks: list[tuple[float, int, int]] = []
        """Of the present run: when each block of control ticks came, its first tick, how many."""
        self.sequence = -1
        """Of the newest measurement; -1: none has been heard."""
        self.dropped = 0
        """Measurements that the controller has dropped, as it tells on /diagnostics."""
        self.create_subscription(InstrumentStatus, topics.STATUS, self._on_status, topics.LATCHED_QOS)
        self.create_subscription(RecorderStatus, topics.RECORDER_STATUS, self._on_recorder, topics.LATCHED_QOS)
        self.create_subscription(Score, topics.SCORE, self.scores.append, topics.LATCHED_QOS)
        self.create_subscription(ControlTrace, topics.CONTROL_TRACE, self._on_trace, topics.STREAM_QOS)
        if each:
            self.create_subscription(Measurement, topics.MEASUREMENT, self._on_measurement, _NEWEST, raw=True)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 10)

    @property
    def told(self) -> str:
        """For sentences about tries that fail."""
        return f"{self.get_namespace()}: {self.status.state} {self.status.detail}; recorder: {self.recorder}"

    @property
    def rate(self) -> float:
        """Control ticks per second of wall time, by the blocks."""
        (begin, first, _), *_, (end, last, _) = self.blocks
        return (last - first) / (end - begin)

    def first_missing(self, last: int) -> float | None:
        """When the first block came that holds a tick after `last`; None if there was none."""
        return next((at for at, first, count in self.blocks if first + count - 1 > last), None)

    def when(self, holds: Callable[[InstrumentStatus], bool], since: float) -> float | None:
        """When the first status since then came for which `holds`; None if none has come."""
        return next((at for at, status in self.statuses if at >= since and holds(status)), None)

    def when_recorder(self, holds: Callable[[RecorderStatus], bool], since: float) -> float | None:
        """The same of the recorder."""
        return next((at for at, status in self.recorded if at >= since and holds(status)), None)

    def _on_status(self, message: InstrumentStatus) -> None:
        self.status = message
        self.statuses.append((time.monotonic(), message))

    def _on_recorder(self, message: RecorderStatus) -> None:
        self.recorder = message
        self.recorded.append((time.monotonic(), message))

    def _on_trace(self, message: ControlTrace) -> None:
        if message.first_sequence == 0:
            self.blocks.clear()
        self.blocks.append((time.monotonic(), message.first_sequence, len(message.deflection)))

    def _on_measurement(self, data: bytes) -> None:
        # After encapsulation, stamp, frame_id and run_id, on a multiple of 8 from the fourth byte on.
        (length,) = struct.unpack_from("<I", data, 12)
        _, self.sequence = struct.unpack_from("<QQ", data, 4 + -(-(12 + length) // 8) * 8)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name.startswith(self.get_namespace()) and status.name.endswith(": controller"):
                values = {entry.key: entry.value for entry in status.values}
                self.dropped = int(values["messages dropped"])
