"""Starting nodes as processes, and ending them without leaving anything behind."""

import ctypes
import os
import signal
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

from ament_index_python.packages import get_package_prefix

from afm_node_common.shared_memory import File, used_by

_PATIENCE = 10.0
"""Wall time a process has to end after SIGINT, then again after SIGTERM [s]."""
_PR_SET_PDEATHSIG = 1


def node_command(package: str, executable: str) -> list[str]:
    """Command of an installed node, as `ros2 run` finds it."""
    return [str(Path(get_package_prefix(package)) / "lib" / package / executable)]


def _end_with_parent() -> None:
    """Have the kernel send SIGINT when the parent dies, however it dies."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGINT)


class Process:
    """One node of a session. Its output goes to a log file.

    Parameters
    ----------
    name : str
        For messages.
    command : sequence of str
    log : Path
        File that receives stdout and stderr.
    """

    def __init__(self, name: str, command: Sequence[str], log: Path) -> None:
        self.name = name
        self.log = log
        self._file: IO[bytes] = log.open("wb")
        # Its own session: a Ctrl-C in the terminal reaches the session runner alone, which ends the nodes in order.
        self._process = subprocess.Popen(
            list(command),
            stdin=subprocess.DEVNULL,
            stdout=self._file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
            preexec_fn=_end_with_parent,
        )

    @property
    def ended(self) -> bool:
        """Whether the process has ended."""
        return self._process.poll() is not None

    @property
    def how_it_ended(self) -> str:
        """A sentence about a process that has ended, with the last line it printed."""
        lines = [line for line in self.log.read_text(errors="replace").splitlines() if line.strip()]
        last = f": {lines[-1].removeprefix('error: ')}" if lines else ""
        return f"{self.name} ended with code {self._process.returncode}{last}"

    def ask_to_end(self) -> None:
        """Send SIGINT, also to what the command has started itself."""
        self._signal(signal.SIGINT)

    def _signal(self, number: int) -> bool:
        """Signal the process group (0: only ask); False if nobody is left in it."""
        try:
            os.killpg(self._process.pid, number)
        except ProcessLookupError:
            return False
        return True

    @property
    def shared_memory(self) -> set[File]:
        """Files of the middleware that the command and what it has started use now."""
        files: set[File] = set()
        for pid in filter(str.isdigit, os.listdir("/proc")):
            with suppress(ProcessLookupError, PermissionError):
                if os.getsid(int(pid)) == self._process.pid:
                    files |= used_by(pid)
        return files

    def end(self) -> None:
        """End the process: SIGINT, then SIGTERM, then SIGKILL; wait for it."""
        self.ask_to_end()
        for number in (signal.SIGTERM, signal.SIGKILL):
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
        self._file.close()
