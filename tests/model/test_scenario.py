"""Claims about scenario files."""

from pathlib import Path

import pytest

from afm_model import Scenario, ScenarioError, load_scenario
from afm_model.parameters import Group
from afm_model.parameters.scenario_files import scenario_names

GOOD = """
scenario:
  ros__parameters:
    title: Slow scan
/**/afm_sim_node:
  ros__parameters:
    reference: {omega_x: 5.0}
    plant.dt: 1e-6
    run.duration: 2
/**/afm_controller_node:
  ros__parameters:
    law.kind: sgn
"""


def load(folder: Path, text: str, **others: type[Group]) -> Scenario:
    """The scenario of a file with this text."""
    path = folder / "trial.yaml"
    path.write_text(text)
    return load_scenario(path, others)


def test_scenario_gives_the_values_of_its_file_and_defaults_for_the_rest(tmp_path):
    scenario = load(tmp_path, GOOD)
    assert (scenario.name, scenario.header.title) == ("trial", "Slow scan")
    assert scenario.sim.reference.omega_x == 5.0
    assert scenario.sim.plant.dt == 1e-6  # YAML 1.1 reads 1e-6 as text
    assert scenario.sim.run.duration == 2.0
    assert scenario.controller.law.kind == "sgn"
    assert scenario.sim.contact == Scenario("", tmp_path).sim.contact


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("- 1\n- 2\n", "is no parameter file"),
        ("", "is no parameter file"),
        ("a: [1, 2\n", "is no readable YAML file"),
        ("/**/afm_sim_mode:\n  ros__parameters: {}\n", "unknown section /\\*\\*/afm_sim_mode: it must end in one of"),
        ("/**/afm_sim_node:\n  plant: 1\n", "section .*afm_sim_node must hold ros__parameters and nothing else"),
        ("/**/afm_sim_node: 3\n", "section .*afm_sim_node must hold ros__parameters"),
        ("/**/afm_sim_node:\n  ros__parameters: {contact.taw: 1.0}\n", r"unknown parameter contact\.taw: did you mean"),
        ("/**/afm_sim_node:\n  ros__parameters: {contact: {tau: -1.0}}\n", r"contact\.tau = -1\.0 Pa is not allowed"),
        ("/**/afm_sim_node:\n  ros__parameters: {plant.kind: [1]}\n", r"plant\.kind = \[1\] is not allowed"),
    ],
)
def test_scenario_that_is_not_allowed_is_refused_in_a_sentence_that_names_the_file(tmp_path, text, words):
    with pytest.raises(ScenarioError, match=f"trial.yaml.*{words}"):
        load(tmp_path, text)


@pytest.mark.parametrize("value", ["[1, 2]", "3", "text"])
def test_ros_parameters_that_are_no_mapping_are_refused(tmp_path, value):
    with pytest.raises(ScenarioError):
        load(tmp_path, f"/**/afm_sim_node:\n  ros__parameters: {value}\n")


def test_missing_file_is_refused(tmp_path):
    with pytest.raises(ScenarioError, match=r"nowhere\.yaml"):
        load_scenario(tmp_path / "nowhere.yaml")


def test_sections_of_other_nodes_are_checked_too(tmp_path):
    class Extra(Group):
        depth: int = 1

    load(tmp_path, "/**/other_node:\n  ros__parameters: {depth: 2}\n", other_node=Extra)
    with pytest.raises(ScenarioError, match="unknown parameter dept: did you mean depth"):
        load(tmp_path, "/**/other_node:\n  ros__parameters: {dept: 2}\n", other_node=Extra)


def test_no_shipped_title_names_a_law_since_another_controller_may_run():
    for name in scenario_names():
        title = load_scenario(name).header.title
        kind = load_scenario(name).controller.law.kind
        assert title and not {"law", kind} & set(title.lower().replace(",", " ").split()), title
        assert "predicting" not in title
