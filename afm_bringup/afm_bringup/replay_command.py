"""`ros2 run afm_bringup replay RECORDING`: play a recorded run again in process, and compare the trajectories."""

import argparse
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from afm_model import DivergenceError, DriveError, ParameterError, PartError, Scenario, ScenarioError, load_scenario
from afm_model.core.progress import bar
from afm_model.core.registry import add_parts
from afm_model.core.schema import flatten
from afm_model.run import Replay, recorded_parameters
from afm_model.run.simulation import run
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import IncompleteRecording, RecordingError

from .domain import end


def replay(path: Path, scenario: Scenario | None = None, parts: Sequence[str] = ()) -> tuple[str, str, int]:
    """Return the trajectory_sha256 of a recorded run, that of its replay, and the number of its ticks.

    Parameters
    ----------
    path : Path
        Of a recording or a bag.
    scenario : Scenario, optional
        That the run was made with, if there are no parameters in the bag.
    parts : sequence of str
        Parts of your own that the recording may choose, `module:NAME` each.

    Raises
    ------
    RecordingError
        If it cannot be read.
    ParameterError
        If its run has not come to a score, or its drives cannot be replayed.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IncompleteRecording)  # known from its score
        recording = read_recording(path)
    if recording.score is None or not recording.score.get("trajectory_sha256"):
        raise ParameterError("there is no score in it, and so no trajectory_sha256 to compare with")
    if scenario is None and "afm_sim_node" not in recording.parameters:
        raise ParameterError("there are no parameters in it: give the scenario of the run by --scenario")
    given = flatten(scenario.sim) if scenario is not None else {}
    values = {**given, **recording.parameters.get("afm_sim_node", {})}.items()
    # Lists are parameters of the node, not of the instrument.
    known = {name: value for name, value in values if not isinstance(value, list)}
    parameters = recorded_parameters(known, recording.parameter_changes, parts)
    period = parameters.plant.control_period
    if len(recording.time_ticks) > 1 and np.diff(recording.time_ticks).min() > 1.5 * period:
        raise ParameterError("not every tick was recorded: it cannot be replayed")
    with bar("replaying") as report:
        instrument = run(parameters, Replay.of(recording, parameters), progress=report)
    return str(recording.score["trajectory_sha256"]), instrument.trajectory_sha256(), instrument.ticks


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point: 0 if both are the same to the last bit."""
    parser = argparse.ArgumentParser(
        prog="replay",
        description="Play the drives of a recorded run again in process, without ROS, and compare the trajectory with "
        "the recorded one. The exit code is 0 if they are the same to the last bit.",
    )
    parser.add_argument("recording", type=Path, help="recording of the run (.mcap), or a bag of its topics")
    parser.add_argument("--scenario", help="of the run: name or file, for a bag without parameters")
    add_parts(parser)
    asked = parser.parse_args(arguments)
    path = asked.recording
    try:
        scenario = load_scenario(asked.scenario, parts=asked.parts) if asked.scenario else None
        recorded, replayed, ticks = replay(path, scenario, asked.parts)
    except (ScenarioError, RecordingError) as error:  # they name the file
        return end(f"error: {error}", 1)
    except (ParameterError, PartError, DriveError, DivergenceError) as error:
        return end(f"error: {path}: {error}", 1)
    if recorded != replayed:
        return end(f"error: {path}: the replay of {ticks} ticks gives {replayed}, recorded is {recorded}", 1)
    print(f"the same trajectory in all {ticks} ticks: {replayed}")
    return 0
