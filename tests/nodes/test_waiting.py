"""A look finds whatever an executor would serve, created early or late, and nothing else."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from afm_msgs.msg import PiezoDrive
from rclpy.action import ActionClient, ActionServer, GoalResponse
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger
from support import Graph, wait_until

from afm_node_common.direct import Inbox
from afm_node_common.waiting import Waiting


class Pair:
    """A node that is looked at, and its peer, which is always served."""

    def __init__(self, graph: Graph) -> None:
        self.executor = graph.executor
        self.node, self.peer = graph.add(Node("looked_at")), Node("peer")
        graph.nodes.append(self.peer)
        self.peers = SingleThreadedExecutor()
        self.peers.add_node(self.peer)
        self.waiting = Waiting([self.node])
        self.calls = 0
        self.ends: list[Callable[[], object]] = []

    def note(self, *arguments: Any) -> Any:
        """A callback of any kind."""
        self.calls += 1
        return arguments[-1] if arguments else None

    def until(self, predicate: Callable[[], object]) -> None:
        """Serve the peer, not the node, until `predicate` holds."""
        wait_until(predicate, lambda: self.calls, lambda: self.peers.spin_once(timeout_sec=0.002))

    def serve(self) -> None:
        """Serve the node until a look finds nothing."""
        while self.waiting():
            self.executor.spin_once(timeout_sec=0.0)


@pytest.fixture
def pair() -> Iterator[Pair]:
    with Graph() as graph:
        pair = Pair(graph)
        yield pair
        # What a node does not destroy with itself.
        for end in (*reversed(pair.ends), pair.peers.shutdown):
            end()


# Each makes something in the node and returns what lets it have work.


def subscription(pair: Pair) -> Callable[[], object]:
    publisher = pair.peer.create_publisher(PiezoDrive, "drives", 10)
    pair.node.create_subscription(PiezoDrive, "drives", pair.note, 10)
    pair.until(publisher.get_subscription_count)
    return lambda: publisher.publish(PiezoDrive())


def timer(pair: Pair) -> Callable[[], object]:
    def once() -> None:
        pair.note()
        pair.node.destroy_timer(made)

    made = pair.node.create_timer(0.01, once)
    made.cancel()
    return made.reset


def service(pair: Pair) -> Callable[[], object]:
    pair.node.create_service(Trigger, "service", pair.note)
    client = pair.peer.create_client(Trigger, "service")
    pair.until(client.service_is_ready)
    return lambda: client.call_async(Trigger.Request())


def client(pair: Pair) -> Callable[[], object]:
    pair.peer.create_service(Trigger, "service", lambda request, response: response)
    client = pair.node.create_client(Trigger, "service")
    pair.until(client.service_is_ready)
    return lambda: client.call_async(Trigger.Request()).add_done_callback(pair.note)


def guard_condition(pair: Pair) -> Callable[[], object]:
    guard: Any = pair.node.create_guard_condition(pair.note)
    return guard.trigger


def event(pair: Pair) -> Callable[[], object]:
    callbacks = SubscriptionEventCallbacks(matched=pair.note)
    pair.node.create_subscription(PiezoDrive, "drives", pair.note, 10, event_callbacks=callbacks)
    return lambda: pair.peer.create_publisher(PiezoDrive, "drives", 10)


def action_server(pair: Pair) -> Callable[[], object]:
    action = pytest.importorskip("test_msgs.action").Fibonacci

    def execute(goal: Any) -> Any:
        pair.note()
        goal.succeed()
        return action.Result()

    server = ActionServer(pair.node, action, "action", execute)
    client = ActionClient(pair.peer, action, "action")
    pair.ends += [server.destroy, client.destroy]
    pair.until(client.server_is_ready)
    return lambda: client.send_goal_async(action.Goal())


def action_client(pair: Pair) -> Callable[[], object]:
    action = pytest.importorskip("test_msgs.action").Fibonacci
    server = ActionServer(pair.peer, action, "action", lambda _: None, goal_callback=lambda _: GoalResponse.REJECT)
    client = ActionClient(pair.node, action, "action")
    pair.ends += [server.destroy, client.destroy]
    pair.until(client.server_is_ready)
    return lambda: client.send_goal_async(action.Goal()).add_done_callback(pair.note)


def coroutine(pair: Pair) -> Callable[[], object]:
    return lambda: pair.executor.create_task(pair.note)


MAKERS = [
    subscription,
    timer,
    service,
    client,
    guard_condition,
    event,
    action_server,
    action_client,
    coroutine,
]


@pytest.mark.parametrize("late", [False, True], ids=["there before", "created later"])
@pytest.mark.parametrize("make", MAKERS)
def test_work_is_found_until_it_is_served(pair: Pair, make: Callable[[Pair], Callable[[], object]], late: bool) -> None:
    let_it_have_work = make(pair)
    if not late:
        pair.waiting = Waiting([pair.node])
    pair.serve()
    assert pair.calls == 0
    assert not pair.waiting()
    let_it_have_work()
    pair.until(pair.waiting)
    assert pair.waiting()  # looking takes nothing away
    pair.serve()
    pair.until(lambda: pair.serve() or pair.calls)  # an answer may come in several parts
    assert pair.calls == 1


def test_what_is_destroyed_is_not_looked_at_any_more(pair: Pair) -> None:
    guard: Any = pair.node.create_guard_condition(pair.note)
    subscription = pair.node.create_subscription(PiezoDrive, "drives", pair.note, 10)
    assert not pair.waiting()
    guard.trigger()
    assert pair.waiting()
    pair.node.destroy_guard_condition(guard)
    pair.node.destroy_subscription(subscription)
    pair.serve()
    assert not pair.waiting()


def test_messages_of_an_inbox_are_left_to_who_takes_them(pair: Pair) -> None:
    inbox = Inbox(pair.node, PiezoDrive, "drives", 10)
    publisher = pair.peer.create_publisher(PiezoDrive, "drives", 10)
    pair.until(lambda: inbox.publishers)
    publisher.publish(PiezoDrive(sequence=7))
    taken = None
    while taken is None:
        assert not pair.waiting()
        inbox.wait(0.1)
        taken = inbox.take()
    inbox.close()


def test_coroutine_that_waits_is_unfinished_but_no_work(pair: Pair) -> None:
    future: Future = Future()

    async def wait() -> None:
        await future
        pair.note()

    assert not pair.waiting.unfinished
    task = pair.executor.create_task(wait)
    assert pair.waiting()
    pair.executor.spin_once(timeout_sec=0.0)
    assert not pair.waiting()
    assert pair.waiting.unfinished
    future.set_result(None)
    pair.until(lambda: pair.executor.spin_once(timeout_sec=0.0) or task.done())
    assert not pair.waiting()
    assert (pair.calls, pair.waiting.unfinished) == (1, False)
