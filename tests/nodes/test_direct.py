"""Inbox and outbox pass every message on once, in order, directly or through rclpy's ordinary ways."""

import threading
import time
from collections.abc import Iterator

import pytest
from afm_msgs.msg import PiezoDrive
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from support import TIMEOUT, Graph

from afm_node_common import topics
from afm_node_common.direct import Inbox, Outbox


class Pair:
    """An inbox and an outbox that have found each other."""

    def __init__(self, graph: Graph) -> None:
        self.receiver, self.sender = Node("receiver"), Node("sender")
        graph.nodes += [self.receiver, self.sender]  # destroyed with the graph; served by hand in these tests
        self.inbox = Inbox(self.receiver, PiezoDrive, "drives", topics.STREAM_QOS)
        self.outbox = Outbox(self.sender, PiezoDrive, "drives", topics.STREAM_QOS)
        graph.spin_until(lambda: self.inbox.publishers == 1 and self.outbox.subscribers == 1)

    def send(self, first: int, last: int) -> None:
        for sequence in range(first, last):
            self.outbox.publish(serialize_message(PiezoDrive(sequence=sequence)))

    def receive(self, count: int) -> list[int]:
        """Sequences of the next messages, waiting for them as a node does."""
        got: list[int] = []
        limit = time.monotonic() + TIMEOUT
        while len(got) < count:
            taken = self.inbox.take()
            if taken is not None:
                got.append(deserialize_message(taken[0], PiezoDrive).sequence)
            elif time.monotonic() > limit:
                raise TimeoutError(f"{len(got)} of {count} messages in {TIMEOUT:g} s, the last: {got[-3:]}")
            else:
                self.inbox.wait(0.1)
        return got


@pytest.fixture(params=["direct", "through an executor"])
def pair(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Pair]:
    if request.param != "direct":
        # What an rclpy without a wait set of its own makes of it: a real second path.
        monkeypatch.setattr(Inbox, "_make_wait_set", staticmethod(lambda node: None))
        monkeypatch.setattr(Outbox, "_publish_raw", staticmethod(lambda handle: None))
    with Graph() as graph:
        pair = Pair(graph)
        assert pair.inbox.direct == pair.outbox.direct == (request.param == "direct")
        yield pair
        pair.inbox.close()
        pair.outbox.close()


def test_no_message_is_none(pair: Pair) -> None:
    assert pair.inbox.take() is None
    pair.inbox.wait(0.0)
    assert pair.inbox.take() is None


def test_messages_come_once_in_order_and_none_is_lost(pair: Pair) -> None:
    pair.send(0, 400)
    assert pair.receive(150) == list(range(150))
    pair.send(400, 500)
    assert pair.receive(350) == list(range(150, 500))
    assert pair.inbox.take() is None


FEW = 10
"""More often than this nothing wakes who waits: an executor does for things of its own. A wait that does not sleep is
called hundreds of times meanwhile."""


def test_wait_ends_with_a_message_and_not_with_its_timeout(pair: Pair) -> None:
    for sequence in range(10):
        # The message comes when the wait has long begun.
        sender = threading.Timer(0.1, pair.send, args=(sequence, sequence + 1))
        sender.start()
        taken, waits = None, 0
        while taken is None:
            # Longer than a test may take: one that ended with its timeout would be ended by pytest.
            pair.inbox.wait(10.0 * TIMEOUT)
            taken = pair.inbox.take()
            waits += 1
        sender.join()
        assert deserialize_message(taken[0], PiezoDrive).sequence == sequence
        assert waits <= FEW


def test_wait_without_a_message_ends_with_its_timeout(pair: Pair) -> None:
    begin, waits = time.monotonic(), 0
    while time.monotonic() < begin + 0.2:
        pair.inbox.wait(0.2)
        waits += 1
    assert waits <= FEW
    assert pair.inbox.take() is None
