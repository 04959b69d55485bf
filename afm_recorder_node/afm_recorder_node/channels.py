"""Finds the waveforms of an instrument: the four that there always are, and whatever else is published."""

from collections.abc import Callable

from afm_msgs.msg import Waveform
from rclpy.node import Node
from rclpy.subscription import Subscription

from afm_node_common import topics
from afm_node_common.subscriptions import Subscriptions

from . import checks, layout
from .layout import Signal

_TYPE = "afm_msgs/msg/Waveform"


class Channels:
    """Listens to every topic of type Waveform in the node's namespace.

    Parameters
    ----------
    node : Node
    subscriptions : Subscriptions
    take : callable
        Called with the signal and each message that makes sense.
    found : callable
        Called with the signal of a channel beyond `layout.CHANNELS` before its first message.
    """

    def __init__(
        self,
        node: Node,
        subscriptions: Subscriptions,
        take: Callable[[Signal, Waveform], None],
        found: Callable[[Signal], None],
    ) -> None:
        self._node = node
        self._subscriptions = subscriptions
        self._take = take
        self._found = found
        self._signals: dict[str, Signal] = {signal.name: signal for signal in layout.CHANNELS}
        self._refused: set[str] = set()
        self.subscriptions: dict[str, Subscription] = {}
        """By name of the channel."""
        for name in self._signals:
            self._listen(name)

    def look(self) -> None:
        """Listen to what has appeared since the last look; to be called from time to time."""
        namespace = f"{self._node.get_namespace().rstrip('/')}/"
        for topic, types in self._node.get_topic_names_and_types():
            name = topic.removeprefix(namespace)
            if _TYPE not in types or name == topic or name in self.subscriptions or name in self._refused:
                continue
            if layout.further([f"/{name}"]):
                self._listen(name)
            else:
                self._refused.add(name)
                self._node.get_logger().warning(f"{topic} is not recorded: a recording holds something else there")

    def _listen(self, name: str) -> None:
        def take(message: Waveform) -> None:
            signal = self._signals.get(name)
            checks.waveform(message, signal.si_unit if signal else None)
            if signal is None:
                signal = self._signals[name] = layout.signal(name, message.unit)
                self._found(signal)
            self._take(signal, message)

        self.subscriptions[name] = self._subscriptions.subscribe(Waveform, name, take, topics.STREAM_QOS)
