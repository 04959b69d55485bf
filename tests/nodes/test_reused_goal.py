"""A client that gives two goals the same number, just when the first is forgotten, ends no node."""

from typing import Any

from action_msgs.msg import GoalInfo
from afm_msgs.action import MoveTo
from rclpy.action import ActionClient
from rclpy.node import Node
from support import Graph
from unique_identifier_msgs.msg import UUID

from afm_sim_node.verb_server import PatientServer

NUMBER = UUID()  # zeros, as a client sends that sets none


def done(goal: Any) -> MoveTo.Result:
    goal.succeed()
    return MoveTo.Result(success=True)


def test_node_goes_on_when_a_goal_was_forgotten_before_its_answer() -> None:
    with Graph() as graph:
        node = graph.add(Node("server"))
        goals: list[Any] = []
        server = PatientServer(node, MoveTo, "move_to", goals.append)
        client = ActionClient(graph.add(Node("client")), MoveTo, "move_to")
        graph.spin_until(client.server_is_ready)
        graph.result(client.send_goal_async(MoveTo.Goal(), goal_uuid=NUMBER))
        # What rclpy does of itself when the time of an earlier goal with this number is over.
        coroutine = server._execute_expire_goals([GoalInfo(goal_id=NUMBER)])
        try:
            coroutine.send(None)
        except StopIteration:
            pass
        server.answer(goals.pop(), done)
        other = graph.result(client.send_goal_async(MoveTo.Goal()))
        server.answer(goals.pop(), done)
        assert graph.result(other.get_result_async()).result.success
        client.destroy()
        server.destroy()
