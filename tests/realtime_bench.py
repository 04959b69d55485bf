"""A simulator that is paced by the clock, and what speaks with it, for tests of real time."""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from afm_msgs.msg import ControlTrace, InstrumentStatus, Measurement, PiezoDrive
from hand_controller import HandController, answer
from support import Graph, Observer, ros_arguments

from afm_model.run import Counts
from afm_node_common import topics
from afm_sim_node.node import SimNode

PERIOD = 1e-3
LONG = 1000.0
"""A watchdog that never barks [s]."""


class Bench:
    """A simulator paced by the clock, a hand-made controller, and the control trace."""

    def __init__(self, graph: Graph, law: Callable[[Measurement], Sequence[PiezoDrive]]) -> None:
        self.graph = graph
        self.observer = graph.add(Observer())
        self.traces: list[ControlTrace] = []
        self.observer.create_subscription(ControlTrace, topics.CONTROL_TRACE, self.traces.append, topics.STREAM_QOS)
        self.controller = graph.add(HandController(law))
        self.simulator = graph.add(SimNode())

    @property
    def drives(self) -> np.ndarray:
        """Drives applied [V], (n, 3), as far as the trace has come."""
        return np.concatenate([np.zeros(0), *(trace.drive for trace in self.traces)]).reshape(-1, 3)

    @property
    def last_z(self) -> float:
        """Drive z applied last [V], as far as the trace has come; NaN before."""
        return float(self.drives[-1, 2]) if self.traces else math.nan

    @property
    def round_trips(self) -> np.ndarray:
        return np.concatenate([np.zeros(0), *(trace.round_trip for trace in self.traces)])

    @property
    def counts(self) -> Counts:
        return self.simulator.run.snapshot().counts

    def run_until(self, state: int) -> InstrumentStatus:
        self.graph.spin_until(lambda: self.observer.status.state == state)
        return self.observer.status

    def run_to_the_end(self) -> InstrumentStatus:
        self.graph.spin_until(lambda: self.observer.scores)
        status = self.run_until(InstrumentStatus.FINISHED)
        self.graph.spin_until(lambda: len(self.drives) == status.ticks)
        return status


@contextmanager
def bench(
    law: Callable[[Measurement], Sequence[PiezoDrive]],
    *,
    ticks: int = 0,
    factor: float = 0.2,
    watchdog: float = LONG,
    score_start: float = 0.0,
    sample_period: float = 1e-4,
) -> Iterator[Bench]:
    parameters = {
        "plant.control_period": PERIOD,
        "detector.sample_period": sample_period,
        "run.mode": "realtime",
        "run.duration": ticks * PERIOD,
        "run.real_time_factor": factor,
        "run.watchdog_timeout": watchdog,
        "score.start": score_start,
    }
    with Graph(ros_arguments(parameters)) as graph:
        yield Bench(graph, law)


def gentle(measurement: Measurement) -> list[PiezoDrive]:
    return [answer(measurement, 1e-3 * (measurement.sequence % 5), 0.0)]
