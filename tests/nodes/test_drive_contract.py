"""Rows of docs/drive_contract.md that need real topics: what is clipped and counted there, and two publishers."""

import numpy as np
import pytest
from afm_msgs.msg import ControlTrace, InstrumentStatus, Measurement, PiezoDrive
from hand_controller import HandController, answer
from support import Graph, Observer, ros_arguments

from afm_node_common import topics
from afm_sim_node.node import SimNode

PERIOD = 2e-6
TICKS = 60
LIMIT, SLEW = 5.0, 1e6  # [V], [V/s]: 2 V in a period


def bad(measurement: Measurement) -> list[PiezoDrive]:
    """Beyond the range and too steep, after ten ticks of neither."""
    return [answer(measurement, 0.0 if measurement.sequence < 10 else 9.0, 0.0)]


def test_drives_out_of_range_and_too_steep_are_counted_in_status_and_score_and_shown_in_the_trace() -> None:
    parameters = {
        "plant.control_period": PERIOD,
        "run.duration": TICKS * PERIOD,
        "piezo.limit": LIMIT,
        "piezo.slew_limit": SLEW,
    }
    with Graph(ros_arguments(parameters)) as graph:
        observer = graph.add(Observer())
        traces: list[ControlTrace] = []
        observer.create_subscription(ControlTrace, topics.CONTROL_TRACE, traces.append, topics.STREAM_QOS)
        graph.add(SimNode())
        graph.spin_until(lambda: observer.count_subscribers(topics.CONTROL_TRACE) and observer.statuses)
        graph.spin_until(lambda: observer.status.recorders == 0)
        graph.add(HandController(bad))
        graph.spin_until(lambda: observer.scores and sum(len(trace.deflection) for trace in traces) == TICKS)
        score = observer.scores[0]
        assert (score.drives_clipped, score.drives_steep) == (TICKS - 10, 2)
        assert (observer.status.drives_clipped, observer.status.drives_steep) == (TICKS - 10, 2)
        x = np.concatenate([trace.drive for trace in traces]).reshape(-1, 3)[:, 0]
        assert x.tolist() == pytest.approx([0.0] * 10 + [2.0, 4.0] + [LIMIT] * (TICKS - 12), abs=1e-9)


@pytest.mark.parametrize("mode", ["lockstep", "realtime"])
def test_of_two_publishers_one_answer_to_each_measurement_counts_and_both_are_named(mode: str) -> None:
    parameters = {"plant.control_period": 1e-3, "detector.sample_period": 1e-4, "run.mode": mode}
    with Graph(ros_arguments(parameters | {"run.real_time_factor": 0.2, "run.watchdog_timeout": 1000.0})) as graph:
        observer = graph.add(Observer())
        first = graph.add(HandController(lambda measurement: [answer(measurement, 0.01, 0.0)], "first"))
        second = graph.add(HandController(lambda measurement: [answer(measurement, 0.02, 0.0)], "second"))
        simulator = graph.add(SimNode())
        counts = lambda: simulator.run.snapshot().counts  # noqa: E731
        graph.spin_until(lambda: counts().drives_outdated > 50)
        graph.spin_until(lambda: "/afm/first and /afm/second publish piezo_drive" in observer.status.warning)
        assert observer.status.state == InstrumentStatus.RUNNING
        assert observer.status.controllers == ["/afm/first", "/afm/second"]
        # No more than one answer of the two makes a tick: the other one is the duplicate.
        assert counts().drives_outdated <= len(first.seen) + len(second.seen) - counts().drives_lost
        assert {0.01, 0.02} >= {float(measurement.drive.x) for measurement in first.seen[20:]}
