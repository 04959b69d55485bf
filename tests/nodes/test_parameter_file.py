"""What a session has read and checked is what the nodes read: rcl's reader and ours agree on the file in between."""

import json
from pathlib import Path

import pytest
from rclpy.node import Node
from support import Graph

from afm_bringup.scenario_input import read_scenario, with_ros_arguments, write_parameters
from afm_model import flatten
from afm_node_common.parameters import declare
from afm_node_common.process import ControllerNodeParameters, SimNodeParameters
from afm_recorder_node.parameters import RecorderParameters

VALUES = {
    "text": [
        "1e5",
        "yes",
        "0b11",
        "1:30",
        "~",
        "null",
        "0x1F",
        "1_000",
        "",
        " a ",
        "a: b # c",
        "a\tb\nc",
        "µ",
        '"',
        "'",
    ],
    "numbers": [1.0, 1e-300, 1e22, 2e-06, -0.0],
    "whole": [0, -1, 2**63 - 1],
    "switches": [True, False],
    "one": 5,
    "one_more": 5.0,
    "deep.inside": "10",
}


def test_every_value_of_a_users_node_arrives_as_it_was_read(tmp_path: Path) -> None:
    scenario, written = tmp_path / "scenario.yaml", tmp_path / "written.yaml"
    scenario.write_text(json.dumps({"/**/owner": {"ros__parameters": VALUES}}))  # YAML as well
    write_parameters(read_scenario(str(scenario)), written)
    with Graph(["--ros-args", "--params-file", str(written)]) as graph:
        node = graph.add(Node("owner", automatically_declare_parameters_from_overrides=True))
        for name, value in VALUES.items():
            arrived = node.get_parameter(name).value
            arrived = list(arrived) if isinstance(value, list) else arrived
            assert (name, arrived, type(arrived)) == (name, value, type(value))


@pytest.mark.parametrize("name", ["closed_loop_tanh", "open_loop", "closed_loop_realtime"])
def test_node_that_is_given_the_file_runs_what_was_checked(tmp_path: Path, name: str) -> None:
    scenario, written = read_scenario(name), tmp_path / "written.yaml"
    write_parameters(scenario, written, {"afm_sim_node": {"run.start_paused": True}})
    with Graph(["--ros-args", "--params-file", str(written)]) as graph:
        parameters = declare(graph.add(Node("afm_sim_node", namespace="anywhere")), SimNodeParameters)
    values = {name: value for name, value in flatten(parameters).items() if not name.startswith("process.")}
    assert values == flatten(scenario.sim) | {"run.start_paused": True}


ONE_MICROSCOPE = """
/**:
  ros__parameters:
    microscope: {lever: contal_g, scanner: tube_100um, setpoint_force: 6.0e-9, sensitivity_x: 2.1e-7}
/**/afm_sim_node:
  ros__parameters: {sample: {kind: flat}, onboard: {kind: pi}}
/**/afm_controller_node:
  ros__parameters: {law: {kind: pid}}
"""


def test_nodes_started_by_hand_read_the_one_section_as_a_session_does(tmp_path: Path) -> None:
    scenario, written = tmp_path / "scenario.yaml", tmp_path / "written.yaml"
    scenario.write_text(ONE_MICROSCOPE)
    read = read_scenario(str(scenario))
    write_parameters(read, written)
    for file in (scenario, written):
        with Graph(["--ros-args", "--params-file", str(file)]) as graph:
            sim = declare(graph.add(Node("afm_sim_node", namespace="anywhere")), SimNodeParameters)
            law = declare(graph.add(Node("afm_controller_node", namespace="anywhere")), ControllerNodeParameters)
            declare(graph.add(Node("afm_recorder_node", namespace="anywhere")), RecorderParameters)
        for given, wanted in ((sim, read.sim), (law, read.controller)):
            values = {name: value for name, value in flatten(given).items() if not name.startswith("process.")}
            assert values == flatten(wanted)


def test_law_that_a_command_chooses_itself_is_the_one_that_runs(tmp_path: Path) -> None:
    scenario, written = tmp_path / "scenario.yaml", tmp_path / "written.yaml"
    scenario.write_text("/**/afm_controller_node:\n  ros__parameters: {law: {kind: tanh, alpha: 0.3}}\n")
    command = ["node", "--ros-args", "-p", "law.kind:=observer"]
    write_parameters(read_scenario(str(scenario)), written, controller=command)
    command = with_ros_arguments(command, written, "/afm")
    assert command[0] == "node"
    with Graph(command[1:]) as graph:
        law = declare(graph.add(Node("afm_controller_node")), ControllerNodeParameters).law
    assert law.kind == "observer"
