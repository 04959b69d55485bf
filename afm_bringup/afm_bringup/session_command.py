"""The command line of `session`."""

import argparse
import shlex
import sys
from pathlib import Path

from rclpy.exceptions import InvalidNamespaceException
from rclpy.validate_namespace import validate_namespace

from afm_model import Scenario, ScenarioError
from afm_node_common import topics
from afm_node_common.runner import StopSignal

from .domain import NoDomainError, claimed_domain, end
from .follow import STALL_TIMEOUT
from .run_session import RunSession
from .scenario_input import add_live, add_overrides, foreign_sections, read_scenario
from .session_nodes import COMPOSED, EXTERNAL, OWN
from .session_start import SessionError


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="session", description="Run a scenario and leave recording, picture, score.")
    parser.add_argument("scenario", help="name of a scenario, or a scenario file")
    parser.add_argument("--out", required=True, type=Path, help="folder for the results")
    parser.add_argument(
        "--controller",
        metavar="COMMAND",
        help="start this command as the controller in place of afm_controller_node; it is given the parameters of the "
        "scenario and the namespace (--ros-args --params-file FILE -r __ns:=NAMESPACE); 'external': start none and "
        "wait; 'composed': ours, in the simulator's process; '': ours, in its own (default: as the scenario says)",
    )
    parser.add_argument(
        "--no-ros-args",
        action="store_false",
        dest="ros_arguments",
        help="give COMMAND no arguments but its own",
    )
    parser.add_argument(
        "--composed",
        action="store_const",
        const=COMPOSED,
        dest="controller",
        help="simulator and controller in one process, on the same topics",
    )
    parser.add_argument(
        "--no-picture",
        action="store_false",
        dest="picture",
        help="draw no overview.png: saves a second of processor time, for many sessions in a row",
    )
    add_overrides(parser)
    add_live(parser)
    parser.add_argument(
        "--namespace",
        default=topics.NAMESPACE,
        help=f"namespace of the instrument, in place of {topics.NAMESPACE}: for two at a time in one ROS domain",
    )
    parser.add_argument(
        "--stall-timeout",
        type=float,
        default=STALL_TIMEOUT,
        metavar="SECONDS",
        help="wall time for which a controller may stay silent after this was reported, or the run may be withdrawn or "
        f"held, before the session ends (default {STALL_TIMEOUT:g})",
    )
    return parser.parse_args()


def _checked(arguments: argparse.Namespace) -> Scenario:
    """Read the scenario; raises ScenarioError if it is not valid, ValueError for an argument that is not allowed."""
    controller, namespace = arguments.controller, arguments.namespace
    try:
        if controller and not shlex.split(controller):
            raise ValueError("it is empty")
    except ValueError as error:
        raise ValueError(f"--controller {controller!r} is no command: {error}") from None
    try:
        validate_namespace(f"/{namespace.strip('/')}")
    except InvalidNamespaceException as error:
        raise ValueError(f"--namespace {namespace} is not allowed: {' '.join(str(error).split())}") from None
    if not arguments.stall_timeout >= 0.0:
        raise ValueError(f"--stall-timeout {arguments.stall_timeout:g} s is not allowed: it must be >= 0 s")
    scenario = read_scenario(arguments.scenario, arguments.overrides, arguments.parts)
    if scenario.sim.total_ticks == 0:
        raise ScenarioError(f"{scenario.path}: run.duration = 0 s is not allowed in a session: it must be > 0 s")
    return scenario


def main() -> int:
    """Entry point of `ros2 run afm_bringup session`."""
    arguments = _arguments()
    try:
        scenario = _checked(arguments)
        if arguments.controller is None:
            arguments.controller = scenario.header.controller
        if arguments.controller in (OWN, COMPOSED):
            for key in foreign_sections(scenario):
                print(f"note: section {key} of {scenario.path} is for no node of this session", file=sys.stderr)
        # A controller that is started elsewhere must find the instrument. Kept until the end of this process.
        claim = None if arguments.controller == EXTERNAL else claimed_domain("this session")
        RunSession(
            scenario,
            arguments.out,
            arguments.controller,
            namespace=arguments.namespace,
            ros_arguments=arguments.ros_arguments,
            stall_timeout=arguments.stall_timeout,
            picture=arguments.picture,
            live=arguments.live,
        ).run()
    except StopSignal:
        return end("interrupted", 130)
    except ValueError as error:
        return end(f"error: {error}", 2)
    except (SessionError, NoDomainError) as error:
        return end(f"error: {error}", 1)
    del claim
    return 0
