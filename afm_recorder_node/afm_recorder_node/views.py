"""Makes recording.rrd, the view of a whole run, from its record; in a process apart. Needs no ROS."""

import ctypes
import fcntl
import json
import os
import signal
import sys
import threading
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import rerun as rr

from afm_model.core.errors import reason

from . import layout, screens
from .canvas import let_go, send_blueprint
from .places import open_recording
from .recording import RecordingError
from .view_writer import ViewWriter

_AT_ONCE = 1 << 20
_PR_SET_PDEATHSIG = 1
_LOW = 10
"""What is added to the nice value of the process that makes views: a run goes before."""


def make_view(source: Path, target: Path) -> None:
    """Draw a whole record into a new file for rerun.

    Raises
    ------
    RecordingError
        If the record cannot be read.
    OSError
        If there is something at `target`, or it cannot be written completely; nothing is left of it then.
    """
    record = open_recording(source)
    with written(target) as (stream, expected):
        writer = ViewWriter(stream, record.about, source.stem)
        writer.draw(record)
        send_blueprint(stream, screens.blueprint(writer.canvas.sent, writer.canvas.ranges))
        expected.update(writer.canvas.sent)


@contextmanager
def written(target: Path, application: str = layout.APPLICATION) -> Iterator[tuple[rr.RecordingStream, Counter[str]]]:
    """A new file of rerun's. It has no name before it is whole and has been read back, and no file is replaced.

    Yields
    ------
    (RecordingStream, Counter)
        What is sent to the stream gets into the file; to be filled with the rows of each entity.

    Raises
    ------
    OSError
        As `make_view`.
    """
    hidden = target.with_name(f".{target.name}.part")
    file = -1
    try:
        if os.path.lexists(target):
            raise FileExistsError("there is something: give another name, nothing is overwritten")
        file = _begun(hidden)
        expected = Counter[str]()
        with _stream_into(file, application) as stream:
            yield stream, expected
        _verify(hidden, expected)
        os.fsync(file)
        _name(hidden, target)
    except OSError as error:
        raise OSError(f"{target} cannot be written: {reason(error)}") from error
    finally:
        if file >= 0:
            with suppress(FileNotFoundError):
                hidden.unlink()
            os.close(file)


def _begun(path: Path) -> int:
    """An empty file of which no other process makes a view; one that was killed may have left something."""
    file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        # Another process may just have given it its name.
        if not os.path.samestat(os.fstat(file), os.lstat(path)):
            raise FileNotFoundError
        os.ftruncate(file, 0)
    except (BlockingIOError, FileNotFoundError):
        os.close(file)
        raise OSError("another process is making it") from None
    return file


@contextmanager
def _stream_into(file: int, application: str) -> Iterator[rr.RecordingStream]:
    """rerun writes into a pipe: of a failed write into a file it says nothing, and then waits for ever."""
    out, into = os.pipe()
    failed: list[OSError] = []

    def copy() -> None:
        while block := os.read(out, _AT_ONCE):
            try:
                while block and not failed:
                    block = block[os.write(file, block) :]
            except OSError as error:
                failed.append(error)

    copying = threading.Thread(target=copy)
    copying.start()
    stream = rr.RecordingStream(application, send_properties=False)
    try:
        stream.set_sinks(rr.FileSink(f"/proc/self/fd/{into}"))
        yield stream
    finally:
        os.close(into)
        stream.disconnect()
        del stream
        let_go()
        copying.join()
        os.close(out)
    if failed:
        raise failed[0]


def _verify(path: Path, expected: Mapping[str, int]) -> None:
    """Read a file to its end, and its index, with rerun's own reader; OSError if it does not hold the rows."""
    from rerun.chunk import RrdReader

    found = Counter[str]()
    try:
        reader = RrdReader(path)
        (store,) = reader.recordings()
        reader.store(store=store)
        for chunk in reader.stream(store=store):
            found[chunk.entity_path] += 0 if chunk.is_static else chunk.num_rows
    except (RuntimeError, ValueError) as error:
        raise OSError(f"it cannot be read back: {error}") from error
    if wrong := {name for name in {*found, *expected} if found[name] != expected.get(name, 0)}:
        rows = ", ".join(f"{found[name]} of {expected.get(name, 0)} rows of {name}" for name in sorted(wrong))
        raise OSError(f"it was read back with {rows}")


def _name(hidden: Path, target: Path) -> None:
    """Give a file its name, if that is still free."""
    try:
        os.link(hidden, target, follow_symlinks=False)
    except FileExistsError:
        raise
    except OSError:  # a file system without links
        os.close(os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL))
        os.replace(hidden, target)


# The process apart; `afm_recorder_node.views_worker` starts it.


def end_with_parent() -> None:
    """Have the system end this process with its parent, however that ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


class _NoPandas:
    """Finds no pandas."""

    @staticmethod
    def find_spec(name: str, *_: object) -> None:
        if name == "pandas":
            raise ModuleNotFoundError(name)


def light() -> None:
    """Keep pyarrow from importing pandas where that is installed: it takes a second and 30 MB."""
    sys.meta_path.insert(0, _NoPandas)


def _made(source: str, target: str) -> str:
    """Make a view; why it could not be made, empty if it is there."""
    try:
        make_view(Path(source), Path(target))
    except (RecordingError, OSError) as error:
        return str(error)
    except Exception as error:
        return f"{target} cannot be made: {type(error).__name__}: {error}"
    return ""


def main() -> int:
    """Make views: each line of the input holds a record and a target in JSON, each of the output an error."""
    end_with_parent()
    light()
    os.nice(_LOW)
    for line in sys.stdin:
        # Each in a process apart: rerun keeps threads and memory of every stream.
        if not (child := os.fork()):
            end_with_parent()
            error = _made(*json.loads(line))
            os.write(1, json.dumps(error).encode() + b"\n")
            os._exit(0)
        if status := os.waitpid(child, 0)[1]:
            print(json.dumps(f"rerun has ended with {os.waitstatus_to_exitcode(status)}"), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
