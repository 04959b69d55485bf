"""What tests of verbs over topics share: an instrument that is quickly told what to do, and a client."""

from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatus
from afm_msgs.msg import MicroscopeStatus, ScanLine
from quick_lever import INSTRUMENT, LAW
from rclpy.action import ActionClient
from support import Graph, Observer

from afm_model import SimParameters, build
from afm_model.microscope.image import Image
from afm_model.microscope.local import Local
from afm_model.microscope.verb import Verb
from afm_model.microscope.verbs import Approach, Scan
from afm_node_common import topics
from afm_node_common.decoding import line_of
from afm_node_common.verb_codec import ACTIONS, action_of, goal_of
from afm_sim_node.node import SimNode

APPROACH = Approach(rate=10e-6, range=2e-6, settle=2e-3)
CHANNELS = "height, error, lateral"
SCAN = Scan(size_x=40e-9, size_y=10e-9, pixels=8, lines=2, line_rate=20.0, overscan=0.2, speed=5e-6, channels=CHANNELS)
ENDLESS = Scan(size_x=40e-9, size_y=10e-9, pixels=8, lines=8000, line_rate=20.0)


class Bench:
    """A simulator in this process, and a client."""

    def __init__(self, graph: Graph) -> None:
        self.graph = graph
        self.client = graph.add(Observer())
        self.simulator = graph.add(SimNode())
        self.lines: list[Any] = []
        self.states: list[Any] = []
        self.client.create_subscription(ScanLine, topics.SCAN_LINE, self.lines.append, topics.SCAN_LINE_QOS)
        self.client.create_subscription(MicroscopeStatus, topics.MICROSCOPE, self.states.append, topics.LATCHED_QOS)
        self.actions: dict[str, ActionClient] = {}

    @property
    def near(self) -> bool:
        """Whether the tip may touch the sample."""
        return bool(self.simulator.run.operator.state.near)

    def action(self, name: str) -> ActionClient:
        if name not in self.actions:
            self.actions[name] = ActionClient(self.client, ACTIONS[name], name)
        self.graph.spin_until(self.actions[name].server_is_ready)
        return self.actions[name]

    def ask(self, name: str, goal: Any, feedback: Callable[[Any], object] | None = None) -> Any:
        """A goal that was accepted."""
        handle = self.graph.result(self.action(name).send_goal_async(goal, feedback_callback=feedback))
        assert handle.accepted
        return handle

    def begin(self, verb: Verb, feedback: Callable[[Any], object] | None = None) -> Any:
        return self.ask(action_of(verb), goal_of(verb), feedback)

    def end(self, handle: Any) -> Any:
        return self.graph.result(handle.get_result_async())

    def do(self, verb: Verb) -> Any:
        """Result of a verb that is done."""
        told = self.end(self.begin(verb))
        assert (told.status, told.result.success) == (GoalStatus.STATUS_SUCCEEDED, True), told.result.message
        return told.result

    def approach(self) -> None:
        if not self.near:
            self.do(APPROACH)

    def call(self, kind: Any, name: str, **request: Any) -> Any:
        client = self.client.create_client(kind, name)
        self.graph.spin_until(client.service_is_ready)
        response = self.graph.result(client.call_async(kind.Request(**request)))
        self.client.destroy_client(client)
        return response

    def image(self, scan: Scan, number: int) -> Image:
        """What the lines of a scan come to."""
        self.graph.spin_until(lambda: len([line for line in self.lines if line.scan == number]) == 2 * scan.lines)
        lines = [line for line in self.lines if line.scan == number]
        image = Image.empty(scan, dict(zip(lines[0].channels, lines[0].units, strict=True)))
        for line in lines:
            image.put(line_of(line))
            assert line.row == image.row(line.index)
        return image


def scan_in_process() -> tuple[Image, str]:
    """The image of SCAN in process, and the trajectory up to its end."""
    parameters = build(SimParameters, INSTRUMENT | LAW)
    assert parameters.controller_inside is not None
    local = Local(parameters, parameters.controller_inside, hashed=True)
    local.execute(APPROACH)
    image = local.execute(SCAN).result
    return image, local.instrument.trajectory_sha256()


def assert_same(image: Image, other: Image) -> None:
    assert image.data.keys() == other.data.keys()
    for key, values in image.data.items():
        assert values.tobytes() == other.data[key].tobytes(), key
