"""The judge of `check_controller`, without topics: a right controller keeps every rule, a wrong one breaks its own."""

import heapq
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from itertools import count
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from wrong_controllers import WAYS, Wrong

from afm_bringup.exam.judgement import RuleResult, Verdict, exit_code, judge
from afm_bringup.exam.log import Answer, Log, Phase
from afm_bringup.exam.procedure import Procedure
from afm_bringup.exam.response import responses
from afm_bringup.exam.rules import RULES, Terms
from afm_model import Command, Controller, SimParameters, build, changed, load_scenario
from afm_model.core.registry import names
from afm_model.parameters import ControllerParameters
from afm_model.parts.signals import Measurement

DEADLINE = 0.2
LONG = 1000
"""Measurements of the long run, of 100 000."""
PARAMETERS = changed(load_scenario("closed_loop_tanh").sim, {"piezo.limit": 400.0, "piezo.slew_limit": 600.0 / 2e-6})
PERIOD = PARAMETERS.plant.control_period
TERMS = Terms(PARAMETERS, DEADLINE)
NODE = load_scenario("closed_loop_tanh").sim
"""For which the gains of examples/pd_controller.py are."""


class VirtualConnection:
    """Where a controller answers in virtual time."""

    def __init__(self, way: str) -> None:
        self.wrong = Wrong(way)
        self._now = 0.0
        self._numbers = count()
        self._runs = 0
        self._on_the_way: list[tuple[float, int, Callable[[Phase], Answer]]] = []

    def now(self) -> float:
        return self._now

    def begin_run(self) -> None:
        self._runs += 1

    def publish(self, sequence: int, measurement: NDArray[np.float64]) -> None:
        y = measurement.view(Measurement)[0]
        if self.wrong.ended:
            return
        time = self._now
        error = y.reference_position - [*y.position[:2], y.deflection]
        rate = y.reference_velocity - y.velocity
        for each in self.wrong.answers(sequence, float(y.position[0]), error.tolist(), rate.tolist()):
            drives = [each.drive, *([[each.horizon, 0.0, 0.0]] if each.horizon else [])]
            time += each.after
            self.send(
                time,
                sequence=each.sequence,
                drives=np.array(drives),
                frame=each.frame,
                unreadable="6 bytes that are no PiezoDrive" if each.nonsense else "",
                stamp=each.sequence * PERIOD if each.stamped else 0.0,
                other_run=each.first_run and self._runs > 0,
            )

    def send(self, time: float, **answer: Any) -> None:
        """What arrives at `time`, in the phase of then."""
        heapq.heappush(self._on_the_way, (time, next(self._numbers), partial(Answer, time=time, **answer)))

    def take(self, phase: Phase) -> Answer | None:
        if not self._on_the_way or self._on_the_way[0][0] > self._now:
            return None
        return heapq.heappop(self._on_the_way)[2](phase)

    def wait(self, timeout: float) -> None:
        self._now += timeout

    def problem(self) -> str:
        return "the controller ended with code 3" if self.wrong.ended else ""

    def memory(self) -> int:
        return sum(map(len, self.wrong.leaked))

    def restart(self) -> bool:
        return True


class GainConnection(VirtualConnection):
    """Where the law of examples/pd_controller.py answers at once, `change` (of a drive, by axis) included."""

    def __init__(self, gain: float, damping: float, change: Callable[[NDArray[np.float64]], object]) -> None:
        super().__init__("right")
        self.gain, self.damping, self.change = gain, damping, change

    def publish(self, sequence: int, measurement: NDArray[np.float64]) -> None:
        y = measurement.view(Measurement)[0]
        error = y.reference_position - [*y.position[:2], y.deflection]
        rate = y.reference_velocity - y.velocity
        drive = self.gain * (np.array([3e10, 3e10, 5.2e8]) * error + self.damping * np.array([6e5, 6e5, 8.4e4]) * rate)
        self.change(drive)
        self.send(self.now(), sequence=sequence, drives=drive[None], stamp=sequence * NODE.plant.control_period)


class LawConnection(VirtualConnection):
    """Where a law of the package answers at once, as the controller node answers."""

    def __init__(self, law: ControllerParameters, period: float) -> None:
        super().__init__("right")
        self.controller = Controller(law)
        self.period = period
        self.answered = -1

    def publish(self, sequence: int, measurement: NDArray[np.float64]) -> None:
        if sequence < self.answered:
            self.controller.reset()
        if sequence != self.answered:
            self.controller.answer(measurement, sequence * self.period)
        self.answered = sequence
        drive, horizon = self.controller.given(), 0.0
        if isinstance(drive, Command):
            horizon, drive = drive.horizon_period, np.vstack([drive.voltage, drive.horizon])
        drives, stamp = np.array(drive).reshape(-1, 3), sequence * self.period
        self.send(self.now(), sequence=sequence, drives=drives, stamp=stamp, horizon_period=horizon)


def examine(way: str) -> Log:
    log = Procedure(VirtualConnection(way), PARAMETERS, LONG).run()
    log.went = True if not log.ended else None
    return log


def broken(log: Log) -> list[str]:
    return [each.rule for each in judge(log, TERMS) if each.outcome is RuleResult.BROKEN]


@cache
def verdicts(way: str) -> tuple[list[Verdict], int]:
    """Of a controller that is wrong in this way, and the exit code."""
    log = examine(way)
    found = judge(log, TERMS)
    return found, exit_code(found, log)


def test_a_right_controller_keeps_every_rule() -> None:
    log = examine("right")
    assert {each.rule: each.outcome for each in judge(log, TERMS)} == {rule.name: RuleResult.KEPT for rule in RULES}
    assert exit_code(judge(log, TERMS), log) == 0
    # What was asked: some of it got lost on purpose, and the numbers began again five times.
    assert {each.phase for each in log.sent} == set(Phase) - {Phase.PAUSE}
    assert sum(each.sequence == 0 for each in log.sent) == 5
    fault = [each.sequence for each in log.sent if each.phase is Phase.FAULT]
    assert 100 <= len(fault) < fault[-1] - fault[0] + 1


@pytest.mark.parametrize("way", list(WAYS)[1:])
def test_a_controller_that_is_wrong_in_one_way_breaks_the_rule_of_it(way: str) -> None:
    found, code = verdicts(way)
    assert WAYS[way] in [each.rule for each in found if each.outcome is RuleResult.BROKEN]
    assert code == 1
    for verdict in found:
        assert bool(verdict.reason) == (verdict.outcome is RuleResult.BROKEN)


@pytest.mark.parametrize(
    "way",
    [
        *("twice", "swaps", "late", "nan", "infinite horizon", "no frame", "too far", "too steep", "nonsense"),
        *("a microvolt more", "nan late", "old integral", "leaks", "zeros"),
        *("gains a thousandth", "stamp 0", "old integral later", "noise later"),
    ],
)
def test_what_is_wrong_in_one_way_breaks_no_other_rule(way: str) -> None:
    assert [each.rule for each in verdicts(way)[0] if each.outcome is RuleResult.BROKEN] == [WAYS[way]]


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
    assert outcomes.pop(rule) is RuleResult.BROKEN
    assert {each for name, each in outcomes.items() if name not in ("connected", "alive")} == {RuleResult.UNTESTED}


def test_a_controller_that_does_not_find_a_restarted_simulator_or_has_to_be_killed_breaks_these_rules() -> None:
    log = examine("right")
    log.reconnected = log.went = False
    assert broken(log) == ["restart", "end"]


def test_a_limit_that_the_instrument_does_not_have_is_not_tested() -> None:
    terms = Terms(build(SimParameters, {}), DEADLINE)
    outcomes = {each.rule: each.outcome for each in judge(examine("right"), terms)}
    assert outcomes["slew"] is RuleResult.UNTESTED


WILD = ("range", "slew", "response", "follows", "end")


def test_a_motion_that_diverges_is_nothing_that_the_controller_is_blamed_for() -> None:
    log = Procedure(VirtualConnection("wild"), build(SimParameters, {}), LONG).run()
    assert {each.outcome for each in judge(log, TERMS) if each.rule not in WILD} == {RuleResult.KEPT}
    assert max(np.abs(each.drives[0]).max() for each in log.answers) > 100.0


def of_gains(
    gain: float, damping: float, change: Callable[[NDArray[np.float64]], object] = lambda drive: None, seed: int = 1
) -> dict[str, str]:
    """Broken rules and why."""
    log = Procedure(GainConnection(gain, damping, change), NODE, LONG, seed).run()
    verdicts = judge(log, Terms(NODE, DEADLINE))
    return {each.rule: each.reason for each in verdicts if each.outcome is RuleResult.BROKEN}


@pytest.mark.parametrize("seed", [1, 2, *(pytest.param(seed, marks=pytest.mark.long) for seed in range(3, 6))])
@pytest.mark.parametrize(
    ("gain", "damping"),
    [(1.0, 1.0), (1.0, 0.0), (1.0, -1.0), (1e3, 1.0)],
    ids=["right", "no damping", "rings", "gain x 1000"],
)
def test_a_loop_that_rings_is_not_said_to_give_no_answer_to_its_reference(
    gain: float, damping: float, seed: int
) -> None:
    wild = gain > 1.0 or damping < 0.0
    assert set(of_gains(gain, damping, seed=seed)) <= ({"range", "follows"} if wild else set())


@pytest.mark.parametrize(
    ("gain", "damping", "sentence"),
    [
        (1.0, -1.0, "x does not follow its reference in the first 2000 measurements: the error is "),
        (1e-3, 1.0, "the error is 5.75e-10 m rms, of a scanner that does not move it is 5.75e-10 m"),
        (1e3, 1.0, "x does not follow its reference"),
    ],
    ids=["damping of the wrong sign", "gains a thousandth", "gains x 1000"],
)
def test_controller_with_which_the_plant_of_the_exam_does_not_follow_is_found_out(
    gain: float, damping: float, sentence: str
) -> None:
    assert sentence in of_gains(gain, damping)["follows"]


@pytest.mark.parametrize(
    ("sim", "law"),
    [
        ({"plant.control_period": 5e-5}, {"law.kind": "pid", "law.period": 5e-5}),
        ({"plant.control_period": 2e-5, "plant.delay_ticks": 1}, {"law.kind": "observer", "law.period": 2e-5}),
    ],
)
def test_laws_that_follow_are_not_blamed_at_other_periods(sim: dict[str, Any], law: dict[str, Any]) -> None:
    instrument = changed(NODE, sim | {"detector.sample_period": sim["plant.control_period"]})
    delay = {"law.delay_ticks": sim.get("plant.delay_ticks", 0)}
    assert "follows" not in judged(build(ControllerParameters, law | delay), instrument)[0]


def add_to_y(drive: NDArray[np.float64]) -> None:
    drive[1] += 0.5 * drive[0]


def turn(drive: NDArray[np.float64]) -> None:
    drive[:2] += 0.9 * np.array([-drive[1], drive[0]])


def turn_a_little(drive: NDArray[np.float64]) -> None:
    drive[:2] += 0.1 * np.array([-drive[1], drive[0]])


@pytest.mark.parametrize(
    ("mix", "sentence"),
    [
        (add_to_y, "the drive of y moves by 7.5 V when the reference of x jumps, that of x by 15 V"),
        (turn, "the drive of y moves by 13.5 V when the reference of x jumps, that of x by 15 V (and 1 more)"),
        (turn_a_little, ""),
    ],
)
def test_x_and_y_that_are_mixed_are_told_unless_the_mixture_is_small(
    mix: Callable[[NDArray[np.float64]], None], sentence: str
) -> None:
    assert of_gains(1.0, 1.0, mix) == ({"response": sentence} if sentence else {})


class Late:
    """Sends the drive of an axis so many measurements late."""

    def __init__(self, axis: int, ticks: int) -> None:
        self.axis, self.sent = axis, [0.0] * ticks

    def __call__(self, drive: NDArray[np.float64]) -> None:
        self.sent.append(float(drive[self.axis]))
        drive[self.axis] = self.sent.pop(0)


@pytest.mark.parametrize("ticks", [1, 3])
def test_a_drive_that_is_late_is_told_by_how_much_however_its_loop_rings(ticks: int) -> None:
    why = of_gains(1.0, 1.0, Late(0, ticks))
    assert set(why) - {"repeats", "range"} == {"present"}
    assert why["present"] == f"the drive of x answers the measurement {ticks} before the one whose sequence it has"


def test_a_drive_that_rises_with_the_measured_position_is_told() -> None:
    log = Procedure(VirtualConnection("feeds back upwards"), PARAMETERS, LONG).run()
    why = {each.rule: each.reason for each in judge(log, TERMS) if each.outcome is RuleResult.BROKEN}
    assert why["response"] == "the drive of x rises when the measured position rises"


def test_a_drive_without_feedback_is_told_of_its_axis_alone_and_allowed_where_there_is_none_on_purpose() -> None:
    log = examine("x without feedback")
    why = {each.rule: each.reason for each in judge(log, TERMS) if each.outcome is RuleResult.BROKEN}
    assert why == {"response": "the drive of x does not answer the measured position"}
    assert not [each for each in judge(log, replace(TERMS, feedback=False)) if each.outcome is RuleResult.BROKEN]


FOLLOW = [kind for kind in names("law") if kind not in ("open_loop", "chirp", "external")]


def judged(law: ControllerParameters, sim: SimParameters) -> tuple[dict[str, str], Log]:
    """Broken rules and why."""
    log = Procedure(LawConnection(law, sim.plant.control_period), sim, LONG).run()
    verdicts = judge(log, Terms(sim, DEADLINE))
    return {each.rule: each.reason for each in verdicts if each.outcome is RuleResult.BROKEN}, log


def assert_hardly_mixed(log: Log) -> None:
    """With a margin of 20 to what is told."""
    found = responses(log, 3)
    assert found is not None
    smallest = min(abs(found[axis].steps[axis]) for axis in (0, 1))
    assert max(abs(found[axis].steps[1 - axis]) for axis in (0, 1)) < 0.01 * smallest


@pytest.mark.parametrize("kind", FOLLOW)
def test_every_law_of_the_package_that_follows_a_reference_keeps_every_rule(kind: str) -> None:
    sim = load_scenario("closed_loop_tanh").sim
    timing = {} if kind in ("sgn", "tanh") else {"law.period": sim.plant.control_period}
    broken_rules, log = judged(build(ControllerParameters, {"law.kind": kind} | timing), sim)
    assert not broken_rules
    assert_hardly_mixed(log)


@pytest.mark.parametrize("name", ["closed_loop_predictive", "realtime_250us", "realtime_1ms"])
def test_the_controller_of_a_scenario_answers_its_references_even_where_the_answer_is_further_on_in_a_packet(
    name: str,
) -> None:
    scenario = load_scenario(name)
    broken_rules, log = judged(scenario.controller, scenario.sim)
    # In packets of 1 ms a sensor that drops out throws the tip.
    assert set(broken_rules) <= ({"range"} if name == "realtime_1ms" else set())
    assert_hardly_mixed(log)
