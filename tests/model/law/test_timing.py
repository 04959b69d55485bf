"""Claims about laws that are made for one period and one delay."""

import sys
from typing import Any

import pytest

from afm_model import ScenarioError, SimParameters, build, load_scenario
from afm_model.law import PaperLaw, SampledLaw, timing_disagreements
from afm_model.parts import Law


class Trial(SampledLaw):
    """No parameters but those of every law that is made for a rate."""

    kind: str = "test_timing:TRIAL"


def control(t: float, y: Any, u: Any, p: Any, s: Any) -> None:
    """Answer nothing."""


TRIAL = Law(name="trial", parameters=Trial, control=control)

SCENARIO = """
/**/afm_controller_node:
  ros__parameters: {law.kind: "KIND"MORE}
/**/afm_sim_node:
  ros__parameters: {plant.control_period: 5.0e-5, plant.delay_ticks: 3}
"""


@pytest.fixture
def kind(monkeypatch):
    """Name of the law of this file."""
    monkeypatch.setitem(sys.modules, "test_timing", sys.modules[__name__])
    return "test_timing:TRIAL"


def load(folder, kind, more=""):
    path = folder / "trial.yaml"
    path.write_text(SCENARIO.replace("KIND", kind).replace("MORE", more))
    return load_scenario(path, parts=[kind] if ":" in kind else [])


def test_scenario_makes_a_law_for_the_period_and_the_delay_of_its_plant(tmp_path, kind):
    scenario = load(tmp_path, kind)
    assert (scenario.controller.law.period, scenario.controller.law.delay_ticks) == (5e-5, 3)
    assert scenario.sections["/**/afm_controller_node"]["law.period"] == 5e-5  # what the nodes are given


def test_scenario_that_gives_period_or_delay_of_a_law_is_followed(tmp_path, kind):
    law = load(tmp_path, kind, ", law.delay_ticks: 0").controller.law
    assert (law.period, law.delay_ticks) == (5e-5, 0)
    told = timing_disagreements(law, build(SimParameters, {"plant.control_period": 5e-5, "plant.delay_ticks": 3}))
    assert told == ["the law is made for another delay: law.delay_ticks = 0 should be plant.delay_ticks = 3"]


def test_law_that_is_made_for_another_period_is_told_so(kind):
    (told,) = timing_disagreements(Trial(period=1e-4), build(SimParameters, {"plant.control_period": 5e-5}))
    assert "law.period = 0.0001 s should be plant.control_period = 5e-05 s" in told


def test_paper_laws_are_made_for_no_rate(tmp_path):
    controller = load(tmp_path, "sgn").controller
    assert "law.period" not in load(tmp_path, "sgn").sections["/**/afm_controller_node"]
    assert timing_disagreements(controller.law, SimParameters()) == [] and isinstance(controller.law, PaperLaw)


def test_period_of_a_law_that_is_not_allowed_is_refused(tmp_path, kind):
    with pytest.raises(
        ScenarioError, match=r"law\.period = 0\.0 s is not allowed: it must be a finite number >= 1e-15"
    ):
        load(tmp_path, kind, ", law.period: 0.0")
