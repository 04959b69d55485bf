"""Claims about a node as a law of a comparison, without topics: use of its answers, and its parameters."""

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest
import yaml
from numpy.typing import NDArray

from afm_bringup.node_law import NodeLaw, _sections_for_node, node_contender
from afm_bringup.scenario_input import write_parameters
from afm_model import Command, DriveError, ParameterError, Scenario, SimParameters, build
from afm_model.compiled.records import size
from afm_model.core.errors import MalformedError
from afm_model.parts.signals import Measurement
from afm_model.studies import CONDITIONS, Comparison, Trial, run_trials
from afm_model.studies.contender import Common

MEASURED = np.zeros(size(Measurement))
Answer = tuple[int, object]


class HandConnection:
    """A connection with a clock of its own, whose answers are given by hand."""

    def __init__(self, answers: Callable[[int, int], list[Answer | Exception]], ended: str = "") -> None:
        self._answers = answers
        self._came: list[Answer | Exception] = []
        self._now = 0.0
        self._ended = ended
        self.published: list[tuple[float, int]] = []

    def now(self) -> float:
        return self._now

    def publish(self, sequence: int, measurement: NDArray[np.float64]) -> None:
        times = sum(each == sequence for _, each in self.published)
        self.published.append((self._now, sequence))
        self._came += self._answers(sequence, times)

    def take_drive(self) -> object:
        taken = self._came.pop(0) if self._came else None
        if isinstance(taken, MalformedError):
            raise taken
        return taken

    def wait(self, timeout: float) -> None:
        self._now += timeout

    def problem(self) -> str:
        return self._ended


def drive(x: float) -> NDArray[np.float64]:
    return np.array([x, 0.0, 0.0])


def test_answers_to_other_measurements_are_passed_over():
    connection = HandConnection(lambda sequence, _: [(sequence - 1, drive(7.0)), (sequence, drive(float(sequence)))])
    law = NodeLaw(connection)
    assert [law.answer(MEASURED)[0] for _ in range(3)] == [0.0, 1.0, 2.0]
    assert [sequence for _, sequence in connection.published] == [0, 1, 2]


def test_horizon_of_an_answer_goes_on_as_it_is():
    command = Command(drive(1.0), np.ones((2, 3)), 1e-4)
    assert NodeLaw(HandConnection(lambda sequence, _: [(sequence, command)])).answer(MEASURED) is command


def test_measurement_that_is_not_answered_is_sent_again_after_a_second():
    connection = HandConnection(lambda sequence, times: [(sequence, drive(5.0))] if times else [])
    assert NodeLaw(connection).answer(MEASURED)[0] == 5.0
    assert len(connection.published) == 2
    assert connection.published[1][0] == pytest.approx(1.0, abs=0.11)


@pytest.mark.parametrize(
    ("answers", "ended", "sentence"),
    [
        ([], "", "the node has not answered measurement 0 within 10 s"),
        ([], "the node ended with code 3: no device", "the node ended with code 3: no device (measurement 0 is not"),
        ([MalformedError("6 bytes")], "", "the answer to measurement 0 is no drive: 6 bytes"),
        ([(0, DriveError("a horizon of 200 drives is not allowed"))], "", "a horizon of 200 drives is not allowed"),
        ([(0, drive(np.nan))], "", "drive x = nan V is not allowed: every voltage must be a finite number"),
    ],
)
def test_node_that_fails_is_a_row_with_its_sentence(answers, ended, sentence):
    class Started:
        def __enter__(self) -> NodeLaw:
            return NodeLaw(HandConnection(lambda *_: list(answers), ended))

        def __exit__(self, *_: object) -> None:
            pass

    sim = build(SimParameters, {"run.duration": 1e-3})
    (row,) = run_trials([Trial(sim, None, "node", None, Started)])
    assert set(row) == {"error"}
    assert row["error"].startswith(sentence)


def test_node_is_given_its_own_section_period_and_delay_and_nothing_of_the_instrument(tmp_path):
    sections = {
        "/**/afm_sim_node": {"contact.tau": 1e9},
        "/**/my_node": {"gain": 2.0},
        "/**/afm_controller_node": {"law.kind": "pid", "law.period": 1.0},
    }
    scenario = Scenario("some", tmp_path / "some.yaml", sections=sections)
    sim = build(SimParameters, {"plant.control_period": 2e-5, "plant.delay_ticks": 3})
    write_parameters(_sections_for_node(scenario, sim), tmp_path / "told.yaml")
    told = {key: each["ros__parameters"] for key, each in yaml.safe_load((tmp_path / "told.yaml").read_text()).items()}
    timing = {"law.period": 2e-5, "law.delay_ticks": 3}
    assert told == {
        "/**": timing,
        "/**/my_node": {"gain": 2.0},
        "/**/afm_controller_node": {"law.kind": "pid"} | timing,
    }


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        ("/nowhere/controller --fast", "node '/nowhere/controller --fast' cannot be started: there is no program"),
        ("", "node '' cannot be started: there is no program ''"),
        ("python 'a", "node python 'a is not allowed: No closing quotation"),
    ],
)
def test_command_that_cannot_start_is_refused_before_anything_runs(command, sentence):
    with pytest.raises(ParameterError) as raised:
        node_contender(command)
    assert str(raised.value).startswith(sentence)


def test_node_declares_no_knowledge_and_is_no_part():
    node = node_contender("sh -c true")
    assert (node.label, node.knowledge, node.is_part) == ("sh -c true", "not declared", False)


def test_scenario_of_a_row_of_a_node_is_that_of_its_instrument(tmp_path):
    node = node_contender("sh -c true")
    row = {"law": node.label} | dict(zip(CONDITIONS, (2e-5, 3, 0.0, 1.2, "sine 500"), strict=True))
    common = Common(Scenario("default", tmp_path / "default.yaml"), 1.5)
    (section,) = Comparison(pd.DataFrame([row]), (node,), common).scenario_of(0).items()
    assert section[0] == "/**/afm_sim_node"
    given = {"plant.control_period": 2e-5, "plant.delay_ticks": 3, "reference.omega_x": 500.0}
    assert given.items() <= section[1].items()
    assert section[1]["contact.tau"] == pytest.approx(1.2 * SimParameters().contact.tau)
