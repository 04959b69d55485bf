"""`ros2 run afm_bringup session SCENARIO --out DIR`: run a scenario from start to score."""

import math
import os
import shlex
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from afm_model import Scenario
from afm_model.core.schema import flatten
from afm_model.studies.start_checks import implausible, start_warnings
from afm_node_common import topics
from afm_node_common.runner import Interrupted

from .files import executable
from .follow import STALL_TIMEOUT, Follower, RunError, check_score
from .monitor import Monitor
from .processes import Processes
from .results import kinds, law_of, print_scorecard, scorecard, write_scorecard
from .results_folder import CARD, PICTURE, RECORDING, FolderError, ResultsFolder
from .scenario_input import write_parameters

_START_TIMEOUT = 180.0
"""Wall time without progress of the start, on an idle machine; a first start compiles the kernels [s]."""
_SAY_PERIOD = 20.0
"""Wall time after which a start that takes longer is told, again and again [s]."""
_DISCOVERY_TIME = 1.0
"""Wall time for the discovery of nodes that already run, before anything is started [s]."""
_INCOMPATIBLE_TIME = 2.0
"""Wall time after which a controller that the middleware does not connect ends the session [s]: discovery is over."""
_OVERVIEW_TICKS = 250_000
"""Ticks that the picture shows at most; of a longer run one in several."""
_RECORDER, _SIMULATOR, _CONTROLLER = "afm_recorder_node", "afm_sim_node", "afm_controller_node"
OWN, COMPOSED, INSIDE, EXTERNAL = "", "composed", "inside", "external"
"""Controllers that are no command: our node in its own process, our node in the simulator's process, a law in the
simulator itself, a node that was started elsewhere."""
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class SessionError(RuntimeError):
    """Why a session failed, in one sentence."""


class Session:
    """One run of a scenario in separate processes.

    Parameters
    ----------
    scenario : Scenario
    out : Path
        Folder of the results.
    controller : str
        Command of the controller to start, or OWN, COMPOSED, INSIDE or EXTERNAL.
    namespace : str
        Namespace of the instrument: two instruments in one ROS domain need two.
    ros_arguments : bool
        Whether parameters and namespace are appended to the command as ROS arguments.
    stall_timeout : float
        Wall time for which a controller may stay silent after it was reported [s].
    picture : bool
        Whether the overview is drawn.
    """

    names: tuple[str, ...] = (PICTURE, CARD)
    """Names of the result files other than the recording."""

    def __init__(
        self,
        scenario: Scenario,
        out: Path,
        controller: str = OWN,
        *,
        namespace: str = topics.NAMESPACE,
        ros_arguments: bool = True,
        stall_timeout: float = STALL_TIMEOUT,
        picture: bool = True,
    ) -> None:
        self._scenario = scenario
        self._out = out
        self._controller = controller
        self._namespace = namespace
        self._ros_arguments = ros_arguments
        self._stall_timeout = stall_timeout
        self._picture = picture
        self._console = Console(stderr=True)
        self._interrupted = False

    def run(self) -> None:
        """Run and leave the results in `out`.

        Raises
        ------
        SessionError
            If anything failed. An unfinished run leaves no file with a final name; its recording stays in a folder
            `unfinished-...` in `out`, and recordings of the previous run in `previous-...`.
        Interrupted
            If SIGINT, SIGTERM or SIGHUP came; the recording up to there is kept.
        """
        sim = self._scenario.sim
        if self._controller in (OWN, COMPOSED):
            warnings = start_warnings(sim, self._scenario.controller)
        else:
            warnings = implausible(sim)
        for sentence in warnings:
            say(f"warning: {sentence}")
        for number in _SIGNALS:
            # nohup has a program ignore SIGHUP: that stays.
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
                signal.signal(number, self._interrupt)
        try:
            with ResultsFolder(self._out, self.names) as folder:
                self._run(folder)
        except (RunError, FolderError) as error:
            raise SessionError(str(error)) from None
        except OSError as error:
            # A terminal that is gone takes no output either.
            if self._interrupted:
                raise Interrupted from None
            raise SessionError(f"{error.filename or self._out} cannot be written: {error.strerror}") from None
        finally:
            # While Python itself ends, a second Ctrl-C would find its default action: to kill.
            for number in _SIGNALS:
                signal.signal(number, signal.SIG_IGN)

    def _run(self, folder: ResultsFolder) -> None:
        try:
            with Processes(last=_RECORDER) as processes, Monitor("session", self._namespace) as monitor:
                self._folder, self._processes, self._monitor = folder, processes, monitor
                follower = Follower(monitor, self._stall_timeout)
                self._refuse_company()
                self._start()
                folder.set_older_aside()
                self._wait_until_ready()
                self._watch(follower)
                follower.wait_until_recorded(self._check_alive)
            self._finish(follower.missing_in_recording())
        except Interrupted:
            for path in folder.publish(complete=False):
                say(f"The recording up to here: {path}")
            raise
        finally:
            if folder.left:
                say(f"What was recorded is kept: {', '.join(map(str, folder.left))}")

    def _interrupt(self, number: int, frame: object) -> None:
        self._interrupted = True

    # What is checked all the time.

    def _check_alive(self) -> bool:
        """Raise if a signal has come, one of our processes has ended, or the folder is gone; False otherwise."""
        if self._interrupted:
            raise Interrupted
        ended = self._processes.ended()
        # First: nodes may end because of it.
        if not self._folder.there:
            raise SessionError(f"{self._out} was removed while the session ran: it has no place for results any more")
        if ended is not None:
            raise SessionError(ended)
        return False

    def _check(self, *, simulators: int = 1, controllers: int = 1) -> bool:
        """Raise also if there are more instruments or controllers than there should be; False otherwise."""
        self._check_alive()
        monitor = self._monitor
        for what, there, allowed in (
            ("instrument", monitor.simulators, simulators),
            ("controller", monitor.controllers, controllers),
        ):
            if there > allowed:
                raise SessionError(
                    f"another {what} runs on {monitor.namespace} in ROS domain {os.environ.get('ROS_DOMAIN_ID') or 0}: "
                    "end it, or take another --namespace or ROS_DOMAIN_ID"
                )
        return False

    # From start to end.

    def _refuse_company(self) -> None:
        """Two instruments on the same topics would answer each other's controllers."""
        external = int(self._controller == EXTERNAL)
        self._monitor.spin_until(lambda: self._check(simulators=0, controllers=external), _DISCOVERY_TIME)

    def _start(self) -> None:
        work = self._folder.work
        for name, command in self._commands(work).items():
            if name in (_CONTROLLER, "controller"):
                # It would answer any simulator: by now ours must be the only one.
                self._wait_for_simulator()
            try:
                self._processes.start(name, command, work / f"{name}.log")
            except OSError as error:
                raise SessionError(f"{name} could not be started: {' '.join(command)}: {error.strerror}") from None

    def _commands(self, work: Path) -> dict[str, list[str]]:
        """Commands of the processes to start, by name."""
        parameters = work / "parameters.yaml"
        own: dict[str, dict[str, object]] = {
            _SIMULATOR: {"run.start_paused": True, "run.exit_when_finished": False},
            _RECORDER: {"path": str(work / RECORDING)},
        }
        if self._controller == INSIDE:
            law = flatten(self._scenario.controller.law)
            own[_SIMULATOR] |= {f"law.{name}": value for name, value in law.items()}
        write_parameters(self._scenario, parameters, own)
        arguments = ["--ros-args", "--params-file", str(parameters), "-r", f"__ns:={self._monitor.namespace}"]
        commands = {_RECORDER: [executable(_RECORDER, _RECORDER), *arguments]}
        if self._controller == COMPOSED:
            commands["composed"] = [executable("afm_bringup", "composed"), *arguments]
            return commands
        commands[_SIMULATOR] = [executable(_SIMULATOR, _SIMULATOR), *arguments]
        if self._controller == OWN:
            commands[_CONTROLLER] = [executable(_CONTROLLER, _CONTROLLER), *arguments]
        elif self._controller not in (INSIDE, EXTERNAL):
            commands["controller"] = [*shlex.split(self._controller), *(arguments if self._ros_arguments else ())]
        return commands

    def _wait_for(self, there: Callable[[], bool], missing: Callable[[], str]) -> None:
        """Wait, and tell what for; no longer than `_START_TIMEOUT` without a change of what is missing."""
        told, since = missing(), time.monotonic()
        while not self._monitor.spin_until(there, _SAY_PERIOD):
            now, before, told = time.monotonic(), told, missing()
            since = since if told == before else now
            # A machine with so much to do gives each process so much less.
            limit = _START_TIMEOUT * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
            # Only an external controller may take longer.
            patient = self._controller == EXTERNAL and told.startswith("a controller")
            if now > since + limit and not patient:
                raise SessionError(f"waited {now - since:.0f} s for {told}")
            say(f"Still waiting for {told} ...")

    def _wait_for_simulator(self) -> None:
        self._wait_for(lambda: self._check(controllers=0) or self._monitor.simulators > 0, lambda: "the simulator")

    def _wait_until_ready(self) -> None:
        monitor, external = self._monitor, self._controller == EXTERNAL
        incompatible, since = "", 0.0

        def ready() -> bool:
            nonlocal incompatible, since
            self._check()
            before, incompatible = incompatible, monitor.incompatible
            if incompatible != before:
                since = time.monotonic()
                if external and incompatible:
                    say(f"Waiting: {incompatible}")
            elif incompatible and not external and time.monotonic() > since + _INCOMPATIBLE_TIME:
                raise SessionError(incompatible)
            return monitor.ready

        with self._console.status("Starting the nodes ...") if self._console.is_terminal else _nothing():
            self._wait_for(ready, lambda: monitor.missing)
            self._processes.note_shared_memory()
            if not monitor.play(_START_TIMEOUT):
                raise SessionError("the simulator does not answer its play service")

    def _watch(self, follower: Follower) -> None:
        """Follow the run to its end."""
        # An external controller may be replaced while we run.
        controllers = 2 if self._controller == EXTERNAL else 1

        def over() -> bool:
            self._check(controllers=controllers)
            assert self._monitor.status is not None  # ready was true
            progress.update(bar, completed=self._monitor.status.ticks)
            return follower.finished()

        with Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TextColumn("{task.completed:.0f} of {task.total:.0f} ticks"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=self._console,
            transient=True,
            disable=not self._console.is_terminal,
        ) as progress:
            bar = progress.add_task(self._scenario.name, total=self._scenario.sim.total_ticks)
            while not self._monitor.spin_until(over, 3600.0):
                pass

    def _finish(self, missing: str | None) -> None:
        """Make the results and give them their final names, all at once; `missing` is missing in the recording."""
        # Here: a second in which a session that starts would only be importing.
        from afm_recorder_node.reader import read_recording
        from afm_recorder_node.recording import RecordingError

        score, status, work = self._monitor.score, self._monitor.status, self._folder.work
        assert score is not None and status is not None
        check_score(status)
        own = self._controller in (OWN, COMPOSED)
        controller = self._scenario.controller.law.kind if own else status.controller
        recording, law = None, None
        if missing is None:
            try:
                recording = read_recording(work / RECORDING, every=math.ceil(status.ticks / _OVERVIEW_TICKS))
                law = law_of(recording, status.controller)
            except RecordingError as error:
                missing = str(error)
        if own and law is not None:
            controller = kinds(law)
        card = scorecard(self._scenario, controller, score, status, law)
        title = f"{self._scenario.header.title or self._scenario.name} ({card['plant']} plant, {controller})"
        try:
            write_scorecard(card, work / CARD)
            if recording is not None and self._picture:
                from .session_pictures import draw_overview

                draw_overview(recording, title, work / PICTURE)
        except OSError as error:
            missing = missing or f"{error.filename or work} cannot be written: {error.strerror}"
        # The score is valid even if the recording is not.
        paths = self._folder.publish(complete=missing is None)
        print_scorecard(card, title)
        print("\nResults:", *map(str, paths))
        if missing is not None:
            raise SessionError(missing)
        print(f"Open the recording with: rerun {self._out / RECORDING}")


def say(text: str) -> None:
    """Print to the terminal, if it is still there."""
    with suppress(OSError):
        print(text, file=sys.stderr, flush=True)


@contextmanager
def _nothing() -> Iterator[None]:
    yield
