"""The start of a session: its nodes, one after the other, until all see each other."""

import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from .monitor import Monitor
from .processes import Processes
from .session_nodes import CONTROLLER

_START_TIMEOUT = 180.0
"""Time without progress of the start in which the processes do nothing [s]; see `_wait_for`."""
_AT_WORK = 0.1
"""Part of the time that counts while they compute, or wait for a processor: a first start compiles the kernels."""
_SAY_PERIOD = 20.0
"""Wall time after which a start that takes longer is reported, again and again [s]."""
_INCOMPATIBLE_TIME = 2.0
"""Wall time after which a controller that the middleware does not connect ends the session [s]: discovery is over."""


class SessionError(RuntimeError):
    """Why a session failed, in one sentence."""


def say(text: str) -> None:
    """Print to the terminal, if it is still there."""
    with suppress(OSError):
        print(text, file=sys.stderr, flush=True)


class Start:
    """Starts the nodes of a session.

    Parameters
    ----------
    processes : Processes
    monitor : Monitor
    check : callable
        check(controllers=...): called again and again; raises to end the start, or returns False.
    external : bool
        Whether the controller is started elsewhere: then it may take its time.
    """

    def __init__(self, processes: Processes, monitor: Monitor, check: Callable[..., bool], *, external: bool) -> None:
        self._processes, self._monitor, self._check, self._external = processes, monitor, check, external

    def run(self, commands: Mapping[str, list[str]], work: Path) -> None:
        """Start the processes, by name, in order, with their logs in `work`; raises SessionError if one cannot be."""
        for name, command in commands.items():
            if name in (CONTROLLER, "controller"):
                # It would answer any simulator: by now ours must be the only one.
                self._wait_for_simulator()
            try:
                self._processes.start(name, command, work / f"{name}.log")
            except OSError as error:
                raise SessionError(f"{name} could not be started: {' '.join(command)}: {error.strerror}") from None

    def _wait_for(self, there: Callable[[], bool], missing: Callable[[], str]) -> None:
        """Wait, and report what for; no longer than `_START_TIMEOUT` without a change of what is missing.

        On a slow or busy machine a start takes any time: while the processes are at work only a part of it counts.
        """
        told, since, counted = missing(), time.monotonic(), 0.0
        looked, worked = since, self._processes.worked()
        while not self._monitor.spin_until(there, _SAY_PERIOD):
            now, before, told = time.monotonic(), told, missing()
            passed, looked = now - looked, now
            done, worked = worked, self._processes.worked()
            counted += max(passed - max(worked - done, 0.0), _AT_WORK * passed)
            if told != before:
                since, counted = now, 0.0
            # Only an external controller may take longer.
            patient = self._external and told.startswith("a controller")
            if counted > _START_TIMEOUT and not patient:
                raise SessionError(f"waited {now - since:.0f} s for {told}")
            say(f"Still waiting for {told} ...")

    def _wait_for_simulator(self) -> None:
        self._wait_for(lambda: self._check(controllers=0) or self._monitor.simulators > 0, lambda: "the simulator")

    def wait_until_ready(self) -> None:
        """Wait until all see each other, and give the start signal; raises SessionError if they do not."""
        monitor = self._monitor
        incompatible, since = "", 0.0

        def ready() -> bool:
            nonlocal incompatible, since
            self._check()
            before, incompatible = incompatible, monitor.incompatible
            if incompatible != before:
                since = time.monotonic()
                if self._external and incompatible:
                    say(f"Waiting: {incompatible}")
            elif incompatible and not self._external and time.monotonic() > since + _INCOMPATIBLE_TIME:
                raise SessionError(incompatible)
            return monitor.ready

        self._wait_for(ready, lambda: monitor.missing)
        self._processes.note_shared_memory()
        if not monitor.play(_START_TIMEOUT):
            raise SessionError("the simulator does not answer its play service")
