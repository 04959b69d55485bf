"""`afm nanonis SCENARIO`: serve a microscope in this process at the ports of the protocol."""

import argparse
import signal
import sys
import threading
import warnings
from collections.abc import Sequence
from pathlib import Path

from afm_model import ParameterError, ScenarioError
from afm_model.core.errors import VerbError
from afm_model.core.registry import add_parts
from afm_model.microscope import Live, Microscope
from afm_model.parameters.scenario import load_scenario

from .front import Front
from .server import ADDRESS, PORTS, STREAM_PORT, Server


def options(prog: str, description: str) -> argparse.ArgumentParser:
    """What a server is started with, in this process or in front of another one."""
    parser = argparse.ArgumentParser(prog=prog, description=description)
    parser.add_argument("scenario", nargs="?", default="two_materials", help="name of a scenario, or a scenario file")
    parser.add_argument("--ports", default=",".join(map(str, PORTS)), help="of commands, separated by commas")
    parser.add_argument("--stream-port", type=int, default=STREAM_PORT, help="of the data stream")
    parser.add_argument("--address", default=ADDRESS, help="on which to listen; 0.0.0.0: for other machines, too")
    parser.add_argument("--out", type=Path, default=Path("out/nanonis"), help="folder of the files that are saved")
    parser.add_argument("--engaged", action="store_true", help="approach before any client comes")
    parser.add_argument("--errors", choices=["fields", "real"], default="fields", help="layout of errors")
    add_parts(parser)
    return parser


def _ports(words: str) -> list[int]:
    """Ports that are separated by commas."""
    found = [int(word) if word.strip().isdecimal() else -1 for word in words.split(",")]
    if not all(0 <= port < 1 << 16 for port in found):
        raise ParameterError(
            f"--ports = {words} is not allowed: ports from 0 (a free one) to 65535, with commas between"
        )
    return found


def serve(front: Front, arguments: argparse.Namespace) -> None:
    """Listen until Ctrl-C, or a request to end."""
    ports = _ports(arguments.ports)
    # Remarks about results have no place in the protocol; filters are those of all threads.
    warnings.simplefilter("ignore", UserWarning)
    if arguments.address not in (ADDRESS, "localhost", "::1"):
        print(
            f"warning: on {arguments.address} everybody who reaches this machine can operate the microscope and write "
            f"files",
            file=sys.stderr,
        )
    server = Server(front, ports, arguments.stream_port, arguments.address, real_errors=arguments.errors == "real")
    try:
        print(
            f"listening on {arguments.address}, ports {', '.join(map(str, server.ports))}; data stream "
            f"{server.stream_port}; files in {front.folder}; end with Ctrl-C",
            flush=True,
        )
        if threading.current_thread() is threading.main_thread():
            # As Ctrl-C: the tip is withdrawn before the end.
            signal.signal(signal.SIGTERM, signal.default_int_handler)
        threading.Event().wait()
    except KeyboardInterrupt:
        pass
    finally:
        server.close()
        front.close()


def main(given: Sequence[str] | None = None) -> int:
    """Entry point; the exit code is 2 if something was refused."""
    parser = options("afm nanonis", "A virtual microscope that speaks the Nanonis TCP protocol, without ROS.")
    parser.add_argument("--factor", type=float, default=0.0, help="simulated time over wall time; 0: of the scenario")
    arguments = parser.parse_args(given)
    run = {"mode": "realtime"} | ({"real_time_factor": arguments.factor} if arguments.factor else {})
    try:
        arguments.out.mkdir(parents=True, exist_ok=True)
        scenario = load_scenario(arguments.scenario, parts=arguments.parts)
        with Microscope(scenario, engaged=arguments.engaged, run=run) as microscope:
            assert isinstance(microscope.backend, Live)
            serve(Front(microscope, microscope.backend.instrument.parameters, arguments.out.absolute()), arguments)
    except (ScenarioError, ParameterError, VerbError, OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0
