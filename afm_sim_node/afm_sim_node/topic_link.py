"""The topics `measurement` and `piezo_drive` as the link of a run."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from afm_msgs.msg import Measurement, PiezoDrive
from numpy.typing import NDArray
from rclpy.node import Node

from afm_model.instrument.wire import Wire
from afm_model.run import Link
from afm_node_common import topics
from afm_node_common.cdr import measurement_codec
from afm_node_common.direct import Inbox, Outbox
from afm_node_common.drive_codec import Drive, drive_codec
from afm_node_common.process import SimNodeParameters

from .peers import Peers


class NodeLink(Link):
    """The part of a link that concerns other nodes, common to all links of a simulator node.

    Parameters
    ----------
    parameters : SimNodeParameters
    peers : Peers
    recorders : callable
        How many subscribers receive every recording stream.
    """

    def __init__(self, parameters: SimNodeParameters, peers: Peers, recorders: Callable[[], int]) -> None:
        self._recorders = recorders if parameters.run.wait_for_recorder else None
        self._peers = peers
        self.asked: Callable[[int], None] | None = None
        """asked(sequence): called when a measurement has been published."""

    def ready(self) -> bool:
        """Whether a recorder is present, if one is required."""
        if self._recorders is not None and not self._recorders():
            return False
        self._peers.look(force=True)
        return not self._peers.inactive

    @property
    def controllers(self) -> list[str]:
        """Who moves x and y: names of nodes, or which law."""
        raise NotImplementedError

    @property
    def controller(self) -> str:
        """The same in words."""
        return " and ".join(self.controllers)

    def objection(self) -> str:
        """The sentence about a second simulator."""
        return self._peers.rivalry()


class TopicLink(NodeLink):
    """Publishes measurements and takes drives, serialized, with nothing in between. The clock is `time.monotonic`.

    Parameters
    ----------
    node : Node
    parameters : SimNodeParameters
    peers : Peers
    recorders : callable
        How many subscribers receive every recording stream.

    Call `close` before the node is destroyed.
    """

    def __init__(self, node: Node, parameters: SimNodeParameters, peers: Peers, recorders: Callable[[], int]) -> None:
        super().__init__(parameters, peers, recorders)
        measurements, drives = measurement_codec(), drive_codec()
        self._inbox = Inbox(node, PiezoDrive, topics.PIEZO_DRIVE, topics.CONTROL_QOS)
        in_realtime = parameters.run.mode == "realtime"
        kept = topics.MEASUREMENT_IN_REALTIME_QOS if in_realtime else topics.MEASUREMENT_QOS
        self._outbox = Outbox(node, Measurement, topics.MEASUREMENT, kept)
        self._encode, self._publish = measurements.encode, self._outbox.publish
        self._decode, self._take = drives.decode, self._inbox.take
        direct = self._inbox.direct and self._outbox.direct
        # Messages in place go out without `publish`, which the clock follows.
        if direct and measurements.fast and drives.fast and not in_realtime and not parameters.run.clock_each_tick:
            self.wire = Wire(self._take, self._publish)
        self._period_ns = parameters.plant.control_period * 1e9
        self._clock_each_tick = parameters.run.clock_each_tick
        self._run_id = 0
        self._info: Any = None
        self.fast_path = {
            "direct takes": direct,
            "fast codec": measurements.fast and drives.fast,
        }
        """Fast ways of the control loop in use."""
        self.wait = self._inbox.wait
        """wait(timeout): sleep until a drive may be there, or for `timeout` seconds of wall time."""

    def name_run(self, run_id: int) -> None:
        """Name the run in all messages from here on."""
        self._run_id = run_id

    def publish(self, sequence: int, measurement: NDArray[np.float64]) -> None:
        """Publish a measurement, stamped with its simulated time."""
        data = self._encode(self._run_id, sequence, round(sequence * self._period_ns), measurement)
        if self.wire is not None:
            self.wire.measurement[:] = data
        self._publish(data)
        if self.asked is not None:
            self.asked(sequence)

    def take(self) -> tuple[int, Drive] | None:
        """The oldest drive not yet taken."""
        taken = self._take()
        if taken is None:
            return None
        data, self._info = taken
        return self.read(data)

    def read(self, data: bytes) -> tuple[int, Drive]:
        """A drive from its bytes, with the sequence that it answers; -1 if it answers a measurement of another run."""
        run_id, sequence, _, drive = self._decode(data)
        return (sequence if run_id in (0, self._run_id) else -1), drive

    def arrived(self) -> float:
        """Time at which the middleware received the last drive; now if it does not give one."""
        now = time.monotonic()
        try:
            waited = time.time_ns() - self._info["received_timestamp"]
        except (TypeError, KeyError):
            return now
        # The middleware uses the system's clock, which may be set at any time: then one value is wrong.
        return now - max(waited, 0) * 1e-9

    def ready(self) -> bool:
        """Whether a controller is matched both ways, and a recorder if one is required."""
        return bool(self._inbox.publishers and self._outbox.subscribers) and super().ready()

    @property
    def controllers(self) -> list[str]:
        """Full names of the nodes that publish drives."""
        return self._peers.controllers

    def cause(self) -> str:
        """Return why the controller may be silent or slow: it waits for simulated time; empty if it does not."""
        names = self._peers.on_simulated_time()
        if not names:
            return ""
        done = self._clock_each_tick
        return (
            f"{' and '.join(names)} subscribes to {self._peers.clock} (use_sim_time): its timers wait for simulated "
            f"time. {'Their' if done else 'Set run.clock_each_tick to true; their'} period must be at most "
            f"plant.control_period = {1e-9 * self._period_ns:g} s"
        )

    def close(self) -> None:
        """Let the node be destroyed; nothing can be taken or published any more."""
        self._inbox.close()
        self._outbox.close()
