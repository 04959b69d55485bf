"""Claims about a controller that stands still for a while in real time: the run goes on when it answers again."""

import numpy as np
import pytest

from afm_model import Controller, changed, load_scenario
from afm_model.run import Run, RunState
from afm_model.run.link import Listeners
from afm_model.run.simulated import SimulatedLink, ticks_of_a_block
from afm_model.run.timing import VirtualClock

_LATENCY = 0.3
"""Of an answer, in control periods."""


class StoppedLink(SimulatedLink):
    """A controller that stands still from one time of the clock to another [s].

    `queue` measurements wait for it, older ones are lost; answers are late by chance, by `late` periods in the mean.
    """

    def __init__(
        self, law: Controller, clock: VirtualClock, period: float, begin: float, end: float, queue: int, late: float
    ) -> None:
        random = np.random.default_rng(1)
        super().__init__(law, clock, lambda: (_LATENCY + late * random.exponential()) * period, period)
        self._begin, self._end, self._queue = begin, end, queue
        self._waiting = list[tuple[int, np.ndarray]]()

    def publish(self, sequence: int, measurement: np.ndarray) -> None:
        """Keep it as long as nobody reads."""
        if self._begin <= self._clock() < self._end:
            self._waiting = [*self._waiting, (sequence, measurement.copy())][-self._queue :]
            return
        waiting, self._waiting = self._waiting, []
        for each in (*waiting, (sequence, measurement)):
            super().publish(*each)


@pytest.mark.parametrize(
    ("begin", "gap", "queue", "late", "within"),
    # Trust returns later after each further fallback: two of them in the second. In the last one the scanner goes many
    # waves of the sample between two measurements after the gap.
    [
        (0.615, 0.25, 10, 0.0, 0.25),
        (0.7, 0.3, 10, 0.0, 0.4),
        (0.65, 0.5, 10, 0.0, 0.25),
        (0.615, 0.25, 200, 0.6, 0.4),
    ],
)
def test_run_at_1_ms_goes_on_behind_a_gap_that_is_longer_than_its_horizon(
    begin: float, gap: float, queue: int, late: float, within: float
) -> None:
    scenario = load_scenario("realtime_1ms")
    parameters = changed(scenario.sim, {"run.duration": begin + gap + within + 0.1})
    clock, period = VirtualClock(), parameters.plant.control_period
    link = StoppedLink(Controller(scenario.controller), clock, period, begin, begin + gap, queue, late)
    run = Run(parameters, link, clock, Listeners(), block_ticks=ticks_of_a_block(parameters))
    run.step()
    largest = 0.0
    while (deadline := run.deadline) is not None:
        clock.now = deadline
        run.step()
        if clock.now > begin + gap + within:
            asked, position = run.instrument.orders.asked.position[:2], run.instrument.truth.position[:2]
            largest = max(largest, float(np.abs(position - asked).max()))
    snapshot = run.snapshot()
    assert (run.state, snapshot.counts.ticks_retracted > 0) == (RunState.FINISHED, True), snapshot.detail
    # It tracks again: the amplitude is 5 nm.
    assert largest < 0.5e-9
