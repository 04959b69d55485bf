"""`afm SCENARIO`, `python -m afm_model SCENARIO`: run it and print its score; `afm COMMAND`: see `command`."""

import argparse
import json
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib.metadata import entry_points

from . import (
    DivergenceError,
    DriveError,
    ParameterError,
    PartError,
    ScenarioError,
    __version__,
    load_scenario,
    scenario_names,
    simulate,
)
from .core.progress import bar
from .core.registry import add_parts
from .instrument.scorecard import scorecard
from .law import TimingWarning
from .studies.start_checks import start_warnings


def command(name: str) -> Callable[[Sequence[str]], int] | None:
    """The command that an installed package offers by this name, an entry point of the group `afm_model.command`."""
    for point in entry_points(group="afm_model.command", name=name):
        found: Callable[[Sequence[str]], int] = point.load()
        return found
    return None


def main() -> int:
    """Entry point; the exit code is 2 if the scenario was refused."""
    if len(sys.argv) > 1 and (other := command(sys.argv[1])) is not None:
        return other(sys.argv[2:])
    parser = argparse.ArgumentParser(prog="python -m afm_model", description="Run a scenario in process, without ROS.")
    parser.add_argument("--version", action="version", version=f"afm {__version__}")
    parser.add_argument("scenario", help=f"one of {', '.join(scenario_names())}, or a file")
    add_parts(parser)
    arguments = parser.parse_args()
    try:
        scenario = load_scenario(arguments.scenario, parts=arguments.parts)
        for sentence in start_warnings(scenario.sim, scenario.controller):
            print(f"warning: {sentence}", file=sys.stderr)
        with warnings.catch_warnings(), bar("simulating") as report:
            warnings.simplefilter("ignore", TimingWarning)  # told already
            run = simulate(scenario.sim, scenario.controller, progress=report)
    except (ScenarioError, ParameterError, PartError, DriveError, DivergenceError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    card = {
        "scenario": scenario.name,
        "valid": not run.doubts,
        "reason": "; ".join(run.doubts),
        "ticks": len(run.time),
    } | ({"remark": run.remark} if run.remark else {})
    card |= scorecard(run.score)
    print(json.dumps(card | {"trajectory_sha256": run.trajectory_sha256}, indent=2, allow_nan=False))
    return 0


if __name__ == "__main__":
    sys.exit(main())
