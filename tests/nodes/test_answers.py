"""Claims about answers to clients that are found late: they wait for them.

Here the finding is late by order: the node looks for who listens, as it always does, and is told nobody at first. What
Fast DDS does with an answer that comes too early, to drop it, is done in its place.
"""

from collections.abc import Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from afm_msgs.action import MoveTo
from rclpy.action import ActionClient, ActionServer
from rclpy.node import Node
from std_srvs.srv import Trigger
from support import Graph

from afm_node_common import answers
from afm_node_common.answers import AnsweringServer, hold_answers, identifier_of


class Server(Node):
    """Serves a service, and finds nobody until it is told to."""

    def __init__(self) -> None:
        super().__init__("server", start_parameter_services=False)
        self.finds, self.looks, self.dropped = False, 0, 0
        self.service = self.create_service(Trigger, "service", self._serve)
        self._send = self.service.send_response
        self.service.send_response = self._drop_what_nobody_hears

    def _serve(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = True
        return response

    def _drop_what_nobody_hears(self, response: Trigger.Response, header: Any) -> None:
        if self.finds:
            self._send(response, header)
        else:
            self.dropped += 1

    def get_subscriptions_info_by_topic(self, *arguments: Any, **options: Any) -> Any:
        self.looks += 1
        found = super().get_subscriptions_info_by_topic(*arguments, **options)
        return found if self.finds else []


class Pair:
    """A server and a client of its service."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.server, self.node = graph.add(Server()), graph.add(Node("client"))
        self.client = self.node.create_client(Trigger, "service")
        graph.spin_until(self.client.service_is_ready)

    def call(self) -> Any:
        return self.client.call_async(Trigger.Request())

    def wait_for_looks(self) -> None:
        """Wait until the server has looked for its client again and again."""
        goal = self.server.looks + 4
        self.graph.spin_until(lambda: self.server.looks >= goal)


@pytest.fixture
def pair() -> Iterator[Pair]:
    with Graph() as graph:
        yield Pair(graph)


def test_answer_waits_until_its_client_is_found_and_then_comes(pair: Pair) -> None:
    hold_answers(pair.server)
    asked = [pair.call(), pair.call()]
    pair.wait_for_looks()
    assert not any(future.done() for future in asked)
    pair.server.finds = True
    assert all(pair.graph.result(future).success for future in asked)
    assert pair.server.dropped == 0
    assert list(pair.server.timers) == []


def test_without_it_the_answer_to_a_client_that_is_found_late_is_lost(pair: Pair) -> None:
    first = pair.call()
    pair.graph.spin_until(lambda: pair.server.dropped)
    pair.server.finds = True
    assert pair.graph.result(pair.call()).success
    assert not first.done()


def test_client_that_is_known_is_answered_at_once(pair: Pair) -> None:
    hold_answers(pair.server)
    pair.server.finds = True
    for _ in range(3):
        assert pair.graph.result(pair.call()).success
    assert pair.server.looks == 1


def test_answer_to_a_client_that_is_never_found_is_given_in_the_end(
    pair: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(answers, "PATIENCE", 0.0)
    hold_answers(pair.server)
    pair.call()
    pair.graph.spin_until(lambda: pair.server.dropped)
    assert list(pair.server.timers) == []


def move(goal: Any) -> MoveTo.Result:
    goal.succeed()
    return MoveTo.Result(success=True, x=goal.request.x)


def test_goal_of_a_client_that_is_never_found_is_not_taken(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(answers, "PATIENCE", 0.0)
    goals: list[Any] = []
    server = AnsweringServer(pair.server, MoveTo, "move_to", move, handle_accepted_callback=goals.append)
    client = ActionClient(pair.node, MoveTo, "move_to")
    pair.graph.spin_until(client.server_is_ready)
    client.send_goal_async(MoveTo.Goal(x=1e-9))
    pair.graph.spin_until(lambda: pair.server.looks and not list(pair.server.timers))
    pair.server.finds = True
    goal = pair.graph.result(client.send_goal_async(MoveTo.Goal(x=2e-9)))
    assert goal.accepted
    assert [goal.request.x for goal in goals] == [2e-9]
    client.destroy()
    server.destroy()


def test_goal_is_accepted_once_its_client_is_found_and_its_result_comes(pair: Pair) -> None:
    server: ActionServer = AnsweringServer(pair.server, MoveTo, "move_to", move)
    client = ActionClient(pair.node, MoveTo, "move_to")
    pair.graph.spin_until(client.server_is_ready)
    sent = client.send_goal_async(MoveTo.Goal(x=1e-9))
    pair.wait_for_looks()
    assert not sent.done()
    pair.server.finds = True
    goal = pair.graph.result(sent)
    assert goal.accepted
    assert list(server.asking) == [bytes(goal.goal_id.uuid)]
    # The server forgets whom it has found: the same for a result.
    pair.server.finds = False
    result = goal.get_result_async()
    pair.wait_for_looks()
    assert not result.done()
    pair.server.finds = True
    end = pair.graph.result(result)
    assert (end.status, end.result.x) == (GoalStatus.STATUS_SUCCEEDED, 1e-9)
    client.destroy()
    server.destroy()


class Header(int):
    """A header of a kind that rclpy does not have: after its head stands a number where an address is expected."""

    sequence_number = 5


def test_a_header_of_another_layout_has_no_client_that_is_known_and_ends_no_process(pair: Pair) -> None:
    assert identifier_of(Header(7)) == b""
    assert identifier_of(object()) == b""


def test_a_header_names_the_reader_of_answers_of_its_client(pair: Pair) -> None:
    taken: list[bytes] = []
    send = pair.server.service.send_response
    pair.server.service.send_response = lambda response, header: (
        taken.append(identifier_of(header)),
        send(response, header),
    )
    pair.server.finds = True
    pair.graph.result(pair.call())
    infos = pair.server.get_subscriptions_info_by_topic("rr/serviceReply", no_mangle=True)
    assert taken == [bytes(info.endpoint_gid)[:16] for info in infos]
