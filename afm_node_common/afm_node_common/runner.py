"""Running a node as a process: start, loop, clean end."""

import gc
import signal
import sys
import time
from collections.abc import Callable, Sequence
from itertools import cycle
from pathlib import Path
from typing import Protocol, runtime_checkable

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from afm_model.core import registry
from afm_model.core.errors import ParameterError, PartError
from afm_model.core.schema import with_parts
from afm_model.parameters import ControllerParameters, Group, InstrumentParameters, SetupSection, specifications

from . import scheduling
from .answers import hold_answers
from .barrier import guard_services
from .process import Process
from .shared_memory import make_private, shared_memory_cleanup
from .waiting import Waiting

RCLError = rclpy_implementation.RCLError
SERVE_PERIOD = 0.02
"""Wall time between two calls of `serve_periodic` [s]."""
LOOK_PERIOD = 0.005
"""Wall time between two looks at timers, parameters, services and actions [s]; the nodes take turns.

A loop that waits for deadlines looks right after a tick, at the latest when this has passed twice.
"""
NEXT_LOOK = 0.001
"""The same after a look that has found something, at the same node [s]: a goal and its result take several looks."""
_EVENTS_EVERY = 200
"""Events of the middleware are looked at in one of so many looks: once a second."""


@runtime_checkable
class Looping(Protocol):
    """A node with a loop in addition to what its executor serves."""

    def step(self) -> bool:
        """Do what can be done without waiting; False if there was nothing to do."""
        ...

    def wait(self, timeout: float) -> None:
        """Sleep until there may be something to do, or for `timeout` seconds of wall time."""
        ...

    def serve_periodic(self) -> None:
        """Do a little of what has to be done now and then; called every SERVE_PERIOD."""
        ...


@runtime_checkable
class Finishing(Protocol):
    """A node that has to put something in order before it ends."""

    def finish(self, spin_once: Callable[[float], None]) -> None:
        """Called once, with the context still valid; `spin_once(timeout)` serves one callback."""
        ...


@runtime_checkable
class Scheduled(Protocol):
    """A node whose loop asks something of the operating system."""

    process: Process


@runtime_checkable
class HasExitCode(Protocol):
    """A node that may end in failure although nothing was raised."""

    exit_code: int


class StopSignal(Exception):
    """SIGINT, SIGTERM or SIGHUP has come."""


class Stop:
    """Turns SIGINT, SIGTERM and SIGHUP into a flag, so that the loop ends between two steps and never in the middle."""

    SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)

    def __init__(self) -> None:
        self.requested = False
        for number in self.SIGNALS:
            # nohup has a program ignore SIGHUP: that stays.
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, self._request)

    def _request(self, number: int, frame: object) -> None:
        self.requested = True

    @classmethod
    def ignore(cls) -> None:
        """Ignore them from now on: while Python itself ends, one more would find its default action, to kill."""
        for number in cls.SIGNALS:
            signal.signal(number, signal.SIG_IGN)


def usage(name: str, model: type[Group]) -> str:
    """The text of `--help`: every parameter with default, unit, description and what is allowed."""
    lines = [f"usage: {name} [--ros-args -p NAME:=VALUE ... --params-file FILE]", "", "parameters:"]
    told = list(specifications(model))
    # What the microscope is may be said once, for simulator and controller alike.
    if issubclass(model, InstrumentParameters | ControllerParameters):
        told += specifications(SetupSection)
    for spec in told:
        unit = "" if spec.unit == "1" else f" {spec.unit}"
        lines.append(f"  {spec.name} := {spec.default}{unit}")
        lines.append(f"      {spec.description} ({spec.allowed})")
    return "\n".join(lines)


def chosen_kinds(arguments: Sequence[str]) -> dict[str, str]:
    """Return the parts that a command line chooses (`-p law.kind:=my_package:LAW`); `--help` lists their parameters."""
    assigned = (argument.partition(":=") for argument in arguments if ":=" in argument)
    return {name: value for name, _, value in assigned if name.endswith(".kind")}


def run(make_node: Callable[[], Node], model: type[Group], args: Sequence[str] | None = None) -> int:
    """Run one node until SIGINT, SIGTERM or SIGHUP; see `run_together`."""
    return run_together([(make_node, model)], args)


def run_together(nodes: Sequence[tuple[Callable[[], Node], type[Group]]], args: Sequence[str] | None = None) -> int:
    """Run nodes in this process and thread until SIGINT, SIGTERM or SIGHUP.

    Parameters
    ----------
    nodes : sequence of (callable, type[Group])
        What makes each node, called after rclpy is ready, and the node's parameters, for `--help`.
    args : sequence of str, optional
        Command line; `sys.argv` if not given.

    Returns
    -------
    int
        Exit code: 0 after a clean end, that of the node that failed, 2 if the command line or a parameter was refused.
    """
    arguments = sys.argv[1:] if args is None else list(args)
    if "--help" in arguments or "-h" in arguments:
        try:
            models = [with_parts(model, chosen_kinds(arguments)) for _, model in nodes]
        except ParameterError as error:
            print(f"error: {error}", file=sys.stderr)
            return 2
        print("\n\n".join(usage(Path(sys.argv[0]).stem, model) for model in models))
        return 0
    stop = Stop()
    try:
        rclpy.init(args=None if args is None else arguments, signal_handler_options=SignalHandlerOptions.NO)
    except (RuntimeError, ValueError) as error:
        # A parameter file that does not exist, a rule that cannot be parsed: rcl tells it in its first line.
        print(f"error: {str(error).splitlines()[0]}", file=sys.stderr)
        return 2
    # remove_ros_args takes the first for the name of the program.
    _, *unknown = remove_ros_args(["", *arguments])
    if unknown:
        print(f"error: unknown argument {unknown[0]}: parameters go after --ros-args, see --help", file=sys.stderr)
        rclpy.try_shutdown()
        return 2
    made: list[Node] = []
    try:
        executor = SingleThreadedExecutor()
        for make_node, _ in nodes:
            made.append(make_node())
            make_private()
            guard_services(made[-1])
            hold_answers(made[-1])
            executor.add_node(made[-1])

        def spin_once(timeout: float) -> None:
            executor.spin_once(timeout_sec=timeout)

        # Collect once now and keep what exists out of every later collection: the loop makes next to no garbage.
        gc.collect()
        gc.freeze()
        for node in made:
            if isinstance(node, Scheduled):
                for part in registry.listed(node.process.parts):
                    registry.load(part)
                scheduling.apply(node.process, node.get_logger().warning)
        registry.close()
        _loop(made, spin_once, stop)
        for node in made:
            if isinstance(node, Finishing):
                node.finish(spin_once)
        return max(node.exit_code if isinstance(node, HasExitCode) else 0 for node in made)
    except (ParameterError, PartError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2 if isinstance(error, ParameterError) else 1
    except RCLError as error:
        # No memory, no place for a node, a middleware without what was asked of it.
        print(f"error: {str(error).splitlines()[0]}", file=sys.stderr)
        return 1
    except ExternalShutdownException:
        return 0
    finally:
        with shared_memory_cleanup():
            for node in made:
                node.destroy_node()
            rclpy.try_shutdown()
        stop.ignore()


def _loop(made: Sequence[Node], spin_once: Callable[[float], None], stop: Stop) -> None:
    """Step as fast as there is something to do; serve the rest now and then."""
    nodes = [node for node in made if isinstance(node, Looping)]
    if not nodes:
        while not stop.requested:
            spin_once(0.1)
        return
    # One node at a time: a look at several is felt in a loop of 20 kHz.
    looks = cycle([Waiting([node], _EVENTS_EVERY) for node in made])
    waiting = next(looks)
    # One node alone sleeps until its next message. With several, a message for another one must not wait for it.
    patience = LOOK_PERIOD if len(nodes) == 1 else 0.001
    serve_at, look_at = 0.0, 0.0
    steps = [node.step for node in nodes]
    while not stop.requested:
        busy = False
        for step in steps:
            if step():
                busy = True
        if not busy:
            nodes[0].wait(patience)
        now = time.monotonic()
        # Right after a tick there is time for it, right before the next one there may not be.
        if now >= serve_at and (busy or now >= serve_at + SERVE_PERIOD):
            for node in nodes:
                node.serve_periodic()
            serve_at = now + SERVE_PERIOD
            if busy:
                continue
        if now >= look_at and (busy or now >= look_at + LOOK_PERIOD):
            found = waiting()
            if found or waiting.unfinished:
                spin_once(0.0)
            look_at = now + (NEXT_LOOK if found else LOOK_PERIOD)
            if not found:
                waiting = next(looks)
