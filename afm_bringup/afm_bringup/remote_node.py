"""A node that talks to a microscope on topics: finds it, serves callbacks while it waits, notices when it has ended."""

import itertools
import os
import time
import warnings
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from afm_msgs.msg import MicroscopeStatus
from rclpy import init
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from afm_model.core.errors import ParameterError, VerbError
from afm_node_common import topics
from afm_node_common.shared_memory import shared_memory_cleanup
from afm_node_common.verb_codec import ACTIONS

PATIENCE = 10.0
"""Wall time in which a microscope is found, and in which it answers a setting [s]."""
GONE = 5.0
"""Wall time without its action server after which a microscope has ended [s]."""
_NUMBERS = itertools.count()
"""Of the clients of this process: their nodes have different names."""
SETTLED = 1.0
"""Wall time in which it says how it stands after a verb or a setting [s]."""


class RemoteNode:
    """Connection to a microscope, with a separate context and executor. To be used by one thread.

    Its parameters, and what it raises, are those of `Remote`.
    """

    def __init__(self, namespace: str, patience: float, check: Callable[[], object]) -> None:
        self._check = check
        self._context = Context()
        # Ctrl-C is Python's: it cancels the verb, and the tip is withdrawn before this process ends.
        init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        number = next(_NUMBERS)
        name = f"microscope_client_{os.getpid()}{f'_{number}' if number else ''}"
        self.node = Node(name, namespace=namespace, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._actions: dict[str, ActionClient] = {}
        self._services: dict[str, Any] = {}
        self.status = MicroscopeStatus()
        """As it was received last."""
        self.news = 0
        """How many times it was."""
        self.node.create_subscription(MicroscopeStatus, topics.MICROSCOPE, self._on_status, topics.LATCHED_QOS)
        try:
            if not self.spin_until(lambda: self.news > 0, patience):
                domain = os.environ.get("ROS_DOMAIN_ID") or 0
                raise VerbError(
                    f"there is no microscope on /{namespace.strip('/')} in ROS domain {domain}: "
                    "start a simulator with reference.kind = verbs, or give its namespace and ROS_DOMAIN_ID"
                )
        except BaseException:
            self.destroy()
            raise

    @property
    def open(self) -> bool:
        """Whether it has not been destroyed."""
        return bool(self._context.ok())

    @property
    def time(self) -> float:
        """Simulated time last heard of [s]."""
        stamp = self.status.header.stamp
        return float(stamp.sec + stamp.nanosec * 1e-9)

    def _on_status(self, message: MicroscopeStatus) -> None:
        self.status = message
        self.news += 1

    def spin_until(self, predicate: Callable[[], bool], timeout: float) -> bool:
        """Serve callbacks until `predicate` holds; False if it does not within `timeout` of wall time [s]."""
        limit = time.monotonic() + timeout
        while True:
            self._executor.spin_once(timeout_sec=min(max(limit - time.monotonic(), 0.0), 0.05))
            self._check()
            if predicate():
                return True
            if time.monotonic() >= limit:
                return False

    def wait(self, predicate: Callable[[], bool], name: str, there: Callable[[], bool]) -> None:
        """Serve callbacks until `predicate` holds; VerbError if the microscope is no longer there."""
        seen = time.monotonic()
        while not self.spin_until(predicate, 0.2):
            now = time.monotonic()
            if there():
                seen = now
            elif now > seen + GONE:
                raise VerbError(f"the microscope has ended while {name} was being done")

    def _publishers(self) -> set[bytes]:
        """Return which microscopes there are: one that was started again is another one."""
        infos = self.node.get_publishers_info_by_topic(self.node.resolve_topic_name(topics.MICROSCOPE))
        return {bytes(info.endpoint_gid) for info in infos}

    def presence(self, ready: Callable[[], bool]) -> Callable[[], bool]:
        """Return a function: whether the present microscope is still there, and `ready`."""
        now = self._publishers()
        return lambda: ready() and not (now and now.isdisjoint(self._publishers()))

    def action(self, name: str) -> ActionClient:
        """Client of an action, once it is served."""
        if name not in self._actions:
            self._actions[name] = ActionClient(self.node, ACTIONS[name], name)
        self._require(self._actions[name].server_is_ready, name)
        return self._actions[name]

    def _require(self, ready: Callable[[], bool], name: str) -> None:
        if not self.spin_until(ready, PATIENCE):
            raise VerbError(f"the microscope does not serve {name} (waited {PATIENCE:g} s)")

    def call(self, kind: Any, topic: str, **values: Any) -> None:
        """Call a service that changes something, and wait for news of it; raises as `ask`."""
        news = self.news
        self.ask(kind, topic, **values)
        self.spin_until(lambda: self.news > news, SETTLED)

    def ask(self, kind: Any, topic: str, **values: Any) -> Any:
        """Call a service and wait for its answer; ParameterError with its message if that is no."""
        if topic not in self._services:
            self._services[topic] = self.node.create_client(kind, topic)
        client = self._services[topic]
        self._require(client.service_is_ready, topic)
        there = self.presence(client.service_is_ready)
        answered = client.call_async(kind.Request(**values))
        # Another sample or probe: what is compiled for it may take a while.
        while not self.spin_until(answered.done, PATIENCE):
            if not there():
                raise VerbError(f"the microscope has ended without an answer to {topic}")
        message = answered.result().message
        if not answered.result().success:
            raise ParameterError(message)
        if message:
            warnings.warn(message, stacklevel=5)
        return answered.result()

    def settle(self, news: int, timeout: float = SETTLED) -> None:
        """Wait until the microscope has said that it does nothing any more."""
        self.spin_until(lambda: self.news > news and not self.status.doing, timeout)

    def abandon(self, goal: Any, over: Callable[[], bool], timeout: float) -> None:
        """Cancel a verb and wait until it is `over`, or the microscope has reported nothing new for `timeout` [s]."""
        goal.cancel_goal_async()
        news = self.news

        def heard() -> bool:
            return over() or self.news > news

        # What has brought the verb to this end counts, not what comes of it.
        with suppress(Exception):
            while self.spin_until(heard, timeout) and not over():
                news = self.news

    def destroy(self) -> None:
        """End it."""
        with shared_memory_cleanup():
            self._executor.shutdown()
            for client in self._actions.values():
                client.destroy()
            self.node.destroy_node()
            self._context.try_shutdown()
