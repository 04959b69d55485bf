"""`python -m afm_model SCENARIO.yaml`: run a scenario in process and print its score."""

import argparse
import dataclasses
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from . import DivergenceError, DriveError, ParameterError, ScenarioError, load_scenario, simulate


def main() -> int:
    """Entry point; the exit code is 2 if the scenario was refused."""
    parser = argparse.ArgumentParser(prog="python -m afm_model", description="Run a scenario in process, without ROS.")
    parser.add_argument("scenario", type=Path, help="scenario file")
    arguments = parser.parse_args()
    try:
        scenario = load_scenario(arguments.scenario)
        run = simulate(scenario.sim, scenario.controller, progress=True)
    except (ScenarioError, ParameterError, DriveError, DivergenceError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    score = dataclasses.asdict(run.score)
    plain = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in score.items()}
    plain["scored_ticks"] = plain.pop("ticks")
    told = {"scenario": scenario.name, "ticks": len(run.time), **_without_nan(plain)}
    print(json.dumps(told | {"trajectory_sha256": run.trajectory_sha256}, indent=2, allow_nan=False))
    return 0


def _without_nan(value: object) -> Any:
    """JSON knows no NaN: null in its place."""
    if isinstance(value, dict):
        return {name: _without_nan(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(each) for each in value]
    return None if isinstance(value, float) and math.isnan(value) else value


if __name__ == "__main__":
    sys.exit(main())
