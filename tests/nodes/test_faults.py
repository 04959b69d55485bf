"""Faults to order over topics: by parameters and by the service, told, recorded, and replayed to the last bit."""

import math
from pathlib import Path
from typing import Any

import pytest
from afm_msgs.msg import Event, InstrumentStatus, Measurement, PiezoDrive
from afm_msgs.srv import OrderFault
from hand_controller import HandController, answer
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger
from support import Graph, Observer, ros_arguments, write_scenario

from afm_model import simulate
from afm_model.run import Replay, recorded_parameters
from afm_node_common import topics
from afm_recorder_node.node import RecorderNode
from afm_recorder_node.reader import read_recording
from afm_sim_node.node import SimNode

PERIOD = 2e-6
TICKS = 1500
BURST = (100, 200)
"""First tick of the fault that is there from the start, and the first without it."""


class Orderer(Observer):
    """An observer that orders faults and hears of events."""

    def __init__(self) -> None:
        super().__init__()
        self.events: list[tuple[int, str]] = []
        self.levels: dict[str, int] = {}
        self.create_subscription(Event, topics.EVENTS, self._on_event, topics.EVENTS_QOS)
        self._orders = self.create_client(OrderFault, topics.ORDER_FAULT)
        self._clears = self.create_client(Trigger, topics.CLEAR_FAULTS)
        self._setter = self.create_client(SetParameters, "afm_sim_node/set_parameters")

    def _on_event(self, message: Event) -> None:
        self.events.append((message.tick, message.text))
        self.levels[message.text] = message.level

    def order(self, graph: Graph, **fields: Any) -> OrderFault.Response:
        graph.spin_until(self._orders.service_is_ready)
        return graph.result(self._orders.call_async(OrderFault.Request(**fields)))

    def clear(self, graph: Graph) -> Trigger.Response:
        graph.spin_until(self._clears.service_is_ready)
        return graph.result(self._clears.call_async(Trigger.Request()))

    def set(self, graph: Graph, name: str, value: object) -> Any:
        graph.spin_until(self._setter.service_is_ready)
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        return graph.result(self._setter.call_async(request)).results[0]


def push(measurement: Measurement) -> list[PiezoDrive]:
    """A drive that feels the faults of what is measured."""
    k = measurement.sequence
    return [answer(measurement, 0.05 * (k % 100) + math.tanh(1e8 * measurement.position.x), 0.01 * (k % 7))]


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_a_fault_ordered_on_the_way_is_told_recorded_and_replayed(mode: str, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    parameters = {
        "plant.control_period": PERIOD,
        "run.duration": TICKS * PERIOD,
        "run.mode": mode,
        "run.real_time_factor": 0.002,
        "run.watchdog_timeout": 1000.0,
        "run.wait_for_recorder": True,
        "run.start_paused": True,
        "score.start": 0.0,
        "fault.burst.kind": "noise",
        "fault.burst.signal": "position_x",
        "fault.burst.size": 1e-10,
        "fault.burst.start": BURST[0] * PERIOD,
        "fault.burst.duration": (BURST[1] - BURST[0]) * PERIOD,
    }
    records = {"path": str(path), "view": False}
    file = write_scenario(tmp_path / "run.yaml", afm_sim_node=parameters, afm_recorder_node=records)
    with Graph(["--ros-args", "--params-file", str(file)]) as graph:
        observer = graph.add(Orderer())
        recorder = graph.add(RecorderNode())
        simulator = graph.add(SimNode())
        graph.add(HandController(push))
        graph.spin_until(lambda: recorder._published)
        assert observer.call(graph, topics.PLAY).success
        graph.spin_until(lambda: simulator.run.instrument.ticks > 2 * BURST[1])
        assert observer.call(graph, topics.PAUSE).success
        tick = simulator.run.instrument.ticks
        # The one that is there may not be changed, and no order that makes no sense is taken.
        refused = observer.set(graph, "fault.burst.size", 1.0)
        assert not refused.successful and "order_fault" in refused.reason
        assert not observer.order(graph, kind="loss", signal="position_x").success
        assert not observer.order(graph, name="burst", kind="friction", size=2.0).success
        late = observer.order(graph, kind="friction", size=2.0, start=0.0)
        assert not late.success and "it must be >= " in late.message
        ordered = [
            observer.order(graph, kind="friction", size=1.2, duration=100 * PERIOD),
            observer.order(graph, kind="latency", signal="drive", size=3 * PERIOD),
            observer.order(graph, name="mine", kind="offset", signal="drive_y", size=0.2, start=(tick + 50) * PERIOD),
        ]
        assert [(each.success, each.name, each.tick) for each in ordered] == [
            (True, "ordered_1", tick + 1),
            (True, "ordered_2", tick + 1),
            (True, "mine", tick + 50),
        ]
        assert observer.call(graph, topics.PLAY).success
        graph.spin_until(lambda: simulator.run.instrument.ticks > tick + 200)
        assert observer.call(graph, topics.PAUSE).success
        graph.spin_until(lambda: observer.status.faults == ["mine", "ordered_2"])
        assert observer.clear(graph).success
        assert observer.call(graph, topics.PLAY).success
        graph.spin_until(lambda: observer.status.state == InstrumentStatus.FINISHED and observer.scores)
        score = observer.scores[0]
        assert score.faults == ["burst", "mine", "ordered_1", "ordered_2"]
        graph.spin_until(lambda: len(observer.events) == 8)
        told = dict((text, k) for k, text in observer.events)
        assert told["fault burst begins: noise of 1e-10 m on position_x"] == BURST[0]
        assert told["fault ordered_1 begins: friction of 1.2"] == tick + 1
        assert told["fault ordered_1 ends"] == tick + 101
        assert told["fault mine ends"] == told["fault ordered_2 ends"] > tick + 200
        graph.spin_until(lambda: recorder.recorder.present.has(score.ticks, score.ticks))
        if mode == "lockstep":
            # After a reset everything that was ordered, or cleared, happens again at the same ticks.
            graph.spin_until(lambda: recorder.recorder.present.scored)
            assert observer.call(graph, topics.RESET).success
            assert observer.call(graph, topics.PLAY).success
            graph.spin_until(lambda: len(observer.scores) == 2 and len(observer.events) == 16)
            again = observer.scores[1]
            assert (again.trajectory_sha256, again.faults) == (score.trajectory_sha256, score.faults)
            assert sorted(observer.events[8:]) == sorted(observer.events[:8])
        recorder.finish(lambda timeout: graph.spin())
    recordings = [path, path.with_stem("run-2")] if mode == "lockstep" else [path]
    for each in recordings:
        assert {text for _, text in read_recording(each).events} >= set(told)
    recording = read_recording(path)
    levels = dict(zip((text for _, text in recording.events), recording.event_levels, strict=True))
    for text, level in observer.levels.items():
        begins = " begins: " in text
        assert (level, levels[text]) == ((Event.WARN, "WARN") if begins else (Event.INFO, "INFO"))
    values = recorded_parameters(recording.parameters["afm_sim_node"], recording.parameter_changes)
    assert simulate(values, Replay(recording.drive)).trajectory_sha256 == score.trajectory_sha256


def test_a_simulator_without_a_schedule_takes_no_orders() -> None:
    with Graph(ros_arguments({"fault.kind": "none"})) as graph:
        observer = graph.add(Orderer())
        graph.add(SimNode())
        response = observer.order(graph, kind="friction", size=2.0)
        assert not response.success
        assert "start the simulator with fault.kind:=scheduled" in response.message
