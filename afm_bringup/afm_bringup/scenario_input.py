"""Scenarios by name, read and checked; the parameter file that the nodes are given, as every reader takes it."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from afm_model import Scenario, load_scenario
from afm_model.core.registry import add_parts
from afm_model.parameters import ControllerParameters
from afm_model.parameters.scenario import overridden
from afm_model.parameters.strict_yaml import yaml_text
from afm_node_common.process import InProcess
from afm_node_common.runner import chosen_kinds
from afm_recorder_node.parameters import RecorderParameters

_OURS = ("scenario", "/**", "/**/afm_sim_node", "/**/afm_controller_node", "/**/afm_recorder_node")


def read_scenario(name: str, overrides: Path | None = None, parts: Sequence[str] = ()) -> Scenario:
    """Find, read and check a scenario.

    Parameters
    ----------
    name : str
        Name of one that comes with afm_model, or a file.
    overrides : Path, optional
        Parameter file that counts in place of the scenario's parameters.
    parts : sequence of str
        Parts of your own that the files may choose, `module:NAME` each.

    Raises
    ------
    ScenarioError
        If it is not found or not allowed.
    """
    return load_scenario(name, {"afm_recorder_node": RecorderParameters}, InProcess, overrides, parts)


def add_overrides(parser: argparse.ArgumentParser) -> None:
    """Let a command be given `overrides` and `parts` of `read_scenario`."""
    parser.add_argument(
        "--overrides",
        type=Path,
        metavar="FILE",
        help="parameter file that counts in place of the scenario's parameters",
    )
    add_parts(parser)


def add_live(parser: argparse.ArgumentParser) -> None:
    """Let a session be watched."""
    parser.add_argument(
        "--live", action="store_true", help="show the growing recording in a web browser, and print the link"
    )


def foreign_sections(scenario: Scenario) -> list[str]:
    """Sections of a scenario that are for a user's own nodes."""
    return [key for key in scenario.sections if key not in _OURS]


def with_ros_arguments(command: Sequence[str], parameters: Path, namespace: str) -> list[str]:
    """Return a command with the parameters of a scenario and a namespace; what the command sets itself wins."""
    given = ["--ros-args", "--params-file", str(parameters), "-r", f"__ns:={namespace}"]
    own = command.index("--ros-args") if "--ros-args" in command else len(command)
    return [*command[:own], *given, *command[own:]]


def write_parameters(
    scenario: Scenario,
    path: Path,
    more: Mapping[str, Mapping[str, object]] | None = None,
    controller: Sequence[str] = (),
) -> None:
    """Write the sections of a scenario for `--params-file`.

    Parameters
    ----------
    scenario : Scenario
    path : Path
        File to write.
    more : mapping, optional
        Parameters that count in place of the scenario's: name of one of our nodes, its parameters.
    controller : sequence of str, optional
        Command of the controller. What the scenario gives to a law does not go to another one that this chooses.

    Raises
    ------
    OSError
        If it cannot be written.
    """
    sections: dict[str, dict[str, Any]] = {
        key: values for key, values in scenario.sections.items() if key != "scenario" and values
    }
    for node, values in (more or {}).items():
        key = f"/**/{node}"
        sections[key] = sections.get(key, {}) | dict(values)
    if kinds := chosen_kinds(controller):
        key = "/**/afm_controller_node"
        sections[key] = overridden(ControllerParameters, sections.get(key, {}), kinds)
    content = {key: {"ros__parameters": values} for key, values in sections.items()}
    path.write_text(yaml_text(content))
