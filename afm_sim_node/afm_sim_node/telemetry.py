"""The instrument now and then as plain numbers, so that a plot shows something at once."""

from typing import Annotated

import numpy as np
from afm_msgs.msg import Telemetry as TelemetryMessage
from rclpy.node import Node

from afm_model.compiled.records import Record, record_at, size
from afm_model.parts.signals import Measurement
from afm_model.run import Run
from afm_node_common import topics
from afm_node_common.cdr import telemetry_codec
from afm_node_common.direct import Outbox


class _Values(Record):
    """Fields of afm_msgs/Telemetry after its sequence."""

    error_x: Annotated[float, "m"]
    error_y: Annotated[float, "m"]
    error_z: Annotated[float, "m"]
    deflection: Annotated[float, "m"]
    lateral_force: Annotated[float, "N"]
    normal_force: Annotated[float, "N"]
    drive_x: Annotated[float, "V"]
    drive_y: Annotated[float, "V"]
    drive_z: Annotated[float, "V"]
    real_time_factor: float


class Telemetry:
    """Publishes afm_msgs/Telemetry while there is a subscriber.

    Parameters
    ----------
    node : Node
    run : Run

    Call `close` before the node is destroyed.
    """

    def __init__(self, node: Node, run: Run) -> None:
        self._run = run
        self._encode = telemetry_codec().encode
        self._outbox = Outbox(node, TelemetryMessage, topics.TELEMETRY, topics.CONTROL_QOS)
        self._values = np.zeros(size(_Values))
        self._named = record_at(self._values, 0, _Values)
        self._at = 0.0

    def publish_at(self, now: float, period: float) -> None:
        """Publish if `period` [s] has passed since the last time; `now` is steady wall time [s]."""
        if now < self._at or not self._outbox.subscribers:
            return
        # In step with the clock where it can be, and never in a burst.
        self._at = max(self._at + period, now + 0.5 * period)
        run, instrument, v = self._run.snapshot(), self._run.instrument, self._named
        m = record_at(instrument.measurement, 0, Measurement)
        reference = m.reference_position
        v.error_x, v.error_y = reference[0] - m.position[0], reference[1] - m.position[1]
        v.error_z = reference[2] - instrument.parameters.cantilever.a - m.deflection
        v.deflection, v.lateral_force = m.deflection, m.lateral_force
        v.normal_force = instrument.truth.normal_force
        v.drive_x, v.drive_y, v.drive_z = m.drive
        v.real_time_factor = run.real_time_factor
        self._outbox.publish(self._encode(run.run_id, run.ticks, run.stamp_ns, self._values))

    def close(self) -> None:
        """Let the node be destroyed."""
        self._outbox.close()
