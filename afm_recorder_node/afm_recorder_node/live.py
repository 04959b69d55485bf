"""`ros2 run afm_recorder_node live RECORDING`: shows a recording in a web browser while it grows. Needs no ROS.

rerun serves the viewers from a process of its own, which gets what stands in the growing file. The recorder knows
nothing of it: a server inside the recorder held it up for 18 s when a viewer stopped reading (rerun 0.41).
"""

import argparse
import ctypes
import math
import os
import re
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib.resources import files
from pathlib import Path

from .frames import END_KIND, HEADER, walk
from .names import partial_of

ADDRESS = "127.0.0.1"
"""Viewers are accepted from this machine only: there is no password."""
_PAGE, _DATA = 9090, 9876
"""Ports that are taken if they are free, as rerun has them."""
_MEMORY = "256MiB"
"""What the server keeps for viewers that come late; it drops the oldest first."""
_PERIOD = 0.1
"""Wall time between two looks at the file [s]."""
_LAST = 0.5
"""Wall time after a signal for which viewers still get what has been recorded [s]."""
_PR_SET_PDEATHSIG = 1
_LISTENS = "0A"
"""State of a socket in /proc/net/tcp."""
RERUN = str(files("rerun_cli") / "rerun")
"""The program itself: `rerun` is a script that starts it."""


def follow(path: Path) -> Iterator[bytes]:
    """The messages of the recordings that grow at a path, one run after the other; empty when there is nothing new.

    Parameters
    ----------
    path : Path
        run.rrd for run.partial.rrd, run-2.partial.rrd, ...

    Yields
    ------
    bytes
        Together one stream, without an end, as rerun reads it.
    """
    begun = False
    while True:
        for growing in _growing(path):
            with suppress(FileNotFoundError), growing.open("rb") as file:
                position, gone = HEADER, False
                while not gone:
                    # Before it is read: what was written until it got its name is read.
                    gone = not _is(growing, file.fileno())
                    for message in walk(file.fileno(), position):
                        if not begun:
                            begun = True
                            yield os.pread(file.fileno(), HEADER, 0)
                        if message.kind != END_KIND:
                            yield os.pread(file.fileno(), message.end - message.start, message.start)
                        position = message.end
                    if not gone:
                        yield b""
        yield b""


def _growing(path: Path) -> list[Path]:
    """Recordings under way, the oldest first."""
    name = partial_of(path)
    pattern = re.compile(rf"{re.escape(path.stem)}(-\d+)?{re.escape(name.name.removeprefix(path.stem))}")
    found = [each for each in path.parent.glob(f"*.partial{path.suffix}") if pattern.fullmatch(each.name)]
    return sorted(found, key=lambda each: len(each.name))


def _is(path: Path, file: int) -> bool:
    """Whether an open file still stands at a path."""
    try:
        return os.path.samestat(path.lstat(), os.fstat(file))
    except (FileNotFoundError, NotADirectoryError):
        return False


class Server:
    """rerun's server of page and data, on this machine only. A context manager.

    Parameters
    ----------
    page, data : int
        Ports, if they are free; 0: any.
    source : path
        A recording, in place of what is `put`.
    """

    def __init__(self, page: int = _PAGE, data: int = _DATA, source: Path | None = None) -> None:
        self._ports = page, data = _free(page), _free(data)
        self.link = f"http://{ADDRESS}:{page}?url=rerun%2Bhttp%3A%2F%2F{ADDRESS}%3A{data}%2Fproxy"
        """What a browser opens."""
        self.address = f"rerun+http://{ADDRESS}:{data}/proxy"
        """What the native viewer and rerun's own tools open."""
        options = ["--bind", ADDRESS, "--port", str(data), "--web-viewer-port", str(page)]
        self._process = subprocess.Popen(
            [
                RERUN,
                "--serve-web",
                *options,
                "--server-memory-limit",
                _MEMORY if source is None else "75%",
                source or "-",
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            env=os.environ | {"RUST_LOG": "error"},
            # A Ctrl-C is for us: what has been recorded until then is served.
            process_group=0,
            preexec_fn=_end_with_parent,
        )
        assert self._process.stdin is not None
        os.set_blocking(self._process.stdin.fileno(), False)

    def __enter__(self) -> "Server":
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()  # one that is stopped too
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()

    def put(self, messages: bytes, give_up: Callable[[], bool]) -> bool:
        """Serve messages; waits while a viewer does not read. False if it gave up.

        Raises
        ------
        OSError
            If the server has ended.
        """
        assert self._process.stdin is not None
        file = self._process.stdin.fileno()
        left = memoryview(messages)
        while left:
            if give_up():
                return False
            if select.select([], [file], [], _PERIOD)[1]:
                left = left[os.write(file, left) :]
        if self._process.poll() is not None:
            raise OSError("rerun's server has ended")
        return True

    def wait(self) -> None:
        """Wait until viewers can connect.

        Raises
        ------
        OSError
            If the server has ended.
        """
        while not self.ready:
            if self._process.poll() is not None:
                raise OSError("rerun's server has ended")
            time.sleep(_PERIOD)

    @property
    def ready(self) -> bool:
        """Whether viewers can connect; not before it has got the first message."""
        return all(_listens(self._process.pid, port) for port in self._ports)


def _free(wanted: int) -> int:
    """A port that is free, the wanted one if it is."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((ADDRESS, wanted))
        except OSError:
            return _free(0)
        return int(probe.getsockname()[1])


def _listens(pid: int, port: int) -> bool:
    """Whether this process listens at a port, not another one that has taken it."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    sockets = {
        f"socket:[{row[9]}]" for row in rows if row[3] == _LISTENS and int(row[1].rpartition(":")[2], 16) == port
    }
    try:
        return any(os.readlink(file) in sockets for file in Path(f"/proc/{pid}/fd").iterdir())
    except OSError:
        return False


def _end_with_parent() -> None:
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def serve(path: Path) -> None:
    """Serve the recordings that grow at a path until a signal comes; prints the link when viewers can connect.

    Raises
    ------
    OSError
        If the server has ended.
    """
    limit, told = math.inf, False

    def stop(*_: object) -> None:
        nonlocal limit
        limit = min(limit, time.monotonic() + _LAST)

    def late() -> bool:
        return time.monotonic() > limit

    def run(server: Server) -> None:
        nonlocal told
        for messages in follow(path):
            if not server.put(messages, late) or late():
                return
            if not told and server.ready:
                told = True
                print(f"{server.link}\nor: rerun {server.address}", flush=True)
            if not messages:
                time.sleep(_PERIOD)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, stop)
    if sys.stderr.isatty() and not _growing(path):  # a session starts the page before the recorder
        there = f"; {path} is complete: `view` shows it" if path.exists() else ""
        print(f"waiting until {partial_of(path)} grows{there}", file=sys.stderr, flush=True)
    try:
        with Server() as server:
            run(server)
    except OSError:
        if told:
            raise
        # Somebody else has taken a port since it was found free.
        with Server(0, 0) as server:
            run(server)


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="live", description="Show a recording in a web browser while it grows; print the link."
    )
    parser.add_argument("recording", type=Path, help="path of the recorder: run.rrd, which grows as run.partial.rrd")
    try:
        serve(parser.parse_args().recording.absolute())
    except OSError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
