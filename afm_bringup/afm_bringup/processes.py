"""Start nodes as processes, and end them and all their child processes."""

import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

from afm_node_common.shared_memory import File, remove_unused, used_by

from . import cleanup

_PATIENCE = 10.0
"""Wall time a process has to end after SIGINT, then again after SIGTERM [s]."""
_AT_WORK = 600.0
"""Wall time after SIGINT for which the last one is waited for while it works [s]: it completes a long recording."""


class NodeProcess:
    """One node of a session.

    Parameters
    ----------
    name : str
        For messages.
    command : sequence of str
    log : Path or None
        File that receives stdout and stderr; None: they are those of this process.
    mark : str
        See `cleanup`.
    """

    def __init__(self, name: str, command: Sequence[str], log: Path | None, mark: str) -> None:
        self.name = name
        self._file: IO[bytes] | None = None if log is None else log.open("w+b")
        # Its own session: a Ctrl-C in the terminal reaches the session runner alone, which ends the nodes in order.
        self._process = subprocess.Popen(
            list(command),
            stdin=subprocess.DEVNULL,
            stdout=self._file,
            stderr=None if self._file is None else subprocess.STDOUT,
            start_new_session=True,
            env=os.environ | {cleanup.VARIABLE: mark},
        )

    @property
    def ended(self) -> bool:
        """Whether the process has ended."""
        return self._process.poll() is not None

    @property
    def code(self) -> int | None:
        """Exit code; minus the number of the signal that has killed it; None while it runs."""
        return self._process.poll()

    @property
    def printed(self) -> str:
        """What it has printed up to now."""
        if self._file is None:
            return ""
        # By the open file: the folder may have been removed.
        return os.pread(self._file.fileno(), os.fstat(self._file.fileno()).st_size, 0).decode(errors="replace")

    @property
    def how_it_ended(self) -> str:
        """A sentence about a process that has ended: the error it printed last, or the last line, named as such."""
        ended = f"{self.name} ended with code {self._process.returncode}"
        lines = [line for line in self.printed.splitlines() if line.strip()]
        if not lines:
            return ended
        reason = lines[-1].removeprefix("error: ")
        return f'{ended}; last line it printed: "{reason}"' if reason == lines[-1] else f"{ended}: {reason}"

    def ask_to_end(self) -> None:
        """Send SIGINT to the command and its child processes."""
        self._signal(signal.SIGINT)

    def _signal(self, number: int) -> bool:
        """Send a signal to the process group (0: only test); False if no process is left in it."""
        try:
            os.killpg(self._process.pid, number)
        except ProcessLookupError:
            return False
        return True

    def pids(self) -> Iterator[str]:
        """Of the command and its child processes."""
        for pid in filter(str.isdigit, os.listdir("/proc")):
            with suppress(ProcessLookupError, PermissionError):
                if os.getsid(int(pid)) == self._process.pid:
                    yield pid

    def end(self, at_work: float = 0.0) -> None:
        """End the process: SIGINT, then SIGTERM, then SIGKILL; wait for it.

        Parameters
        ----------
        at_work : float
            Wall time for which a process that uses the processor is not sent SIGTERM [s].
        """
        self.ask_to_end()
        limit = time.monotonic() + at_work
        for number in (signal.SIGTERM, signal.SIGKILL):
            used, before = self._processor_time(), -1.0
            while used > before and time.monotonic() < limit:
                with suppress(subprocess.TimeoutExpired):
                    self._process.wait(_PATIENCE)
                    break
                used, before = self._processor_time(), used
            try:
                self._process.wait(_PATIENCE)
                break
            except subprocess.TimeoutExpired:
                self._signal(number)
        self._process.wait()
        # A shell may end before the node it has started.
        limit = time.monotonic() + _PATIENCE
        while self._signal(0) and time.monotonic() < limit:
            time.sleep(0.02)
        self._signal(signal.SIGKILL)
        if self._file is not None:
            self._file.close()

    def _processor_time(self) -> float:
        return processor_time(self._process.pid)


def processor_time(pid: int | str) -> float:
    """What a process has used up to now, in ticks of the system; 0 when it has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return float(fields[11]) + float(fields[12])  # utime and stime of proc(5)


class Processes:
    """The nodes of a session. They and their child processes do not outlive the session. A context manager.

    Parameters
    ----------
    last : str
        Name of the one that is ended last, so that it hears the others out.
    spare : str
        Name of one that shows what the last one has done: ended after it, and nothing depends on it.
    """

    def __init__(self, last: str, spare: str = "") -> None:
        self._last, self._spare = last, spare
        self._running: list[NodeProcess] = []
        self._shared_memory: set[File] = set()
        self._mark = uuid.uuid4().hex
        self._cleanup = subprocess.Popen(
            [sys.executable, "-I", "-S", cleanup.__file__, self._mark],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            cwd="/",
        )

    def __enter__(self) -> "Processes":
        return self

    def end(self, *, spare: bool = True) -> None:
        """End all nodes; `spare` says whether the spare one is ended, too."""
        self.note_shared_memory()
        order = {self._last: 1, self._spare: 2}
        running = sorted(self._running, key=lambda process: order.get(process.name, 0))
        ending = [process for process in running if spare or process.name != self._spare]
        self._running = [process for process in running if process not in ending]
        for process in ending:
            if process.name not in order:
                process.ask_to_end()
        for process in ending:
            process.end(_AT_WORK if process.name == self._last else 0.0)

    def __exit__(self, *_: object) -> None:
        """End all nodes."""
        self.end()
        # It now ends processes that have left their process group.
        assert self._cleanup.stdin is not None
        self._cleanup.stdin.close()
        self._cleanup.wait()
        remove_unused(self._shared_memory)

    def start(self, name: str, command: Sequence[str], log: Path | None = None) -> None:
        """Start one; see `NodeProcess`.

        Raises
        ------
        OSError
            If there is no such program, or no log can be written.
        """
        self._running.append(NodeProcess(name, command, log, self._mark))

    def ask_to_end(self) -> None:
        """Send SIGINT to each node and its child processes."""
        for process in self._running:
            process.ask_to_end()

    def ended(self) -> str | None:
        """A sentence about one that has ended by itself, if any has; the spare one does not count."""
        ended = (process.how_it_ended for process in self._running if process.ended and process.name != self._spare)
        return next(ended, None)

    @property
    def code(self) -> int | None:
        """Exit code of the one that was started first; see `NodeProcess`."""
        return self._running[0].code

    def of_spare(self) -> str:
        """What the spare one has printed, or how it ended; empty: nothing yet."""
        spare = next(process for process in self._running if process.name == self._spare)
        return spare.how_it_ended if spare.ended else spare.printed

    @property
    def spare_runs(self) -> bool:
        """Whether the spare one is there and has not ended."""
        return any(process.name == self._spare and not process.ended for process in self._running)

    def note_shared_memory(self) -> None:
        """Note the shared memory in use, to remove the files that a killed node leaves."""
        for pid in self._pids():
            with suppress(ProcessLookupError, PermissionError):
                self._shared_memory |= used_by(pid)

    def memory(self) -> int:
        """What all of them hold, less what they share with others [bytes]."""
        size = 0
        for pid in self._pids():
            with suppress(OSError):
                status = Path(f"/proc/{pid}/status").read_text()
                size += 1024 * int(status.partition("RssAnon:")[2].split(maxsplit=1)[0])
        return size

    def waited(self) -> float:
        """Time for which their threads and this one were ready to run and had no processor [s]."""
        paths = [Path("/proc/thread-self/schedstat")]
        for pid in self._pids():
            paths += Path(f"/proc/{pid}/task").glob("*/schedstat")
        nanoseconds = 0
        for path in paths:
            with suppress(OSError):
                nanoseconds += int(path.read_text().split()[1])
        return 1e-9 * nanoseconds

    def worked(self) -> float:
        """Processor time that they have used, and time for which they waited for a processor [s]."""
        ticks = 0.0
        for pid in self._pids():
            ticks += processor_time(pid)
        return ticks / os.sysconf("SC_CLK_TCK") + self.waited()

    def _pids(self) -> Iterator[str]:
        return (pid for process in self._running for pid in process.pids())
