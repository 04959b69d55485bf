"""Scenarios by name, read and checked."""

import argparse
from pathlib import Path

from afm_model import Scenario, load_scenario
from afm_node_common.process import InProcess
from afm_recorder_node.parameters import RecorderParameters

_OURS = ("scenario", "/**", "/**/afm_sim_node", "/**/afm_controller_node", "/**/afm_recorder_node")


def read_scenario(name: str, overrides: Path | None = None) -> Scenario:
    """Find, read and check a scenario.

    Parameters
    ----------
    name : str
        Name of one that comes with afm_model, or a file.
    overrides : Path, optional
        Parameter file that counts in place of the scenario's parameters.

    Raises
    ------
    ScenarioError
        If it is not found or not allowed.
    """
    return load_scenario(name, {"afm_recorder_node": RecorderParameters}, InProcess, overrides)


def add_overrides(parser: argparse.ArgumentParser) -> None:
    """Let a command be given `overrides` of `read_scenario`."""
    parser.add_argument(
        "--overrides",
        type=Path,
        metavar="FILE",
        help="parameter file that counts in place of the scenario's parameters",
    )


def foreign_sections(scenario: Scenario) -> list[str]:
    """Sections of a scenario that are for a user's own nodes."""
    return [key for key in scenario.sections if key not in _OURS]
