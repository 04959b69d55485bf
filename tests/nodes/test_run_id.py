"""Every message names its run: what belongs together is found by that alone, in whatever order it comes."""

from collections import defaultdict
from itertools import pairwise
from typing import Any

from afm_msgs.msg import (
    ControlTrace,
    Event,
    InstrumentStatus,
    Measurement,
    MicroscopeStatus,
    NamedArray,
    Parameters,
    PiezoDrive,
    ScanLine,
    Score,
    Waveform,
)
from hand_controller import HandController, answer
from quick_lever import INSTRUMENT, LAW
from rclpy.parameter import Parameter
from support import Graph, Observer, ros_arguments
from verbs_bench import APPROACH, Bench

from afm_controller_node.node import ControllerNode
from afm_model.microscope.verbs import FrictionLoop, Scan
from afm_node_common import topics
from afm_sim_node.node import SimNode

KINDS = {
    topics.CONTROL_TRACE: (ControlTrace, topics.STREAM_QOS),
    topics.DEFLECTION: (Waveform, topics.STREAM_QOS),
    topics.EVENTS: (Event, topics.EVENTS_QOS),
    topics.SCAN_LINE: (ScanLine, topics.SCAN_LINE_QOS),
    topics.RESULTS: (NamedArray, topics.RESULTS_QOS),
    topics.STATUS: (InstrumentStatus, topics.EVERY_STATE_QOS),
    topics.MICROSCOPE: (MicroscopeStatus, topics.LATCHED_QOS),
    topics.PARAMETERS: (Parameters, topics.EVENTS_QOS),
    topics.SCORE: (Score, topics.LATCHED_QOS),
    topics.MEASUREMENT: (Measurement, topics.MEASUREMENT_QOS),
    topics.PIEZO_DRIVE: (PiezoDrive, topics.CONTROL_QOS),
}


class Listener:
    """All messages of some topics, sorted by the run that they name."""

    def __init__(self, node: Any, *names: str) -> None:
        self.runs: dict[int, dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))
        for name in names:
            kind, qos = KINDS[name]
            node.create_subscription(kind, name, lambda message, name=name: self._hear(name, message), qos)

    def _hear(self, name: str, message: Any) -> None:
        self.runs[message.run_id][name].append(message)

    def over(self, run_id: int) -> bool:
        """Whether all has come of a run that is over."""
        found = self.runs[run_id]
        last = [each for each in found[topics.STATUS] if each.over]
        return bool(last) and all(
            sum(map(values, found[name])) == count
            for name, values, count in (
                (topics.CONTROL_TRACE, lambda block: len(block.deflection), last[0].ticks),
                (topics.DEFLECTION, lambda block: len(block.samples), last[0].samples),
            )
        )


def test_quick_runs_each_have_their_own_blocks_lines_results_and_events_and_the_event_at_the_start() -> None:
    with Graph(ros_arguments(INSTRUMENT | LAW)) as graph:
        bench = Bench(graph)
        streams = (topics.CONTROL_TRACE, topics.DEFLECTION, topics.EVENTS, topics.SCAN_LINE, topics.RESULTS)
        listener = Listener(bench.client, *streams, topics.STATUS, topics.MICROSCOPE, topics.PARAMETERS)
        made = []
        for lines in (1, 2, 3):
            made.append(bench.simulator.run.run_id)
            bench.do(APPROACH)
            bench.do(Scan(size_x=40e-9, size_y=10e-9, pixels=8, lines=lines, line_rate=20.0, overscan=0.2, speed=5e-6))
            bench.do(FrictionLoop(length=20e-9, line_rate=20.0, count=2))
            bench.client.call(graph, topics.RESET)
        graph.spin_until(lambda: all(map(listener.over, made)))
        assert sorted(made) == made and len(set(made)) == 3
        for lines, run_id in zip((1, 2, 3), made, strict=True):
            found = listener.runs[run_id]
            assert [(line.index, line.direction) for line in found[topics.SCAN_LINE]] == [
                (index, way) for index in range(lines) for way in ("trace", "retrace")
            ]
            texts = [(event.tick, event.text) for event in found[topics.EVENTS]]
            assert texts[0] == (0, "Approach has begun")
            assert sum("Scan has begun" in text for _, text in texts) == 1
            trace = found[topics.CONTROL_TRACE]
            assert trace[0].first_sequence == 0
            assert all(a.first_sequence + len(a.deflection) == b.first_sequence for a, b in pairwise(trace))
            assert {each.name for each in found[topics.RESULTS]} >= {"lateral"}
            (known, *_) = found[topics.PARAMETERS]
            assert (known.node, known.changes) == ("/afm/afm_sim_node", False)
            assert {each.name for each in known.parameters} >= {"plant.kind", "sample.kind"}


def test_change_of_a_parameter_names_the_run_in_which_it_holds_and_the_next_run_begins_with_it() -> None:
    with Graph() as graph:
        observer, simulator, controller = graph.add(Observer()), graph.add(SimNode()), graph.add(ControllerNode())
        listener = Listener(observer, topics.PARAMETERS)
        first = simulator.run.run_id

        def alphas(run_id: int) -> list[float]:
            messages = [each for each in listener.runs[run_id][topics.PARAMETERS] if "controller" in each.node]
            return [p.value.double_value for each in messages for p in each.parameters if p.name == "law.alpha"]

        graph.spin_until(lambda: alphas(first) == [10.0])
        controller.set_parameters([Parameter("law.alpha", value=4.0)])
        graph.spin_until(lambda: alphas(first) == [10.0, 4.0])
        observer.call(graph, topics.RESET)
        graph.spin_until(lambda: alphas(simulator.run.run_id) == [4.0])
        assert alphas(first) == [10.0, 4.0]


def test_drive_for_the_run_before_is_outdated_and_one_without_a_run_counts() -> None:
    ticks = 20
    values = {"plant.control_period": 2e-6, "run.duration": ticks * 2e-6}
    with Graph(ros_arguments(values)) as graph:
        observer = graph.add(Observer())
        before: list[Measurement] = []

        def law(measurement: Measurement) -> list[PiezoDrive]:
            first = not before or measurement.run_id == before[0].run_id
            if first:
                before.append(measurement)
                return [answer(measurement, 1e-3, 0.0)]
            # As if the answer to the same tick of the run before had been on its way until now.
            late = answer(before[0], 5.0, 5.0)
            late.sequence = measurement.sequence
            unnamed = answer(measurement, 1e-3, 0.0)
            unnamed.run_id = 0
            return [late, unnamed]

        graph.add(HandController(law))
        graph.add(SimNode())
        graph.spin_until(lambda: observer.scores)
        observer.call(graph, topics.RESET)
        graph.spin_until(lambda: len(observer.scores) > 1)
        one, two = observer.scores[0], observer.scores[-1]
        assert one.run_id != two.run_id
        assert one.trajectory_sha256 == two.trajectory_sha256
        assert (one.drives_outdated, two.drives_outdated) == (0, ticks)
