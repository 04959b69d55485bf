"""Scenarios by name, read and checked."""

from afm_model.scenario import Scenario, ScenarioError, load_scenario
from afm_node_common.process import InProcess
from afm_recorder_node.parameters import RecorderParameters

from .files import find_scenario


def read_scenario(name: str) -> Scenario:
    """Find, read and check a scenario.

    Raises
    ------
    ScenarioError
        If it is not found or not allowed.
    """
    try:
        path = find_scenario(name)
    except FileNotFoundError as error:
        raise ScenarioError(str(error)) from None
    return load_scenario(path, {"afm_recorder_node": RecorderParameters}, InProcess)
