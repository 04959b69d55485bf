"""`ros2 run afm_bringup check_scenario SCENARIO`: say whether a scenario is allowed."""

import argparse
from pathlib import Path

from afm_model import ScenarioError
from afm_model.core.errors import reason

from .domain import end
from .scenario_input import add_overrides, read_scenario, write_parameters


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="check_scenario", description="Check a scenario, and write the parameters that it gives the nodes."
    )
    parser.add_argument("scenario", help="name of a scenario, or a scenario file")
    parser.add_argument(
        "--say-controller", action="store_true", help="print the process of the controller, if it says so"
    )
    add_overrides(parser)
    parser.add_argument(
        "--write", type=Path, metavar="FILE", help="write the checked parameters to FILE, for --params-file of any node"
    )
    parser.add_argument(
        "--set",
        nargs=3,
        action="append",
        default=[],
        metavar=("NODE", "NAME", "VALUE"),
        help="write this parameter too: text, true or false, which the node itself will check",
    )
    arguments = parser.parse_args()
    more: dict[str, dict[str, object]] = {}
    for node, name, value in arguments.set:
        more.setdefault(node, {})[name] = {"true": True, "false": False}.get(value, value)
    try:
        scenario = read_scenario(arguments.scenario, arguments.overrides, arguments.parts)
        if arguments.say_controller:
            print(scenario.header.controller)
        if arguments.write:
            write_parameters(scenario, arguments.write, more)
    except ScenarioError as error:
        return end(f"error: {error}", 2)
    except OSError as error:
        return end(f"error: {arguments.write} cannot be written: {reason(error)}", 1)
    return 0
