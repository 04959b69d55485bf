"""Commands, faults and silence in any order: no run gets where the table has no way, and each has a way back."""

import math

import hypothesis.strategies as st
import pytest
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from afm_model.run import TICKING, TRANSITIONS, RunState

from .hand import PERIOD, Bench

ARROWS = {(origin, target) for (origin, _), target in TRANSITIONS.items()}
VALUES: dict[str, object] = {
    "run.retract_time": 8 * PERIOD,
    "run.watchdog_timeout": 4.5 * PERIOD,
    "run.lockstep_timeout": 4.5 * PERIOD,
    "safety.travel_limit": 5e-9,
    "safety.force_limit": 40e-9,
    "safety.contact_timeout": 2 * PERIOD,
    "safety.approach_speed": 5e-9 / PERIOD,
    "safety.approach_force": 1e-6,
    "safety.settle_time": 3 * PERIOD,
    "safety.approach_timeout": 200 * PERIOD,
    "safety.unrecorded": True,
}
CRASH, AWAY = 2.0, -8.0
"""z drive above rest [V]."""


class AnyOrder(RuleBasedStateMachine):
    """A run in the hands of somebody who does anything at any time."""

    @initialize(mode=st.sampled_from(["lockstep", "realtime"]), resume=st.sampled_from([0.0, 20 * PERIOD]))
    def begin(self, mode: str, resume: float) -> None:
        self.bench = Bench(mode, 400, **VALUES, **{"safety.resume_after": resume})
        self.checked = 0

    def tick(self, drive: tuple[float, float] | None) -> None:
        bench = self.bench
        if drive is not None:
            bench.link.send(bench.ticks, drive[0], bench.rest + drive[1])
        bench.now += PERIOD
        bench.run.step()

    @rule(
        count=st.integers(1, 12),
        drive=st.sampled_from([(0.0, 0.0), (0.0, 0.0), (0.01, 0.0), (1.5, 0.0), (0.0, CRASH), (0.0, AWAY), None]),
    )
    def ticks(self, count: int, drive: tuple[float, float] | None) -> None:
        for _ in range(count):
            self.tick(drive)

    @rule(what=st.sampled_from(["nan", "nonsense", "old", "future"]))
    def bad_drive(self, what: str) -> None:
        bench = self.bench
        if what == "nonsense":
            bench.link.send_nonsense()
        else:
            ahead = {"nan": 0, "old": -1, "future": 3}[what]
            bench.link.send(bench.ticks + ahead, math.nan if what == "nan" else 0.0)
        self.tick(None)

    @rule(command=st.sampled_from(["play", "pause", "reset", "resume"]))
    def command(self, command: str) -> None:
        getattr(self.bench.run, command)()

    @rule(ticks=st.integers(-1, 6))
    def step_by(self, ticks: int) -> None:
        told = self.bench.run.step_by(ticks)
        assert told or self.bench.run.stepping

    @rule(problem=st.sampled_from(["no room on the disk", ""]))
    def recorder(self, problem: str) -> None:
        self.bench.run.tell_recorder(problem)

    @rule(rival=st.booleans())
    def second_simulator(self, rival: bool) -> None:
        if rival:
            self.bench.run.fail("another simulator publishes")

    @invariant()
    def every_change_is_one_of_the_table(self) -> None:
        states = [RunState.WAITING, *self.bench.states]
        for before, after in zip(states[self.checked :], states[self.checked + 1 :], strict=False):
            assert before == after or (before, after) in ARROWS
        self.checked = len(states) - 1
        snapshot = self.bench.run.snapshot()
        assert snapshot.state == states[-1]
        assert bool(snapshot.reason) <= bool(snapshot.detail) or snapshot.state == RunState.PAUSED
        assert (self.bench.run.deadline is None) or snapshot.state in TICKING
        assert not self.bench.run.stepping or self.bench.run.steps_left > 0

    def teardown(self) -> None:
        """Whatever happened, a person brings the run back, without a reset unless it is over."""
        if not hasattr(self, "bench"):
            return
        run = self.bench.run
        run.tell_recorder("")
        for _ in range(600):
            if run.state == RunState.RUNNING and not run.stepping:
                break
            if run.state in (RunState.FINISHED, RunState.FAULT):
                run.reset()
            if run.state in (RunState.WAITING, RunState.PAUSED):
                run.play()
            if run.state == RunState.WITHDRAWN:
                run.resume()
            self.tick((0.0, 0.0))
        assert run.state == RunState.RUNNING
        self.every_change_is_one_of_the_table()


# Each example is a whole run: a tenth of those of the profile.
AnyOrder.TestCase.settings = settings(max_examples=settings().max_examples // 10, stateful_step_count=30, deadline=None)
TestAnyOrder = pytest.mark.hypothesis(AnyOrder.TestCase)
