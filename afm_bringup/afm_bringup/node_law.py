"""A node as a law of a comparison: started again for every run, in lockstep over topics."""

import dataclasses
import os
import shlex
import shutil
import signal
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from afm_model import Command, DriveError, ParameterError, Scenario, SimParameters
from afm_model.core.errors import LawError, MalformedError
from afm_model.fault import faults_of
from afm_model.parameters.scenario import ALL, NAMESPACE
from afm_model.studies import Contender

from .domain import claim_domain
from .exam.procedure import Connection
from .processes import Processes
from .scenario_input import with_ros_arguments, write_parameters

_Array = NDArray[np.float64]
_NODE = "the node"
_START_TIMEOUT = 60.0
"""Wall time for a node to start and to connect [s]."""
_PATIENCE = 10.0
"""Wall time to wait for an answer [s]."""
_AGAIN = 1.0
"""Wall time after which a measurement that is not answered is sent again, as the simulator does [s]."""
_SIMULATOR, _CONTROLLER = "/**/afm_sim_node", "/**/afm_controller_node"
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class DriveConnection(Connection, Protocol):
    """How measurements reach the node, and its drives come back."""

    def take_drive(self) -> tuple[int, _Array | Command | DriveError] | None:
        """Return sequence and drive of the oldest message not yet taken; None if no message is left."""
        ...


class NodeLaw:
    """A law whose answers come from a node."""

    def __init__(self, connection: DriveConnection) -> None:
        self._connection = connection
        self._sequence = 0

    def answer(self, measurement: _Array) -> _Array | Command:
        """Drive [V], (3,), or drive and horizon; answers to other measurements are ignored.

        Raises
        ------
        LawError
            If the node has ended, does not answer, or sends a message that is no drive.
        DriveError
            If it sends a horizon that is not allowed.
        """
        connection, sequence = self._connection, self._sequence
        self._sequence += 1
        begun = sent = connection.now()
        connection.publish(sequence, measurement)
        while True:
            try:
                taken = connection.take_drive()
            except MalformedError as error:
                raise LawError(f"the answer to measurement {sequence} is no drive: {error}") from None
            if taken is not None and taken[0] == sequence:
                if isinstance(taken[1], DriveError):
                    raise taken[1]
                return taken[1]
            if problem := connection.problem():
                raise LawError(f"{problem} (measurement {sequence} is not answered)")
            now = connection.now()
            if now - begun > _PATIENCE:
                raise LawError(f"{_NODE} has not answered measurement {sequence} within {_PATIENCE:g} s")
            if now - sent > _AGAIN:
                sent = now
                connection.publish(sequence, measurement)
            if taken is None:
                connection.wait(0.05)


def node_contender(command: str, scenario: Scenario | None = None, *, ros_arguments: bool = True) -> Contender:
    """A node as a law of a comparison, named by its command.

    Parameters
    ----------
    command : str
        As it is typed in a shell.
    scenario : Scenario, optional
        Its sections are the parameters of the node, except that of the simulator.
    ros_arguments : bool
        Whether parameters and namespace are appended to the command as ROS arguments.

    Raises
    ------
    ParameterError
        If there is no such program.
    """
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise ParameterError(f"node {command} is not allowed: {error}") from None
    if not words or shutil.which(words[0]) is None:
        raise ParameterError(f"node {command!r} cannot be started: there is no program {words[0] if words else ''!r}")
    common = scenario or Scenario("default", Path("default.yaml"))
    absent: list[str] = []

    @contextmanager
    def start(sim: SimParameters) -> Iterator[NodeLaw]:
        # A node that never connects would cost a minute in every run.
        if absent:
            raise LawError(absent[0])
        with _started(words, _sections_for_node(common, sim), sim, ros_arguments, absent) as law:
            yield law

    return Contender(command, "node", {}, start)


def _sections_for_node(scenario: Scenario, sim: SimParameters) -> Scenario:
    """The parameters of a node: control period, delay, and all sections of the scenario except the simulator's."""
    timing = {"law.period": sim.plant.control_period, "law.delay_ticks": sim.plant.delay_ticks}
    sections = {key: values for key, values in scenario.sections.items() if key != _SIMULATOR}
    for key in (ALL, _CONTROLLER):
        sections[key] = sections.get(key, {}) | timing
    return dataclasses.replace(scenario, sections=sections)


@contextmanager
def _started(
    command: list[str], scenario: Scenario, sim: SimParameters, ros_arguments: bool, absent: list[str]
) -> Iterator[NodeLaw]:
    """Start the node in a separate ROS domain and connect it; end it at the exit.

    `absent` receives the reason if it does not connect.
    """
    from .exam.connection import TopicConnection  # here: a second, which laws in process do not need

    if any(each.kind == "loss" and each.signal == "measurement" for each in faults_of(sim).values()):
        raise LawError(f"{_NODE} cannot be compared under a fault that loses measurements: compare it with session")
    with _interruptible(), _domain_of_its_own(), tempfile.TemporaryDirectory() as folder, Processes(last="") as nodes:
        parameters = Path(folder) / "parameters.yaml"
        write_parameters(scenario, parameters, controller=command)
        if ros_arguments:
            command = with_ros_arguments(command, parameters, f"/{NAMESPACE}")
        with TopicConnection(NAMESPACE, sim, nodes) as connection:
            try:
                nodes.start(_NODE, command, Path(folder) / "log")
            except OSError as error:
                raise LawError(f"{_NODE} could not be started: {error.strerror}") from None
            if not connection.connect(_START_TIMEOUT):
                if ended := connection.problem():
                    raise LawError(ended)
                absent.append(connection.incompatible() or f"{_NODE} does not connect: {connection.missing()}")
                raise LawError(absent[0])
            nodes.note_shared_memory()
            yield NodeLaw(connection)


@contextmanager
def _domain_of_its_own() -> Iterator[None]:
    """A free ROS domain, in force for what is started here."""
    before = os.environ.get("ROS_DOMAIN_ID")
    try:
        domain, claim = claim_domain()
    except RuntimeError as error:
        raise LawError(str(error)) from None
    os.environ["ROS_DOMAIN_ID"] = str(domain)
    try:
        with claim:
            yield
    finally:
        if before is None:
            del os.environ["ROS_DOMAIN_ID"]
        else:
            os.environ["ROS_DOMAIN_ID"] = before


@contextmanager
def _interruptible() -> Iterator[None]:
    """The first signal to end raises KeyboardInterrupt, so that the node is ended; further ones do not disturb that."""
    # nohup has a program ignore SIGHUP: that stays.
    ours = {each: handler for each in _SIGNALS if (handler := signal.getsignal(each)) not in (None, signal.SIG_IGN)}

    def interrupt(number: int, frame: object) -> None:
        for each in ours:
            signal.signal(each, signal.SIG_IGN)
        raise KeyboardInterrupt

    for each in ours:
        signal.signal(each, interrupt)
    try:
        yield
    finally:
        for each, handler in ours.items():
            signal.signal(each, handler)
