"""Claims about the recorder's queries for parameters."""

from typing import Any

import pytest
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node
from support import Graph

from afm_node_common.subscriptions import Subscriptions
from afm_recorder_node import watch as watch_of_parameters
from afm_recorder_node.watch import ParameterWatch


class Knows:
    """What a watch says."""

    def __init__(self) -> None:
        self.known: list[dict[str, Any]] = []

    def on_known(self, name: str, values: dict[str, Any]) -> None:
        assert name == "/other/controller"
        self.known.append(values)

    def on_changed(self, *change: object) -> None:
        raise AssertionError(f"nothing has changed: {change}")


@pytest.mark.parametrize("kind", [ListParameters, GetParameters])
def test_node_whose_answer_was_lost_is_asked_again_and_one_that_has_answered_is_not(
    kind: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(watch_of_parameters, "_AGAIN", 0.2)
    with Graph() as graph:
        other = graph.add(Node("controller", namespace="/other"))
        other.declare_parameter("law.gain", 3.0)
        (service,) = (service for service in other.services if service.srv_type is kind)
        send, answers = service.send_response, list[Any]()

        def drop_the_first(response: Any, header: Any) -> None:
            answers.append(response)
            if len(answers) > 1:
                send(response, header)

        service.send_response = drop_the_first
        recorder, knows = graph.add(Node("recorder", namespace="/afm")), Knows()
        watch = ParameterWatch(recorder, Subscriptions(recorder), knows.on_known, knows.on_changed)

        def known() -> bool:
            watch.look(["/other/controller"])
            return bool(knows.known)

        graph.spin_until(known)
        assert knows.known[0]["law.gain"] == 3.0
        for _ in range(20):  # what has been asked meanwhile
            graph.spin()
        count = len(answers)
        for _ in range(50):
            watch.look(["/other/controller"])
            graph.spin()
        assert (len(answers), len(knows.known)) == (count, 1)
