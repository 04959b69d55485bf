"""`ros2 run afm_bringup session SCENARIO --out DIR`: run a scenario from start to score."""

import argparse
import math
import os
import shlex
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import yaml
from afm_msgs.msg import InstrumentStatus
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from afm_model import Scenario, ScenarioError
from afm_node_common import topics
from afm_node_common.shared_memory import File, remove_unused
from afm_recorder_node.reader import RecordingError, read_recording

from .monitor import Monitor
from .processes import Process, node_command
from .results import draw_overview, print_scorecard, scorecard, write_scorecard
from .scenario import read_scenario

_START_TIMEOUT = 60.0
"""Wall time for all nodes to start and see each other; a first start compiles the kernels [s]."""
_DISCOVERY_TIME = 1.0
"""Wall time before anything is started, in which what already runs makes itself known; more passes while our simulator
starts [s]."""
_RETRACTED_TIME = 10.0
"""Wall time for which a realtime controller may be silent [s]."""
_RECORDER_TIMEOUT = 30.0
_OVERVIEW_TICKS = 250_000
"""Ticks that the picture shows at most; of a longer run one in several."""
_RECORDER = "afm_recorder_node"
OWN, COMPOSED, EXTERNAL = "", "composed", "external"
"""Controllers that are no command: ours in its own process, ours in the simulator's process, somebody else's."""
_RESULTS = ("recording.rrd", "overview.png", "scorecard.json")


class SessionError(RuntimeError):
    """Why a session failed, in one sentence."""


class Interrupted(Exception):
    """SIGINT or SIGTERM."""


class Session:
    """One run of a scenario in processes of its own.

    Parameters
    ----------
    scenario : Scenario
    out : Path
        Folder of the results.
    controller : str
        Command of the controller to start, or OWN, COMPOSED or EXTERNAL.
    """

    def __init__(self, scenario: Scenario, out: Path, controller: str) -> None:
        self._scenario = scenario
        self._out = out
        self._controller = controller
        self._processes: list[Process] = []
        self._shared_memory: set[File] = set()
        self._console = Console(stderr=True)
        self._interrupted = False

    def run(self) -> None:
        """Run and leave the results in `out`.

        Raises
        ------
        SessionError
            If anything failed; nothing is left under a final name then, results of an older run only if no node was
            started.
        Interrupted
            If SIGINT or SIGTERM came; the recording up to there is kept.
        """
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._interrupt)
        work = self._workplace()
        try:
            try:
                with Monitor() as monitor:
                    self._refuse_company(monitor)
                    self._start(work, monitor)
                    self._forget_older_results()
                    self._wait_until_ready(monitor)
                    self._watch(monitor)
                    self._wait_for_recorder(monitor)
            finally:
                self._end()
            self._finish(work, monitor)
        except Interrupted:
            self._keep_recording(work)
            raise
        finally:
            self._keep_logs(work)
            shutil.rmtree(work, ignore_errors=True)
            # While Python itself ends, a second Ctrl-C would find its default action: to kill.
            for number in (signal.SIGINT, signal.SIGTERM):
                signal.signal(number, signal.SIG_IGN)

    def _interrupt(self, number: int, frame: object) -> None:
        self._interrupted = True

    def _check_interrupt(self) -> bool:
        """For use in predicates: raises when a signal has come."""
        if self._interrupted:
            raise Interrupted
        return False

    def _workplace(self) -> Path:
        """A folder beside the results for what is not finished."""
        try:
            self._out.mkdir(parents=True, exist_ok=True)
            return Path(tempfile.mkdtemp(prefix=".running-", dir=self._out))
        except OSError as error:
            raise SessionError(
                f"--out {self._out} cannot be written ({error.strerror}): it must be a folder you can write"
            ) from None

    def _start(self, work: Path, monitor: Monitor) -> None:
        for name, command in self._commands(work).items():
            if name in ("afm_controller_node", "controller"):
                # It would answer anybody: by now the only simulator must be ours.
                self._wait_for_simulator(monitor)
            try:
                self._processes.append(Process(name, command, work / f"{name}.log"))
            except OSError as error:
                raise SessionError(f"{name} could not be started: {' '.join(command)}: {error.strerror}") from None

    def _commands(self, work: Path) -> dict[str, list[str]]:
        """Commands of the processes to start, by name."""
        overrides = work / "session.yaml"
        own = {
            "afm_sim_node": {"run.start_paused": True, "run.exit_when_finished": False},
            _RECORDER: {"path": str(work / "recording.rrd")},
        }
        overrides.write_text(yaml.safe_dump({f"/**/{node}": {"ros__parameters": own[node]} for node in own}))
        parameters = ["--ros-args", "--params-file", str(self._scenario.path), "--params-file", str(overrides)]
        commands = {_RECORDER: [*node_command(_RECORDER, _RECORDER), *parameters]}
        if self._controller == COMPOSED:
            commands["composed"] = [*node_command("afm_bringup", "composed"), *parameters]
            return commands
        commands["afm_sim_node"] = [*node_command("afm_sim_node", "afm_sim_node"), *parameters]
        if self._controller == OWN:
            commands["afm_controller_node"] = [*node_command("afm_controller_node", "afm_controller_node"), *parameters]
        elif self._controller != EXTERNAL:
            commands["controller"] = shlex.split(self._controller)
        return commands

    def _refuse_company(self, monitor: Monitor) -> None:
        """Two instruments on the same topics would answer each other's controllers."""

        def somebody() -> bool:
            self._check_interrupt()
            self._check_company(monitor, simulators=0, controllers=int(self._controller == EXTERNAL))
            return False

        monitor.spin_until(somebody, _DISCOVERY_TIME)

    def _check_company(self, monitor: Monitor, *, simulators: int = 1, controllers: int = 1) -> None:
        """Raise if there are more of them than there should be."""
        domain = os.environ.get("ROS_DOMAIN_ID") or "0"
        for what, there, allowed in (
            ("instrument", monitor.simulators, simulators),
            ("controller", monitor.controllers, controllers),
        ):
            if there > allowed:
                raise SessionError(
                    f"another {what} runs on /{topics.NAMESPACE} in ROS domain {domain}: end it, or set "
                    "ROS_DOMAIN_ID to another number"
                )

    def _wait_for_simulator(self, monitor: Monitor) -> None:
        def there() -> bool:
            self._check_all(monitor, controllers=0)
            return monitor.simulators > 0

        if not monitor.spin_until(there, _START_TIMEOUT):
            raise SessionError(f"waited {_START_TIMEOUT:g} s for the simulator")

    def _forget_older_results(self) -> None:
        """They would pass for those of this run."""
        for name in _RESULTS:
            (self._out / name).unlink(missing_ok=True)

    def _check_alive(self) -> None:
        for process in self._processes:
            if process.ended:
                raise SessionError(process.how_it_ended)

    def _check_all(self, monitor: Monitor, *, controllers: int = 1) -> None:
        """Raise if a signal has come, one of our processes has ended, or somebody else is there."""
        self._check_interrupt()
        self._check_alive()
        self._check_company(monitor, controllers=controllers)

    def _wait_until_ready(self, monitor: Monitor) -> None:
        def ready() -> bool:
            self._check_all(monitor)
            return monitor.ready

        with self._console.status("Starting the nodes ...") if self._console.is_terminal else _nothing():
            external = self._controller == EXTERNAL
            while not monitor.spin_until(ready, _START_TIMEOUT):
                # Somebody else's controller may take its time; our own nodes may not.
                if not (external and monitor.missing.startswith("a controller")):
                    raise SessionError(f"waited {_START_TIMEOUT:g} s for {monitor.missing}")
                self._console.print(f"Still waiting for {monitor.missing} ...")
            self._note_shared_memory()
            if not monitor.play(_START_TIMEOUT):
                raise SessionError("the simulator does not answer its play service")

    def _watch(self, monitor: Monitor) -> None:
        """Follow the run to its end."""
        total = self._scenario.sim.total_ticks
        self._well_at = time.monotonic()

        def over() -> bool:
            # An external controller may be replaced while we run.
            self._check_all(monitor, controllers=2 if self._controller == EXTERNAL else 1)
            status = monitor.status
            assert status is not None  # ready was true
            progress.update(bar, completed=status.ticks)
            if status.state in (InstrumentStatus.FAULT, InstrumentStatus.STALLED):
                raise SessionError(status.detail)
            # A controller that was only slow comes back; the score tells.
            if status.state != InstrumentStatus.RETRACTED:
                self._well_at = time.monotonic()
            elif time.monotonic() > self._well_at + _RETRACTED_TIME:
                raise SessionError(status.detail)
            return bool(status.state == InstrumentStatus.FINISHED) and monitor.score is not None

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
            bar = progress.add_task(self._scenario.name, total=total)
            while not monitor.spin_until(over, 3600.0):
                pass

    def _wait_for_recorder(self, monitor: Monitor) -> None:
        """Let the recorder receive everything that was published, and see that nothing is missing."""

        def complete() -> bool:
            self._check_interrupt()
            self._check_alive()
            recorder, status = monitor.recorder, monitor.status
            assert recorder is not None and status is not None
            return bool(recorder.ticks >= status.ticks and recorder.samples >= status.samples)

        monitor.spin_until(complete, _RECORDER_TIMEOUT)
        recorder, status = monitor.recorder, monitor.status
        assert recorder is not None and status is not None
        if recorder.ticks != status.ticks or recorder.samples != status.samples:
            raise SessionError(
                f"the recording is incomplete: {recorder.ticks} of {status.ticks} ticks and {recorder.samples} of "
                f"{status.samples} samples arrived"
            )

    def _end(self) -> None:
        """End all nodes: the recorder last, so that it hears the others out."""
        self._note_shared_memory()
        recorders = [process for process in self._processes if process.name == _RECORDER]
        others = [process for process in self._processes if process not in recorders]
        for process in others:
            process.ask_to_end()
        for process in (*others, *recorders):
            process.end()
        remove_unused(self._shared_memory)

    def _note_shared_memory(self) -> None:
        """What the nodes use by now, so that what one that is killed leaves behind can be removed."""
        for process in self._processes:
            self._shared_memory |= process.shared_memory

    def _finish(self, work: Path, monitor: Monitor) -> None:
        """Make the results and give them their final names, all at once."""
        scenario = self._scenario
        assert monitor.score is not None and monitor.status is not None
        if monitor.status.mode == "realtime" and monitor.status.drives_lost >= monitor.status.ticks:
            raise SessionError(
                f"no drive of {monitor.status.controller or 'the controller'} was ever applied in "
                f"{monitor.status.ticks} ticks; {monitor.status.drives_refused} were refused as NaN or infinite"
            )
        own = self._controller in (OWN, COMPOSED)
        controller = scenario.controller.law.kind if own else monitor.status.controller
        card = scorecard(scenario, controller, monitor.score, monitor.status)
        title = f"{scenario.header.title or scenario.name} ({card['plant']} plant, {controller})"
        write_scorecard(card, work / "scorecard.json")
        try:
            every = math.ceil(monitor.status.ticks / _OVERVIEW_TICKS)
            recording = read_recording(work / "recording.rrd", every=every)
        except RecordingError as error:
            raise SessionError(str(error)) from None
        draw_overview(recording, title, work / "overview.png")
        for name in _RESULTS:
            (work / name).replace(self._out / name)
        print_scorecard(card, title)
        print("\nResults:", *(str(self._out / name) for name in _RESULTS))
        print(f"Open the recording with: rerun {self._out / 'recording.rrd'}")

    def _keep_recording(self, work: Path) -> None:
        """After an interruption: the recording up to there."""
        recording = work / "recording.rrd"
        if recording.exists():
            recording.replace(self._out / "recording.rrd")
            self._console.print(f"The recording up to here: {self._out / 'recording.rrd'}")

    def _keep_logs(self, work: Path) -> None:
        """Logs, and of a run that failed the recording up to there: it may tell why."""
        logs = self._out / "logs"
        (logs / "recording.rrd").unlink(missing_ok=True)
        for log in (*sorted(work.glob("*.log")), *work.glob("recording.rrd")):
            logs.mkdir(exist_ok=True)
            log.replace(logs / log.name)


@contextmanager
def _nothing() -> Iterator[None]:
    yield


def main() -> int:
    """Entry point of `ros2 run afm_bringup session`."""
    parser = argparse.ArgumentParser(prog="session", description="Run a scenario and leave recording, picture, score.")
    parser.add_argument("scenario", help="name of a scenario, or a scenario file")
    parser.add_argument("--out", required=True, type=Path, help="folder for the results")
    parser.add_argument(
        "--controller",
        default=OWN,
        metavar="COMMAND",
        help="start this command as the controller in place of afm_controller_node; 'external': start none and wait; "
        "'composed': ours, in the simulator's process",
    )
    parser.add_argument(
        "--composed",
        action="store_const",
        const=COMPOSED,
        dest="controller",
        help="simulator and controller in one process, on the same topics",
    )
    arguments = parser.parse_args()
    try:
        if arguments.controller != OWN and not shlex.split(arguments.controller):
            raise ValueError("it is empty")
    except ValueError as error:
        print(f"error: --controller {arguments.controller!r} is no command: {error}", file=sys.stderr)
        return 2
    try:
        scenario = read_scenario(arguments.scenario)
        if scenario.sim.total_ticks == 0:
            raise ScenarioError(f"{scenario.path}: run.duration = 0 s is not allowed in a session: it must be > 0 s")
        Session(scenario, arguments.out, arguments.controller).run()
    except (ScenarioError, SessionError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2 if isinstance(error, ScenarioError) else 1
    except Interrupted:
        print("interrupted", file=sys.stderr)
        return 130
    return 0
