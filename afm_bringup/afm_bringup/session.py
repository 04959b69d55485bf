"""From the start of processes to results: what all sessions do. `run_session` runs a scenario, `scan_session` scans."""

import os
import time
from contextlib import nullcontext
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import ClassVar

from rich.console import Console

from afm_model import Scenario
from afm_model.core.errors import reason
from afm_model.studies.start_checks import implausible, start_warnings
from afm_node_common import topics
from afm_node_common.runner import Stop, StopSignal

from .follow import STALL_TIMEOUT, Follower, RunFailure
from .monitor import Monitor
from .processes import Processes
from .results_folder import FolderError, ResultsFolder
from .session_nodes import COMPOSED, EXTERNAL, LIVE, OWN, RECORDER, commands
from .session_start import SessionError, Start, say

_DISCOVERY_TIME = 1.0
"""Wall time for the discovery of nodes that already run, before anything is started [s]."""

_LOOK_PERIOD = 0.1
"""Wall time between two looks at a page that is kept [s]."""
_LINK_TIME = 20.0
"""Wall time for which the link of the live page is waited for [s]."""


@dataclass(eq=False)
class Session:
    """Something done with a scenario in separate processes.

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
    live : bool
        Whether the growing recording is shown in a browser; the link is printed.
    """

    names: ClassVar[tuple[str, ...]]
    """Names of the result files other than the recording."""

    scenario: Scenario
    out: Path
    controller: str = OWN
    _: KW_ONLY
    namespace: str = topics.NAMESPACE
    ros_arguments: bool = True
    stall_timeout: float = STALL_TIMEOUT
    live: bool = False

    def __post_init__(self) -> None:
        """Make a console in addition to the results."""
        self._console = Console(stderr=True)

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
        sim = self.scenario.sim
        if self.controller in (OWN, COMPOSED):
            warnings = start_warnings(sim, self.scenario.controller)
        else:
            warnings = implausible(sim)
        for sentence in warnings:
            say(f"warning: {sentence}")
        self._stop = Stop()
        try:
            with ResultsFolder(self.out, self.names) as folder:
                self._run(folder)
        except (RunFailure, FolderError) as error:
            raise SessionError(str(error)) from None
        except OSError as error:
            # A terminal that is gone takes no output either.
            if self._stop.requested:
                raise StopSignal from None
            raise SessionError(f"{error.filename or self.out} cannot be written: {reason(error)}") from None
        finally:
            self._stop.ignore()

    def _run(self, folder: ResultsFolder) -> None:
        try:
            with Processes(RECORDER, LIVE) as processes, Monitor("session", self.namespace) as monitor:
                self._folder, self._processes, self._monitor = folder, processes, monitor
                follower = Follower(monitor, self.stall_timeout)
                external = self.controller == EXTERNAL
                # Two instruments on the same topics would answer each other's controllers.
                monitor.spin_until(lambda: self._check(simulators=0, controllers=int(external)), _DISCOVERY_TIME)
                start = Start(processes, monitor, self._check, external=external)
                start.run(self._commands(), folder.work)
                if self.live:
                    monitor.spin_until(lambda: self._check_alive() or bool(processes.of_spare()), _LINK_TIME)
                    say(f"Live: {processes.of_spare() or 'no link yet, see live.log'}".rstrip())
                folder.set_older_aside()
                with self._console.status("Starting the nodes ...") if self._console.is_terminal else nullcontext():
                    start.wait_until_ready()
                self._watch(follower)
                follower.wait_until_recorded(self._check_alive)
                # The live page shows the run for as long as somebody looks at it.
                processes.end(spare=False)
                self._finish(follower.missing_in_recording())
                self._keep_the_page()
        except StopSignal:
            for path in folder.publish(complete=False):
                say(f"The recording up to here: {path}")
            raise
        finally:
            if folder.left:
                say(f"What was recorded is kept: {', '.join(map(str, folder.left))}")

    # What is checked all the time.

    def _check_alive(self) -> bool:
        """Raise if a signal has come, one of our processes has ended, or the folder is gone; False otherwise."""
        if self._stop.requested:
            raise StopSignal
        ended = self._processes.ended()
        # First: nodes may end because of it.
        if not self._folder.there:
            raise SessionError(f"{self.out} was removed while the session ran: it has no place for results any more")
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
        for name in monitor.restarted():
            say(f"note: {name} was started again; the run goes on with it")
        return False

    # What is done, from start to end.

    def _commands(self) -> dict[str, list[str]]:
        work, namespace = self._folder.work, self._monitor.namespace
        return commands(
            self.scenario, self.controller, work, namespace, ros_arguments=self.ros_arguments, live=self.live
        )

    def _keep_the_page(self) -> None:
        """Leave the live page to somebody in a terminal until Ctrl-C, or until its server has ended."""
        if self.live and self._console.is_terminal and not self._stop.requested:
            say("The live page stays until Ctrl-C.")
            while self._processes.spare_runs and not self._stop.requested:
                time.sleep(_LOOK_PERIOD)

    def _watch(self, follower: Follower) -> None:
        """Follow what is done to its end."""
        raise NotImplementedError

    def _finish(self, missing: str | None) -> None:
        """Make the results and give them their final names, all at once; `missing` is missing in the recording."""
        raise NotImplementedError
