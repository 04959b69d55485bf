"""`ros2 run afm_bringup replay RECORDING`: play a recorded run again in process, and compare the trajectories."""

import argparse
import warnings
from collections.abc import Sequence
from pathlib import Path

from afm_model import DivergenceError, DriveError, ParameterError, PartError
from afm_model.core.progress import bar
from afm_model.run import Replay, recorded_parameters
from afm_model.run.simulation import run
from afm_recorder_node.reader import read_recording
from afm_recorder_node.recording import IncompleteRecording, RecordingError

from .domain import end


def replay(path: Path) -> tuple[str, str, int]:
    """The trajectory_sha256 of a recorded run, that of its replay, and the number of its ticks.

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
    values = recording.parameters["afm_sim_node"].items()
    # Lists are parameters of the node, not of the instrument.
    known = {name: value for name, value in values if not isinstance(value, list)}
    parameters = recorded_parameters(known, recording.parameter_changes)
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
    parser.add_argument("recording", type=Path, help="recording of the run (.rrd)")
    path = parser.parse_args(arguments).recording
    try:
        recorded, replayed, ticks = replay(path)
    except (RecordingError, ParameterError, PartError, DriveError, DivergenceError) as error:
        return end(f"error: {path}: {error}", 1)
    if recorded != replayed:
        return end(f"error: {path}: the replay of {ticks} ticks gives {replayed}, recorded is {recorded}", 1)
    print(f"the same trajectory in all {ticks} ticks: {replayed}")
    return 0
