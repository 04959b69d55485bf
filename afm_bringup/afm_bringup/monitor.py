"""The running instrument seen from another process: status, score, number of nodes, and the start signal."""

import time
from collections.abc import Callable, Sequence

import rclpy
from afm_msgs.msg import InstrumentStatus, RecorderStatus, Score
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_srvs.srv import Trigger

from afm_node_common import topics
from afm_node_common.senders import Senders
from afm_node_common.shared_memory import shared_memory_cleanup
from afm_node_common.subscriptions import Subscriptions


class Monitor:
    """A node that watches one instrument. Use as a context manager.

    Parameters
    ----------
    name : str
        Name of the node.
    namespace : str
        Namespace of the instrument.
    arguments : sequence of str
        Arguments of ROS; what they say of the namespace counts in place of `namespace`.
    """

    def __init__(self, name: str, namespace: str = topics.NAMESPACE, arguments: Sequence[str] = ()) -> None:
        rclpy.init(args=list(arguments), signal_handler_options=SignalHandlerOptions.NO)
        self._node = Node(name, namespace=namespace)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self.status: InstrumentStatus | None = None
        self.recorder: RecorderStatus | None = None
        self.score: Score | None = None
        subscriptions = Subscriptions(self._node)
        subscriptions.subscribe(InstrumentStatus, topics.STATUS, self._on_status, topics.LATCHED_QOS)
        subscriptions.subscribe(RecorderStatus, topics.RECORDER_STATUS, self._on_recorder, topics.LATCHED_QOS)
        subscriptions.subscribe(Score, topics.SCORE, self._on_score, topics.LATCHED_QOS)
        self._play = self._node.create_client(Trigger, topics.PLAY)
        self._controllers = Senders(self._node, topics.PIEZO_DRIVE)

    def __enter__(self) -> "Monitor":
        return self

    def __exit__(self, *_: object) -> None:
        with shared_memory_cleanup():
            self._node.destroy_node()
            rclpy.try_shutdown()

    def _on_status(self, message: InstrumentStatus) -> None:
        self.status = message

    def _on_recorder(self, message: RecorderStatus) -> None:
        self.recorder = message

    def _on_score(self, message: Score) -> None:
        self.score = message

    def spin_until(self, predicate: Callable[[], bool], timeout: float) -> bool:
        """Serve callbacks until `predicate` holds; False if it does not within `timeout` seconds of wall time."""
        limit = time.monotonic() + timeout
        while not predicate():
            left = limit - time.monotonic()
            if left <= 0.0:
                return False
            self._executor.spin_once(timeout_sec=min(left, 0.1))
        return True

    def play(self, timeout: float) -> bool:
        """Start the run; False if the simulator does not answer within `timeout`."""
        if not self.spin_until(self._play.service_is_ready, timeout):
            return False
        future = self._play.call_async(Trigger.Request())
        return self.spin_until(future.done, timeout)

    @property
    def namespace(self) -> str:
        """Full namespace of the instrument."""
        return str(self._node.get_namespace())

    @property
    def incompatible(self) -> str:
        """A sentence about a controller that the middleware does not connect, if there is one."""
        drives = self._node.get_publishers_info_by_topic(self._node.resolve_topic_name(topics.PIEZO_DRIVE))
        subscriptions = self._node.get_subscriptions_info_by_topic(self._node.resolve_topic_name(topics.MEASUREMENT))
        # Not by rclpy's own check, for which a policy that is not yet known does not match.
        for end in drives:
            if end.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT:
                return f"{_full_name(end)} publishes piezo_drive best effort: it must be reliable"
        for end in subscriptions:
            if end.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
                return f"{_full_name(end)} receives measurement transient local: it must be volatile"
        return ""

    @property
    def simulators(self) -> int:
        """How many nodes publish measurements."""
        return int(self._node.count_publishers(topics.MEASUREMENT))

    @property
    def controllers(self) -> int:
        """How many nodes publish drives; one that was killed and started again is one."""
        return self._controllers.count()

    def restarted(self) -> list[str]:
        """Names of controllers that were started again since the last call."""
        restarted, self._controllers.restarted = self._controllers.restarted, []
        return restarted

    @property
    def ready(self) -> bool:
        """Whether simulator, controller and recorder see each other, both ways."""
        status, recorder = self.status, self.recorder
        return (
            status is not None
            and recorder is not None
            and bool(status.controllers)
            and not status.detail
            and status.recorders > 0
            and recorder.ready
        )

    @property
    def missing(self) -> str:
        """What is not there yet, in words."""
        status, recorder = self.status, self.recorder
        if status is None:
            return "the simulator"
        if not status.controllers or status.detail:
            return "a controller (a node that publishes piezo_drive)" + (f"; {status.detail}" if status.detail else "")
        return "the recorder" if recorder is None or not recorder.ready or not status.recorders else "nothing"


def _full_name(end: TopicEndpointInfo) -> str:
    return f"{end.node_namespace.rstrip('/')}/{end.node_name}"
