"""`ros2 run afm_bringup scorecard SCENARIO`: follow a run that was started elsewhere to its end, and score it."""

import argparse
import sys
from pathlib import Path

from rclpy.utilities import remove_ros_args

from afm_model import Scenario, ScenarioError
from afm_model.core.errors import ResultFileError, reason
from afm_model.core.outputs import require_file
from afm_node_common.runner import Stop, StopSignal

from .follow import STALL_TIMEOUT, Follower, RunFailure, check_score
from .monitor import Monitor
from .scenario_input import add_overrides, read_scenario
from .session_scorecard import print_scorecard, scorecard, write_scorecard


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="scorecard", description="Wait until a run is finished, print its scorecard and end."
    )
    parser.add_argument("scenario", help="name of the scenario that is run, or its file")
    add_overrides(parser)
    parser.add_argument("--out", type=Path, metavar="FILE", help="write the scorecard to this file")
    parser.add_argument(
        "--recorded", action="store_true", help="then wait until the recorder has received the whole run"
    )
    parser.add_argument(
        "--stall-timeout",
        type=float,
        default=STALL_TIMEOUT,
        metavar="SECONDS",
        help=f"wall time for which a controller that has been reported may stay silent (default {STALL_TIMEOUT:g})",
    )
    # remove_ros_args takes the first for the name of the program.
    return parser.parse_args(remove_ros_args(sys.argv)[1:])


def _score(arguments: argparse.Namespace, scenario: Scenario) -> None:
    """Wait for the score, print and write it.

    Raises
    ------
    RunError
        If the run did not come to its end, or its recording is incomplete.
    OSError
        If the scorecard cannot be written.
    """
    stop = Stop()

    def check() -> bool:
        if stop.requested:
            raise StopSignal
        return False

    missing = None
    with Monitor("scorecard", arguments=sys.argv) as monitor:
        follower = Follower(monitor, arguments.stall_timeout)
        while not monitor.spin_until(lambda: check() or follower.finished(), 3600.0):
            pass
        score, status = monitor.score, monitor.status
        assert score is not None and status is not None  # finished
        check_score(status)
        controller = " and ".join(status.controllers)
        own = controller.endswith("/afm_controller_node")
        card = scorecard(scenario, scenario.controller.law.kind if own else controller, score, status)
        print_scorecard(card, f"{scenario.header.title or scenario.name} ({card['plant']} plant, {card['controller']})")
        sys.stdout.flush()
        if arguments.out:
            write_scorecard(card, arguments.out)
        if arguments.recorded:
            follower.wait_until_recorded(check)
            missing = follower.missing_in_recording()
    if missing is not None:
        raise RunFailure(missing)


def main() -> int:
    """Entry point."""
    arguments = _arguments()
    code = 0
    try:
        require_file(arguments.out)
        _score(arguments, read_scenario(arguments.scenario, arguments.overrides, arguments.parts))
    except StopSignal:
        code = 130
    except ScenarioError as error:
        print(f"error: {error}", file=sys.stderr)
        code = 2
    except (RunFailure, ResultFileError) as error:
        print(f"error: {error}", file=sys.stderr)
        code = 1
    except OSError as error:
        print(f"error: {arguments.out} cannot be written: {reason(error)}", file=sys.stderr)
        code = 1
    Stop.ignore()
    return code
