"""`ros2 run afm_bringup check_controller -- COMMAND`: whether a controller keeps the contract, rule by rule."""

import argparse
import shlex
import signal
import sys
import tempfile
import time
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from afm_model import Scenario, ScenarioError
from afm_model.core.errors import reason
from afm_model.core.registry import add_parts
from afm_node_common import topics
from afm_node_common.runner import StopSignal

from .domain import claimed_domain, end
from .exam.connection import MATCHED, TopicConnection
from .exam.judgement import RuleResult, Verdict, exit_code, judge
from .exam.log import Log
from .exam.procedure import LONG_TICKS, Procedure
from .exam.rules import Terms
from .processes import Processes
from .scenario_input import read_scenario, with_ros_arguments, write_parameters

_CONTROLLER = "the controller"
_END_TIME = 10.0
"""Time that a controller has to end after SIGINT [s]."""
_START_TIMEOUT = 60.0
_COLORS = {RuleResult.KEPT: "green", RuleResult.BROKEN: "red", RuleResult.UNTESTED: "dim"}


def _interrupt(number: int, frame: object) -> None:
    raise StopSignal


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="check_controller",
        usage="%(prog)s [options] -- COMMAND ...",
        description="Start a controller, examine it, and say rule by rule whether it keeps the contract of a drive. "
        "Exit status: 0 if it does, 1 if it does not, 2 if it could not be tested.",
    )
    parser.add_argument(
        "command",
        nargs="+",
        metavar="COMMAND",
        help="command that starts the controller, with its arguments, after --",
    )
    parser.add_argument(
        "--scenario",
        default="closed_loop_tanh",
        help="scenario whose instrument is used, and whose parameters the controller is given (default %(default)s)",
    )
    parser.add_argument(
        "--deadline",
        type=float,
        default=0.2,
        metavar="SECONDS",
        help="time in which an answer must be there, not counting waits for a processor (default %(default)s, as "
        "run.watchdog_timeout)",
    )
    parser.add_argument(
        "--measurements",
        type=int,
        default=LONG_TICKS,
        metavar="N",
        help="length of the long run (default %(default)s)",
    )
    parser.add_argument(
        "--no-feedback", action="store_false", dest="feedback", help="it does not follow the reference, on purpose"
    )
    parser.add_argument(
        "--no-repeat", action="store_false", dest="repeats", help="it keeps something over a reset, on purpose"
    )
    parser.add_argument(
        "--no-ros-args", action="store_false", dest="ros_arguments", help="give COMMAND no arguments but its own"
    )
    parser.add_argument("--log", type=Path, metavar="FILE", help="write the output of the controller to this file")
    add_parts(parser)
    return parser.parse_args()


def main() -> int:
    """Entry point of `ros2 run afm_bringup check_controller`."""
    arguments = _arguments()
    # One word with blanks is a command as `session --controller` takes it.
    command = shlex.split(arguments.command[0]) if len(arguments.command) == 1 else arguments.command
    try:
        if not command:
            raise ValueError("COMMAND is empty")
        if not arguments.deadline > 0.0:
            raise ValueError(f"--deadline {arguments.deadline:g} s is not allowed: it must be > 0 s")
        if arguments.measurements < 1000:
            raise ValueError(f"--measurements {arguments.measurements} is not allowed: it must be >= 1000")
        scenario = read_scenario(arguments.scenario, parts=arguments.parts)
        claim = claimed_domain()
    except (ScenarioError, ValueError, RuntimeError) as error:
        return end(f"error: {error}", 2)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, _interrupt)
    terms = Terms(scenario.sim, arguments.deadline, arguments.feedback, arguments.repeats)
    try:
        log = _examine(scenario, command, arguments)
    except StopSignal:
        return end("interrupted", 130)
    except OSError as error:
        if arguments.log is not None and error.filename == str(arguments.log):
            print(f"error: --log {arguments.log} cannot be written: {reason(error)}", file=sys.stderr)
        else:
            print(
                f"error: the controller could not be started: {shlex.join(command)}: {reason(error)}", file=sys.stderr
            )
        return 2
    del claim
    verdicts = judge(log, terms)
    _show(verdicts, shlex.join(command), len(log.sent))
    return exit_code(verdicts, log)


def _examine(scenario: Scenario, command: list[str], arguments: argparse.Namespace) -> Log:
    """Start the controller, test it, end it; its output goes to a file, if one is given."""
    printed: Path | None = arguments.log
    with tempfile.TemporaryDirectory() as folder, Processes(last="") as processes:
        parameters = Path(folder) / "parameters.yaml"
        write_parameters(scenario, parameters, controller=command)
        if arguments.ros_arguments:
            command = with_ros_arguments(command, parameters, f"/{topics.NAMESPACE}")
        with TopicConnection(topics.NAMESPACE, scenario.sim, processes) as connection:
            processes.start(_CONTROLLER, command, printed or Path(folder) / "log")
            print(f"waiting for the controller, {_START_TIMEOUT:g} s at most ...", file=sys.stderr, flush=True)
            if not connection.connect(_START_TIMEOUT, MATCHED):
                incompatible = connection.incompatible()
                ended = connection.problem()
                return Log(
                    ended=ended, incompatible=incompatible, absent="" if incompatible or ended else connection.missing()
                )
            processes.note_shared_memory()
            print("it is connected; the examination takes a minute ...", file=sys.stderr, flush=True)
            log = Procedure(connection, scenario.sim, arguments.measurements).run()
            if not log.ended:
                log.went = _ends(processes, connection)
    return log


def _ends(processes: Processes, connection: TopicConnection) -> bool:
    """Whether the controller ends when it is interrupted."""
    processes.ask_to_end()
    limit = connection.now() + _END_TIME
    while processes.ended() is None:
        if connection.now() > limit:
            return False
        time.sleep(0.02)
    return True


def _show(verdicts: list[Verdict], title: str, asked: int) -> None:
    """Print the table."""
    console = Console(width=None if Console().is_terminal else 120)
    console.print(escape(title))
    table = Table()
    for heading in ("rule", "", "why"):
        table.add_column(heading)
    for each in verdicts:
        color = _COLORS[each.outcome]
        table.add_row(each.rule, f"[{color}]{each.outcome.value}[/{color}]", escape(each.reason))
    console.print(table)
    broken = sum(each.outcome is RuleResult.BROKEN for each in verdicts)
    untested = sum(each.outcome is RuleResult.UNTESTED for each in verdicts)
    kept = len(verdicts) - broken - untested
    console.print(f"Rules: {kept} kept, {broken} broken, {untested} not tested; {asked} measurements.")
