"""The service of the preview over real topics: of the simulator, and of what takes its place for a controller."""

import numpy as np
from afm_msgs.srv import PreviewReference
from quick_lever import INSTRUMENT
from rclpy.node import Node
from support import Graph, ros_arguments

from afm_model import SimParameters, build, preview_reference
from afm_node_common import topics
from afm_node_common.preview_service import MOST
from afm_sim_node.node import SimNode

PARAMETERS: dict[str, object] = {"plant.control_period": 5e-5, "reference.shape_x": "triangle"}


class Client(Node):
    """Who asks."""

    def __init__(self) -> None:
        super().__init__("asks", namespace=topics.NAMESPACE)
        self._client = self.create_client(PreviewReference, topics.PREVIEW_REFERENCE)

    def ask(self, graph: Graph, **fields: int) -> PreviewReference.Response:
        graph.spin_until(self._client.service_is_ready)
        return graph.result(self._client.call_async(PreviewReference.Request(**fields)))


def assert_previews(response: PreviewReference.Response, first: int, count: int) -> None:
    """The numbers of the instrument in process, x y z of each tick behind the other."""
    expected = preview_reference(build(SimParameters, PARAMETERS), first, count)  # type: ignore[arg-type]
    assert (response.success, response.message, response.period) == (True, "", 5e-5)
    for name in ("position", "velocity", "acceleration"):
        np.testing.assert_array_equal(np.reshape(getattr(response, name), (-1, 3)), getattr(expected, name))


def test_simulator_tells_its_reference_before_it_runs_and_refuses_in_a_sentence() -> None:
    with Graph(ros_arguments(PARAMETERS)) as graph:
        graph.add(SimNode())
        client = graph.add(Client())
        assert_previews(client.ask(graph), 0, 1)
        assert_previews(client.ask(graph, first=600, count=MOST), 600, MOST)
        for fields, words in (
            (
                {"count": MOST + 1},
                f"count = {MOST + 1} is not allowed: it must be from 1 to {MOST}; ask again for more",
            ),
            ({"count": 0}, "count = 0 is not allowed: it must be from 1 to"),
            ({"first": 2**64 - 1, "count": 2**32 - 1}, "count = 4294967295 is not allowed"),
            ({"first": 2**64 - 1}, "first = 18446744073709551615 is not allowed: it must be from 0 to"),
        ):
            response = client.ask(graph, **fields)
            assert not response.success and words in response.message
            assert not response.position and response.period == 0.0


def test_simulator_that_takes_verbs_does_not_know_its_reference_ahead() -> None:
    with Graph(ros_arguments(INSTRUMENT)) as graph:
        graph.add(SimNode())
        response = graph.add(Client()).ask(graph, count=10)
        assert response.message.startswith("reference.kind = verbs is not known ahead")
        assert not response.success and not response.position
