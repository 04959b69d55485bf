"""Connection to a controller over topics, in the place of the simulator."""

import time
from typing import Any

import numpy as np
import rclpy
from afm_msgs.msg import InstrumentStatus, Measurement, PiezoDrive
from numpy.typing import NDArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions

from afm_model import Command, DriveError, SimParameters
from afm_model.core.errors import MalformedError
from afm_model.core.run_id import next_run_id
from afm_node_common import topics
from afm_node_common.answers import hold_answers
from afm_node_common.cdr import measurement_codec
from afm_node_common.direct import Inbox, Outbox
from afm_node_common.drive_codec import Drive, drive_codec
from afm_node_common.preview_service import PreviewServer
from afm_node_common.shared_memory import shared_memory_cleanup

from ..processes import Processes
from .log import Answer, Phase

_NODE = "afm_sim_node"
_CONNECT_TIMEOUT = 30.0
"""Wall time for a controller to find a simulator [s]; the middleware takes some seconds to notice that one has gone."""
MATCHED = 0.5
"""Time for a controller to find this side, too, once this side has found it [s]; the middleware does not report it.
Until then messages get lost, or come late.
"""
_STATUS_PERIOD = 0.2
_LOOK_PERIOD = 0.05
"""Wall time after which it is asked again how long a processor was missing [s]."""
_FRESH = 0.01
"""The same where an answer has come [s]."""
_OWED = 0.1
"""Part of a wait for a processor that may be counted later: the system reports the wait only when it is over [s]."""
_SLOWEST = 0.1
"""Of wall time that counts at least, however busy the machine is."""


class TopicConnection:
    """Publishes measurements and receives drives as the simulator node does. Use as a context manager.

    Parameters
    ----------
    namespace : str
    parameters : SimParameters
    processes : Processes
        In which the controller runs.
    """

    def __init__(self, namespace: str, parameters: SimParameters, processes: Processes) -> None:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self._namespace = namespace
        self._parameters = parameters
        self._period_ns = parameters.plant.control_period * 1e9
        self._mode = parameters.run.mode
        self._processes = processes
        self.memory = processes.memory
        self._missed = self._owed = 0.0  # wall time in which a processor was missing; of that, still to be counted
        self._looked, self._waited = time.monotonic(), processes.waited()
        self._encode, self._decode = measurement_codec().encode, drive_codec().decode
        self._run_id = next_run_id()
        self._open()

    def __enter__(self) -> "TopicConnection":
        return self

    def __exit__(self, *_: object) -> None:
        with shared_memory_cleanup():
            self._close()
            rclpy.try_shutdown()

    def _open(self) -> None:
        self._node = Node(_NODE, namespace=self._namespace)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._inbox = Inbox(self._node, PiezoDrive, topics.PIEZO_DRIVE, topics.CONTROL_QOS)
        self._outbox = Outbox(self._node, Measurement, topics.MEASUREMENT, topics.MEASUREMENT_QOS)
        self._status = self._node.create_publisher(InstrumentStatus, topics.STATUS, topics.LATCHED_QOS)
        PreviewServer(self._node, self._parameters)
        hold_answers(self._node)
        self._status_at = 0.0

    def _close(self) -> None:
        self._inbox.close()
        self._outbox.close()
        self._executor.shutdown()
        self._node.destroy_node()

    def now(self, period: float = _LOOK_PERIOD) -> float:
        """Time [s] that goes slower while the controller or this process waits for a processor.

        So no deadline is missed because the machine has other work; if the system does not report how long
        a thread waited, it is wall time.
        """
        now = time.monotonic()
        if (passed := now - self._looked) > period:
            before, self._waited, self._looked = self._waited, self._processes.waited(), now
            owed = self._owed + max(self._waited - before, 0.0)
            counts = min(owed, (1.0 - _SLOWEST) * passed)
            self._missed += counts
            self._owed = min(owed - counts, _OWED)
        return now - self._missed

    def problem(self) -> str:
        """How the controller has ended before its test was over; empty if it has not."""
        return self._processes.ended() or ""

    def begin_run(self) -> None:
        """Name another run in the measurements from here on."""
        self._run_id = next_run_id()

    def publish(self, sequence: int, measurement: NDArray[np.float64]) -> None:
        """Send a measurement."""
        self._outbox.publish(self._encode(self._run_id, sequence, round(sequence * self._period_ns), measurement))

    def take(self, phase: Phase) -> Answer | None:
        """The oldest message not yet taken."""
        taken = self._inbox.take()
        if taken is None:
            return None
        data, now = taken[0], self.now(_FRESH)
        try:
            run_id, sequence, stamp, drive = self._decode(data)
        except MalformedError as error:
            return Answer(phase, -1, now, np.zeros((0, 3)), unreadable=str(error))
        period = 0.0
        if isinstance(drive, Command):
            drives, period = np.vstack([drive.voltage, drive.horizon]), drive.horizon_period
        elif isinstance(drive, DriveError):
            drives = _as_they_are(data)
        else:
            drives = np.array(drive).reshape(1, 3)
        frame = deserialize_message(data, PiezoDrive).header.frame_id
        other = run_id not in (0, self._run_id)
        return Answer(phase, sequence, now, drives, frame, stamp=1e-9 * stamp, horizon_period=period, other_run=other)

    def take_drive(self) -> tuple[int, Drive] | None:
        """Return sequence and drive of the oldest message left, as an instrument reads it; None if no message is left.

        Raises
        ------
        MalformedError
            If the bytes are no message.
        """
        taken = self._inbox.take()
        if taken is None:
            return None
        run_id, sequence, _, drive = self._decode(taken[0])
        return (sequence if run_id in (0, self._run_id) else -1), drive

    def wait(self, timeout: float) -> None:
        """Sleep until a drive may be there, or for `timeout` seconds."""
        if self.now() >= self._status_at:
            self._status_at = self.now() + _STATUS_PERIOD
            self._status.publish(InstrumentStatus(run_id=self._run_id, state=InstrumentStatus.RUNNING, mode=self._mode))
            self._executor.spin_once(timeout_sec=0.0)
        self._inbox.wait(timeout)

    def connect(self, timeout: float = _CONNECT_TIMEOUT, matched: float = 0.0) -> bool:
        """Wait until a controller is matched both ways, and then for `matched` [s]; False if none is within `timeout`,
        or it has ended.
        """
        limit = self.now() + timeout
        while not (self._inbox.publishers and self._outbox.subscribers):
            if self.now() > limit or self.problem() or self.incompatible():
                return False
            self._executor.spin_once(timeout_sec=0.02)
        limit = self.now() + matched
        while self.now() < limit:
            self._executor.spin_once(timeout_sec=0.02)
        return True

    def incompatible(self) -> str:
        """Return why the middleware does not connect the controller; empty if it does, or without a controller."""
        for end in self._node.get_publishers_info_by_topic(self._node.resolve_topic_name(topics.PIEZO_DRIVE)):
            if end.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT:
                return f"{end.node_name} publishes piezo_drive best effort: it must be reliable"
        for end in self._node.get_subscriptions_info_by_topic(self._node.resolve_topic_name(topics.MEASUREMENT)):
            if end.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
                return f"{end.node_name} receives measurement transient local: it must be volatile"
        return ""

    def missing(self) -> str:
        """Which topics have no controller, in a sentence."""
        lacks = [
            what
            for what, there in (
                ("publishes piezo_drive", self._inbox.publishers),
                ("receives measurement", self._outbox.subscribers),
            )
            if not there
        ]
        return f"no node in {self._node.get_namespace()} {' or '.join(lacks)}"

    def restart(self) -> bool:
        """End this node and begin a new one."""
        self._close()
        self._open()
        return self.connect(matched=MATCHED)


def _as_they_are(data: bytes) -> NDArray[np.float64]:
    """Drives of a message that the instrument would refuse, (1 + horizon, 3) [V]."""
    message: Any = deserialize_message(data, PiezoDrive)
    return np.array([[each.x, each.y, each.z] for each in (message.voltage, *message.horizon)])
