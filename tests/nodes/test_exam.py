"""The judge of `check_controller`, without topics: a right controller keeps every rule, a wrong one breaks its own."""

import heapq
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from numpy.typing import NDArray
from wrong_controllers import WAYS, Wrong

from afm_bringup.exam.judgement import Outcome, exit_code, judge
from afm_bringup.exam.log import Answer, Log, Phase
from afm_bringup.exam.procedure import Procedure
from afm_bringup.exam.rules import RULES, Terms
from afm_model import SimParameters, build
from afm_model.parts.signals import Measurement

DEADLINE = 0.2
LONG = 1000
"""Measurements of the long run, of 100 000."""
PERIOD = 1e-4
PARAMETERS = build(
    SimParameters,
    {
        "plant.control_period": PERIOD,
        "detector.sample_period": PERIOD,
        "piezo.limit": 40.0,
        "piezo.slew_limit": 1.0 / PERIOD,
    },
)
TERMS = Terms(PARAMETERS, DEADLINE)


class VirtualConnection:
    """Where a controller answers in virtual time."""

    def __init__(self, way: str) -> None:
        self.wrong = Wrong(way)
        self._now = 0.0
        self._numbers = count()
        self._on_the_way: list[tuple[float, int, Answer]] = []

    def now(self) -> float:
        return self._now

    def publish(self, sequence: int, measurement: NDArray[np.float64]) -> None:
        y = measurement.view(Measurement)[0]
        if self.wrong.ended:
            return
        time = self._now
        error = y.reference_position - [*y.position[:2], y.deflection]
        for each in self.wrong.answers(sequence, float(y.position[0]), error.tolist()):
            drives = [each.drive, *([[each.horizon, 0.0, 0.0]] if each.horizon else [])]
            time += each.after
            answer = Answer(
                Phase.LOCKSTEP,
                each.sequence,
                time,
                np.array(drives),
                each.frame,
                "6 bytes that are no PiezoDrive" if each.nonsense else "",
                each.sequence * PERIOD if each.stamped else 0.0,
            )
            heapq.heappush(self._on_the_way, (time, next(self._numbers), answer))

    def take(self, phase: Phase) -> Answer | None:
        if not self._on_the_way or self._on_the_way[0][0] > self._now:
            return None
        answer = heapq.heappop(self._on_the_way)[2]
        return replace(answer, phase=phase)

    def wait(self, timeout: float) -> None:
        self._now += timeout

    def problem(self) -> str:
        return "the controller ended with code 3" if self.wrong.ended else ""

    def memory(self) -> int:
        return sum(map(len, self.wrong.leaked))

    def restart(self) -> bool:
        return True


def examine(way: str) -> Log:
    log = Procedure(VirtualConnection(way), PARAMETERS, LONG).run()
    log.went = True if not log.ended else None
    return log


def broken(log: Log) -> list[str]:
    return [each.rule for each in judge(log, TERMS) if each.outcome is Outcome.BROKEN]


def test_a_right_controller_keeps_every_rule() -> None:
    log = examine("right")
    assert {each.rule: each.outcome for each in judge(log, TERMS)} == {rule.name: Outcome.KEPT for rule in RULES}
    assert exit_code(judge(log, TERMS), log) == 0
    # What was asked: some of it got lost on purpose, and the numbers began again four times.
    assert {each.phase for each in log.sent} == set(Phase) - {Phase.PAUSE}
    assert sum(each.sequence == 0 for each in log.sent) == 4
    fault = [each.sequence for each in log.sent if each.phase is Phase.FAULT]
    assert len(fault) < 100 <= fault[-1] - fault[0] + 1


@pytest.mark.parametrize("way", list(WAYS)[1:])
def test_a_controller_that_is_wrong_in_one_way_breaks_the_rule_of_it(way: str) -> None:
    log = examine(way)
    assert WAYS[way] in broken(log)
    assert exit_code(judge(log, TERMS), log) == 1
    for verdict in judge(log, TERMS):
        assert bool(verdict.reason) == (verdict.outcome is Outcome.BROKEN)


@pytest.mark.parametrize(
    "way",
    [
        *("twice", "swaps", "late", "nan", "infinite horizon", "no frame", "too far", "too steep", "nonsense"),
        *("a microvolt more", "nan late", "old integral", "leaks", "zeros", "axes swapped"),
        *("z upside down", "stamp 0", "old integral later", "noise later"),
    ],
)
def test_what_is_wrong_in_one_way_breaks_no_other_rule(way: str) -> None:
    assert broken(examine(way)) == [WAYS[way]]


def test_every_rule_is_broken_by_some_controller() -> None:
    by_topics_alone = {"connected", "restart", "end"}
    assert {rule.name for rule in RULES} == {rule for rule in WAYS.values() if rule} | by_topics_alone


@pytest.mark.parametrize(
    ("log", "rule"),
    [
        (Log(incompatible="wrong publishes piezo_drive best effort: it must be reliable"), "connected"),
        (Log(ended="the controller ended with code 1"), "alive"),
    ],
)
def test_a_controller_that_never_connects_breaks_one_rule_and_the_others_are_not_tested(log: Log, rule: str) -> None:
    outcomes = {each.rule: each.outcome for each in judge(log, TERMS)}
    assert outcomes.pop(rule) is Outcome.BROKEN
    assert {each for name, each in outcomes.items() if name not in ("connected", "alive")} == {Outcome.UNTESTED}


def test_a_controller_that_does_not_find_a_restarted_simulator_or_has_to_be_killed_breaks_these_rules() -> None:
    log = examine("right")
    log.reconnected = log.went = False
    assert broken(log) == ["restart", "end"]


def test_a_limit_that_the_instrument_does_not_have_is_not_tested() -> None:
    terms = Terms(build(SimParameters, {}), DEADLINE)
    outcomes = {each.rule: each.outcome for each in judge(examine("right"), terms)}
    assert outcomes["slew"] is Outcome.UNTESTED


WILD = ("range", "slew", "response", "end")


def test_a_motion_that_diverges_is_nothing_that_the_controller_is_blamed_for() -> None:
    log = Procedure(VirtualConnection("wild"), build(SimParameters, {}), LONG).run()
    assert {each.outcome for each in judge(log, TERMS) if each.rule not in WILD} == {Outcome.KEPT}
    assert max(np.abs(each.drives[0]).max() for each in log.answers) > 100.0
