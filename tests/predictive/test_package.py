"""Claims about the package of the law: it is found by its entry point, and missed in one sentence."""

import importlib.metadata

import pytest

from afm_model import load_scenario
from afm_model.core import registry
from afm_model.parameters.scenario import ScenarioError
from afm_predictive import PREDICTIVE

SCENARIOS = ("closed_loop_predictive", "realtime_50us", "realtime_250us", "realtime_1ms")


@pytest.fixture
def not_installed(monkeypatch):
    monkeypatch.setattr(registry, "_offered", dict)


def test_the_law_is_offered_by_the_entry_point_that_any_package_may_use():
    (point,) = importlib.metadata.entry_points(group="afm_model.law", name="predictive")
    assert point.value == "afm_predictive:PREDICTIVE"
    assert registry.find("law", "predictive") is PREDICTIVE


@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.usefixtures("not_installed")
def test_a_scenario_that_names_the_law_says_what_is_missing_and_how_to_install_it(name):
    words = (
        r"law predictive is in the package afm_predictive, which is not installed: pip install \./afm_predictive in "
    )
    words += r"a clone, or with ROS 2 build it with the others \(make build\); or choose one of open_loop, sgn, tanh"
    with pytest.raises(ScenarioError, match=words):
        load_scenario(name)


@pytest.mark.usefixtures("not_installed")
def test_the_scenario_of_the_demo_does_not_need_the_package():
    assert load_scenario("closed_loop_tanh").controller.law.kind == "tanh"
