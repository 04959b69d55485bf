"""Has views made by a process apart, so that a recorder does not wait for rerun, or hold its memory. Needs no ROS."""

import json
import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

_PERIOD = 0.01
"""Wall time between two looks at a process that is waited for [s]."""


class News(NamedTuple):
    """What has become of a view that was asked for."""

    target: Path
    error: str
    """Why it could not be made; empty if it is there."""


class Worker:
    """Makes views in another process, one after the other. No call waits for it but `finish`."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._wanted: list[Path] = []
        self._to, self._from = bytearray(), bytearray()

    def start(self) -> None:
        """Start the process, if it does not run yet: it takes a second until it can draw."""
        if self._process is None:
            self._process = subprocess.Popen(
                [sys.executable, "-m", f"{__package__}.views"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=os.environ | {"RUST_LOG": "error"},
                # A Ctrl-C is for the recorder: it has views made of what has been recorded until then.
                process_group=0,
            )
            for pipe in (self._process.stdin, self._process.stdout):
                assert pipe is not None
                os.set_blocking(pipe.fileno(), False)

    def make(self, record: Path, target: Path) -> None:
        """Have the view of a record made."""
        self._wanted.append(target)
        self._to += json.dumps([str(record.absolute()), str(target.absolute())]).encode() + b"\n"
        self.start()
        self._send()

    def news(self) -> list[News]:
        """Views that are there since the last call, or could not be made."""
        if self._process is None:
            return []
        assert self._process.stdout is not None
        self._send()
        ended = False
        with suppress(BlockingIOError):
            while block := os.read(self._process.stdout.fileno(), 65536):
                self._from += block
            ended = True
        *lines, rest = self._from.split(b"\n")
        self._from = rest
        found = [News(self._wanted.pop(0), json.loads(line)) for line in lines]
        if ended:
            found += self._end("the process that makes views has ended")
        return found

    def finish(self, timeout: float = 600.0) -> list[News]:
        """Wait until all views have been made, then end the process.

        Parameters
        ----------
        timeout : float [s]
            After which those that are not there are abandoned.

        Returns
        -------
        list of News
            As `news` does.
        """
        found, limit = self.news(), time.monotonic() + timeout
        while self._wanted and time.monotonic() < limit:
            time.sleep(_PERIOD)
            found += self.news()
        return found + self._end(f"it was not there within {timeout:g} s")

    def _send(self) -> None:
        assert self._process is not None and self._process.stdin is not None
        with suppress(BlockingIOError, BrokenPipeError):
            while self._to:
                del self._to[: os.write(self._process.stdin.fileno(), self._to)]

    def _end(self, why: str) -> list[News]:
        """End the process; what it has not made."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None
        found = [News(target, f"{target} is not made: {why}") for target in self._wanted]
        self._wanted.clear()
        self._to.clear()
        self._from.clear()
        return found
