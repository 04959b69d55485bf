"""`ros2 run afm_recorder_node live RECORDING`: shows a recording in a web browser while it grows. Needs no ROS.

rerun serves the viewers from another process. It gets the view that this process draws of the growing record. The
recorder knows nothing of either: a server inside it held it up for 18 s when a viewer stopped reading (rerun 0.41).
"""

import argparse
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

import rerun as rr

from . import layout, screens
from .canvas import let_go, send_blueprint
from .growing import grows
from .names import RECORD
from .record import RunRecord
from .recording import RecordingError
from .view_writer import ViewWriter
from .views import end_with_parent, light

ADDRESS = "127.0.0.1"
"""Viewers are accepted from this machine only: there is no password."""
_PAGE, _DATA = 9090, 9876
"""Ports that are taken if they are free, as rerun has them."""
_MEMORY = "256MiB"
"""What the server keeps for viewers that come late; it drops the oldest first."""
_PERIOD = 0.1
"""Wall time between two looks at the files [s]."""
_LAST = 0.5
"""Wall time after a signal for which viewers still get what has been recorded [s]."""
_AT_ONCE = 1 << 18
"""Rows that are drawn before they are served, more or less; rerun makes some 30 bytes of one."""
_LISTENS = "0A"
"""State of a socket in /proc/net/tcp."""
RERUN = str(files("rerun_cli") / "rerun")
"""The program itself: `rerun` is a script that starts it."""


def follow(path: Path) -> Iterator[bytes]:
    """The views of the records that grow at a path, run.mcap, run-2.mcap, ...; empty when there is nothing new.

    Yields
    ------
    bytes
        Together one stream for rerun.
    """
    old = {each for each in _records(path) if not grows(each)}
    shown: dict[Path, _Growing] = {}
    while True:
        there = _records(path)
        old.intersection_update(there)
        for each in there:
            if each not in old and each not in shown:
                shown[each] = _Growing(each)
        for each, view in list(shown.items()):
            with suppress(FileNotFoundError):
                yield from view.news()
            if view.over:
                old.add(each)
                del shown[each]
        yield b""


def _records(path: Path) -> list[Path]:
    """Records with the name of a path and a number, the first one first."""
    pattern = re.compile(rf"{re.escape(path.stem)}(-\d+)?{re.escape(path.suffix)}")
    found = [each for each in path.parent.glob(f"*{path.suffix}") if pattern.fullmatch(each.name)]
    return sorted(found, key=lambda each: (len(each.name), each.name))


class _Growing:
    """The view of a record that grows."""

    def __init__(self, path: Path) -> None:
        self.over = False
        """Whether all of it has been drawn, or it cannot be."""
        self._record = RunRecord(path)
        self._stream = rr.RecordingStream(layout.APPLICATION)
        self._bytes = rr.binary_stream(self._stream)
        self._stream.set_sinks(self._bytes)
        self._writer: ViewWriter | None = None
        self._arranged: set[str] | None = None
        self._served = 0  # rows

    def news(self) -> Iterator[bytes]:
        """What has come since the last call. Memory holds a part of it at a time."""
        come = False
        try:
            for entry in self._record.more():
                come, writer = True, self._begun()
                writer.put(entry)
                if writer.canvas.sent.total() >= self._served + _AT_ONCE:
                    yield self._drawn()
        except RecordingError as error:
            print(f"error: {error}", file=sys.stderr, flush=True)
            self.over = True
        self.over |= self._record.end is not None
        if self.over and self._writer is not None:
            self._writer.conclude(self._record.missing)
        # Before anything has come, too: a server without a message has no page.
        if come or self.over or self._arranged is None:
            yield self._drawn()
        if self.over:
            self._stream.disconnect()
            self._bytes.read(flush=False)  # the index, or rerun reports that nobody has read it
            del self._stream, self._bytes, self._writer
            let_go()

    def _begun(self) -> ViewWriter:
        if self._writer is None:
            self._writer = ViewWriter(self._stream, self._record.about, self._record.path.stem)
        return self._writer

    def _drawn(self) -> bytes:
        """Everything up to now, with a place in the viewer for what is new."""
        entities: set[str] = set()
        if self._writer is not None:
            self._writer.flush()
            self._served = self._writer.canvas.sent.total()
            entities = {each for each in self._writer.canvas.sent if screens.has_place(each)}
        if entities != self._arranged:
            self._arranged = entities
            send_blueprint(self._stream, screens.blueprint(entities))
        return self._bytes.read() or b""


class LiveServer:
    """rerun's server of page and data, on this machine only. A context manager.

    Parameters
    ----------
    page, data : int
        Ports, if they are free; 0: any.
    source : path
        A view, in place of what is `put`.
    """

    def __init__(self, page: int = _PAGE, data: int = _DATA, source: Path | None = None) -> None:
        self._ports = page, data = _free(page), _free(data)
        self.link = f"http://{ADDRESS}:{page}?url=rerun%2Bhttp%3A%2F%2F{ADDRESS}%3A{data}%2Fproxy"
        """What a browser opens."""
        self.address = f"rerun+http://{ADDRESS}:{data}/proxy"
        """What the native viewer and rerun's own tools open."""
        ports = ["--bind", ADDRESS, "--port", str(data), "--web-viewer-port", str(page)]
        memory = ["--server-memory-limit", _MEMORY if source is None else "75%"]
        self._process = subprocess.Popen(
            [RERUN, "--serve-web", *ports, *memory, source or "-"],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            env=os.environ | {"RUST_LOG": "error"},
            # A Ctrl-C is for us: what has been recorded until then is served.
            process_group=0,
            preexec_fn=end_with_parent,
        )
        assert self._process.stdin is not None
        os.set_blocking(self._process.stdin.fileno(), False)

    def __enter__(self) -> "LiveServer":
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
        self._check()
        return True

    def wait(self) -> None:
        """Wait until viewers can connect. Raises as `put`."""
        while not self.ready:
            self._check()
            time.sleep(_PERIOD)

    def _check(self) -> None:
        if self._process.poll() is not None:
            raise OSError("rerun's server has ended")

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


def serve(path: Path) -> None:
    """Serve the recordings that grow at a path until a signal comes; prints the link when viewers can connect.

    Raises OSError if the server has ended.
    """
    limit, printed = math.inf, False

    def stop(*_: object) -> None:
        nonlocal limit
        limit = min(limit, time.monotonic() + _LAST)

    def late() -> bool:
        return time.monotonic() > limit

    def run(server: LiveServer) -> None:
        nonlocal printed
        for messages in follow(path):
            if not server.put(messages, late) or late():
                return
            if not printed and server.ready:
                printed = True
                print(f"{server.link}\nor: rerun {server.address}", flush=True)
            if not messages:
                time.sleep(_PERIOD)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, stop)
    if sys.stderr.isatty() and not any(map(grows, _records(path))):  # a session starts the page before the recorder
        there = f"; {path} does not grow any more: `view` shows it" if path.exists() else ""
        print(f"waiting until {path} grows{there}", file=sys.stderr, flush=True)
    try:
        with LiveServer() as server:
            run(server)
    except OSError:
        if printed:
            raise
        # Somebody else has taken a port since it was found free.
        with LiveServer(0, 0) as server:
            run(server)


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(
        prog="live", description="Show a recording in a web browser while it grows; print the link."
    )
    parser.add_argument("recording", type=Path, help="path of the recorder: run.mcap; run-2.mcap, ... are shown too")
    light()
    try:
        serve(parser.parse_args().recording.absolute().with_suffix(RECORD))
    except OSError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
