"""The controller node: answers every measurement with a piezo drive, by one of the paper's laws."""

import time

import numpy as np
from afm_msgs.msg import Measurement, PiezoDrive
from rclpy.node import Node

from afm_model import Controller, flatten
from afm_model.compiled.records import size
from afm_model.core.errors import MalformedError
from afm_model.law import SampledLaw
from afm_model.parts import signals
from afm_node_common import runner, topics
from afm_node_common.cdr import measurement_codec
from afm_node_common.decoding import NANOSECONDS
from afm_node_common.direct import Inbox, Outbox
from afm_node_common.drive_codec import drive_codec
from afm_node_common.estimates import Estimates
from afm_node_common.parameter_log import ParameterLog
from afm_node_common.parameters import Declared
from afm_node_common.periodic_tasks import PeriodicTask, PeriodicTasks
from afm_node_common.presence import Presence
from afm_node_common.process import ControllerNodeParameters
from afm_node_common.subscriptions import DroppedMessages

from .diagnostics import Diagnostics
from .reply import Reply

TUNABLE = ("law.",)
"""What may change while the controller runs: the law and its gains."""

_ESTIMATES = 0.2
"""Wall time between two messages of each estimate [s]."""
_LAST_NS = 2**31 * NANOSECONDS - 1
_PERIOD = 1.0
"""Wall time between two checks of the simulator, and between two entries on /diagnostics [s]."""


class ControllerNode(Node):
    """A control law on topics. `step` and `wait` are called by `afm_node_common.runner`."""

    def __init__(self) -> None:
        super().__init__("afm_controller_node", namespace=topics.NAMESPACE)
        declared = Declared(
            self, ControllerNodeParameters, tunable=TUNABLE, accepts=Controller, on_change=self._on_change
        )
        parameters = declared.current
        self.process = parameters.process
        self._controller = Controller(parameters)
        # Compile or load the law before any measurement can come.
        self._controller.answer(np.zeros(size(signals.Measurement)))
        self._reply = Reply(self._controller)
        self._controller.reset()
        self._remark = ""
        self._period = 0.0  # control period, once measurements have given it [s]
        measurements, drives = measurement_codec(), drive_codec()
        self._decode, self._encode = measurements.decode, drives.encode
        self._inbox = Inbox(self, Measurement, topics.MEASUREMENT, topics.CONTROL_QOS)
        self._outbox = Outbox(self, PiezoDrive, topics.PIEZO_DRIVE, topics.CONTROL_QOS)
        self.drops = DroppedMessages(self)
        """Measurements that could not be read."""
        self._presence = Presence(self)
        self._diagnostics = Diagnostics(self)
        self.estimates = Estimates(self, lambda: self._controller.estimates)
        """What the law believes, on topics."""
        self._parameter_log = ParameterLog(self, declared, self._now)
        self._tasks = PeriodicTasks(
            PeriodicTask(self._parameter_log.look, _ESTIMATES),
            PeriodicTask(self.estimates.publish, _ESTIMATES),
            PeriodicTask(self._presence.look, _PERIOD),
            PeriodicTask(self._publish_diagnostics, _PERIOD),
        )
        self._take, self._publish = self._inbox.take, self._outbox.publish
        self._quick = measurements.fast and drives.fast and self._outbox.direct
        self._log_law(parameters)

    def step(self) -> bool:
        """Answer one measurement if there is one.

        One that comes again (the simulator repeats what was not answered in time) gets the same answer: a law with a
        state takes a step for each measurement, not for each message. Another run_id begins another run, and so does a
        lower sequence. What cannot be read is dropped: the law does not see it.
        """
        take, reply, publish = self._take, self._reply, self._publish
        taken = take()
        if taken is None:
            return False
        if self._quick and self._period and reply.answer(taken[0]):
            publish(reply.drive)
        else:
            self._answer(taken[0])
        if self.estimates.wanted and self._period:
            self.estimates.look(reply.run_id, reply.answered, self._period)
        return True

    def _answer(self, data: bytes) -> None:
        """Answer a message of any layout; with the last answer if it is not new."""
        try:
            run_id, sequence, stamp_ns, measurement = self._decode(data)
        except MalformedError as error:
            self.drops.add(topics.MEASUREMENT, str(error))
            return
        if not self._period and sequence > 0:
            self._period = stamp_ns * 1e-9 / sequence
            self._check_period()
        controller, reply = self._controller, self._reply
        begins = run_id != reply.run_id or sequence < reply.answered
        if begins:
            controller.reset()
            reply.begin(run_id)
        if sequence != reply.answered:
            controller.answer(measurement, stamp_ns * 1e-9)
            reply.note(sequence)
        self._publish(self._encode(run_id, sequence, stamp_ns, controller.given()))
        if begins:  # also where the run is over before the next periodic look
            self._parameter_log.look()

    def wait(self, timeout: float) -> None:
        """Sleep until a measurement may be there, or for `timeout` seconds of wall time."""
        self._inbox.wait(timeout)

    def serve_periodic(self) -> None:
        """Check the simulator, or publish diagnostics; no tick waits for both."""
        self._tasks.run_next(time.monotonic())

    def destroy_node(self) -> None:
        """End the node."""
        self.estimates.publish()
        self._parameter_log.look()
        self._presence.close()
        self._inbox.close()
        self._outbox.close()
        super().destroy_node()

    def _now(self) -> tuple[int, int]:
        """Run and simulated time [ns] of the last answer."""
        # Whatever a measurement says: a stamp ends after 68 years.
        return self._reply.run_id, min(round(max(self._reply.answered, 0) * self._period * NANOSECONDS), _LAST_NS)

    def _check_period(self) -> None:
        """Warn of a law that is made for another control period than that in which measurements are taken."""
        law, period = self._controller.parameters.law, self._period
        if period and isinstance(law, SampledLaw) and law.made_for_another(period):
            self.get_logger().warning(
                f"the law is made for another rate: law.period = {law.period:g} s, and a measurement is taken every "
                f"{period:g} s"
            )

    def _on_change(self, parameters: ControllerNodeParameters) -> None:
        self._controller.parameters = parameters
        self._log_law(parameters)
        self._check_period()

    def _publish_diagnostics(self) -> None:
        law = self._controller.parameters.law.kind
        remark = self._controller.remark
        if remark != self._remark:
            self._remark = remark
            self.get_logger().warning(f"law {law}: {remark or 'begins again'}")
        last = self.drops.last
        self._diagnostics.publish(law, self._reply.answers, self.drops.count, self._presence.problem, last, remark)

    def _log_law(self, parameters: ControllerNodeParameters) -> None:
        kind, *others = flatten(parameters.law).items()
        gains = ", ".join(f"{name} = {value}" for name, value in others)
        self.get_logger().info(f"law: {kind[1]} ({gains})")


def main() -> int:
    """Entry point of `ros2 run afm_controller_node afm_controller_node`."""
    return runner.run(ControllerNode, ControllerNodeParameters)
