"""Answers to requests, held back until their client can hear them.

A service is two topics, one for requests and one for answers. The middleware finds the ends of each separately, on a
busy machine now and then seconds apart: a request may come before the client's reader of answers is known here. Fast
DDS then stands still for 100 ms, with the node, and drops the answer: the client waits for ever.
"""

import os
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from rclpy.action import ActionServer
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from rclpy.utilities import get_rmw_implementation_identifier

from .barrier import sentence

PATIENCE = 20.0
"""Wall time after which a client that is not found counts as gone [s]; Fast DDS takes as long to miss one."""
_FIRST_LOOK, _LOOK_PERIOD = 0.02, 0.5
"""Wall time to the first look for clients that are not known yet, and the longest between two [s]: each time twice as
long, since looks take processor time from the middleware, which is to find them."""
_READER = 0x04
"""Bit in the last byte of an identifier of DDS: it is that of a reader."""


def identifier_of(header: Any) -> bytes:
    """Return the identifier of the client that has sent a request: with Fast DDS that of its reader of answers.

    rclpy passes the rmw_request_id_t on but shows its sequence number only: the identifier stands before that. It is
    read as a file of this process, so that the header of an rclpy with another layout gives no bytes and no crash.
    Empty: not known; answers are then given at once.
    """
    header = getattr(header, "request_id", header)
    at, word = object.__basicsize__, struct.calcsize("P")
    if type(header).__basicsize__ < at + word:
        return b""
    try:
        memory = os.open("/proc/self/mem", os.O_RDONLY | os.O_CLOEXEC)
    except OSError:
        return b""
    try:
        (request,) = struct.unpack("P", os.pread(memory, word, id(header) + at))
        identifier, sequence = struct.unpack("16sq", os.pread(memory, 24, request))
    except (OSError, OverflowError, struct.error):  # no memory of this process
        return b""
    finally:
        os.close(memory)
    return identifier if sequence == getattr(header, "sequence_number", None) and any(identifier) else b""


@dataclass
class _Late:
    """An answer that waits for its client."""

    service: str
    reader: bytes
    then: Callable[[bool], object]
    until: float


class Answers:
    """Gives answers when their clients hear them.

    Parameters
    ----------
    node : Node
        It serves the services.
    """

    def __init__(self, node: Node) -> None:
        self._node = node
        # Another middleware has identifiers of its own.
        self._tells = get_rmw_implementation_identifier().startswith("rmw_fastrtps")
        self._known: dict[str, set[bytes]] = {}
        self._late: list[_Late] = []
        self._timer: Any = None

    def when_heard(self, service: str, header: Any, then: Callable[[bool], object]) -> None:
        """Call `then(True)` as soon as the client of a request hears the answers of `service` (full name).

        `then(False)` where it is not found within PATIENCE.
        """
        reader = identifier_of(header)
        if not self._tells or not reader or not reader[15] & _READER or reader in self._known.get(service, ()):
            then(True)
            return
        self._find(service)
        if reader in self._known[service]:
            then(True)
            return
        self._late.append(_Late(service, reader, then, time.monotonic() + PATIENCE))
        if self._timer is None:
            # Neither simulated time that stands still nor a callback that waits may stop it.
            clock, group = Clock(clock_type=ClockType.STEADY_TIME), ReentrantCallbackGroup()
            self._timer = self._node.create_timer(_FIRST_LOOK, self._look, callback_group=group, clock=clock)

    async def heard(self, service: str, header: Any) -> bool:
        """Wait until the client of a request hears the answers of `service`; False if it is not found."""
        future = Future()
        self.when_heard(service, header, future.set_result)
        return bool(await future)

    def _find(self, service: str) -> None:
        """See who hears the answers of a service."""
        infos = self._node.get_subscriptions_info_by_topic(f"rr{service}Reply", no_mangle=True)
        self._known[service] = {bytes(info.endpoint_gid)[:16] for info in infos}

    def _look(self) -> None:
        """See who is known by now."""
        late, self._late = self._late, []
        for service in {one.service for one in late}:
            self._find(service)
        for one in late:
            heard = one.reader in self._known[one.service]
            if not heard and time.monotonic() < one.until:
                self._late.append(one)
                continue
            try:
                one.then(heard)
            except Exception as error:
                self._node.get_logger().warning(f"{one.service} was not answered: {sentence(error)}")
        if not self._late:
            self._node.destroy_timer(self._timer)
            self._timer = None
        else:
            self._timer.timer_period_ns = min(2 * self._timer.timer_period_ns, int(_LOOK_PERIOD * 1e9))


def hold_answers(node: Node) -> None:
    """Have every service that `node` has now answer when its client hears it."""
    answers = Answers(node)

    def hold(send: Callable[[Any, Any], None], name: str, response: Any, header: Any) -> None:
        def then(heard: bool) -> None:
            # To a client that is not found, too: the middleware tells of an answer that it drops.
            send(response, header)

        answers.when_heard(name, header, then)

    services: list[Any] = list(node.services)
    for service in services:
        service.send_response = partial(hold, service.send_response, service.service_name)


class AnsweringServer(ActionServer):
    """An action server that takes a goal, and sends its result, when the client hears the answer.

    That of rclpy forgets a goal whose client did not hear that it was accepted, and the client waits for ever. A goal
    whose client is not found is not taken. To cancel one nobody has to wait.
    """

    def __init__(self, node: Node, kind: Any, name: str, *arguments: Any, **options: Any) -> None:
        # Requests may come as soon as there is a server.
        self._answers = Answers(node)
        self._services = {
            part: node.resolve_service_name(f"{name}/_action/{part}") for part in ("send_goal", "get_result")
        }
        self.asking: dict[bytes, bytes] = {}
        """The goal that is being accepted, and the identifier of the client that asks for it."""
        super().__init__(node, kind, name, *arguments, **options)

    async def _execute_goal_request(self, request_header_and_message: Any) -> None:
        header, request = request_header_and_message
        service = self._services["send_goal"]
        if not await self._answers.heard(service, header):
            self._node.get_logger().warning(f"a goal was not taken: its client does not hear the answers of {service}")
            return
        self.asking = {bytes(request.goal_id.uuid): identifier_of(header)}
        await super()._execute_goal_request(request_header_and_message)

    async def _execute_get_result_request(self, request_header_and_message: Any) -> None:
        await self._answers.heard(self._services["get_result"], request_header_and_message[0])
        await super()._execute_get_result_request(request_header_and_message)
