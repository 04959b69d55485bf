"""The processes that a session starts."""

import shlex
from pathlib import Path

from afm_model import Scenario
from afm_model.core.schema import flatten

from .files import executable
from .results_folder import RECORDING
from .scenario_input import with_ros_arguments, write_parameters

RECORDER, SIMULATOR, CONTROLLER, LIVE = "afm_recorder_node", "afm_sim_node", "afm_controller_node", "live"
OWN, COMPOSED, INSIDE, EXTERNAL = "", "composed", "inside", "external"
"""Controllers that are no command: our node in its own process, our node in the simulator's process, a law in the
simulator itself, a node that was started elsewhere."""


def title(scenario: Scenario, controller: str) -> str:
    """Title of a recording: that of the scenario, and who moves x and y as far as this is known before the start."""
    told = scenario.header.title or scenario.name
    if controller in (EXTERNAL, INSIDE):
        return told
    return f"{told} ({scenario.controller.law.kind if controller in (OWN, COMPOSED) else controller})"


def commands(
    scenario: Scenario, controller: str, work: Path, namespace: str, *, ros_arguments: bool, live: bool
) -> dict[str, list[str]]:
    """Commands of the processes, by name, in order; writes their parameters into `work`.

    Parameters
    ----------
    scenario : Scenario
    controller : str
        Command of the controller to start, or OWN, COMPOSED, INSIDE or EXTERNAL.
    work : Path
        Folder of what is under way.
    namespace : str
        Of the instrument.
    ros_arguments : bool
        Whether parameters and namespace are appended to the command of the controller.
    live : bool
        Whether the growing recording is shown in a browser.
    """
    parameters = work / "parameters.yaml"
    own: dict[str, dict[str, object]] = {
        SIMULATOR: {"run.start_paused": True, "run.exit_when_finished": False},
        RECORDER: {"path": str(work / RECORDING), "title": title(scenario, controller)},
    }
    if controller == INSIDE:
        own[SIMULATOR] |= {f"law.{name}": value for name, value in flatten(scenario.controller.law).items()}
    words = [] if controller in (OWN, COMPOSED, INSIDE, EXTERNAL) else shlex.split(controller)
    write_parameters(scenario, parameters, own, controller=words)
    arguments = with_ros_arguments([], parameters, namespace)
    found = {RECORDER: [executable(RECORDER, RECORDER), *arguments]}
    if live:
        found[LIVE] = [executable(RECORDER, LIVE), str(work / RECORDING)]
    if controller == COMPOSED:
        return found | {"composed": [executable("afm_bringup", "composed"), *arguments]}
    found[SIMULATOR] = [executable(SIMULATOR, SIMULATOR), *arguments]
    if controller == OWN:
        found[CONTROLLER] = [executable(CONTROLLER, CONTROLLER), *arguments]
    elif words:
        found["controller"] = with_ros_arguments(words, parameters, namespace) if ros_arguments else words
    return found
