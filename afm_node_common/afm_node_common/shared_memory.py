"""Shared memory of the middleware: the files of a process, and the removal of unused files.

Fast DDS removes its files when their last user ends. It does not when a user was killed, or when its watchdog has
called a port unhealthy, which takes a machine that stands still for a second. What is left then breaks or delays later
starts, until somebody removes it by hand.
"""

import fcntl
import os
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

File = tuple[str, int]
"""Path and inode: a file that was removed and made again is another one."""

_MAPPED = re.compile(r" (\d+) +(/dev/shm/fast(?:dds|rtps)_\w+)$", re.MULTILINE)
_FOLDER = Path("/dev/shm")
_NAME = re.compile(r"fast(?:dds|rtps)_\w+(?<!_el)(?<!_sl)(?<!_mutex)")
_OLD = 60.0
"""Age after which no process is about to open or lock a file for the first time [s]."""
_LOCKS = ("_el", "_sl")
"""Endings of the lock files next to a file: of its one owner, of its readers."""
_BESIDE = re.compile(r"(?:sem\.)?(?P<file>fast(?:dds|rtps)_\w+?)(?:_el|_sl|_mutex)")
"""A lock file, or the mutex of a port."""


def used_by(pid: int | str) -> set[File]:
    """Files that a process has mapped; none if it has ended or belongs to another user."""
    try:
        maps = Path(f"/proc/{pid}/maps").read_text()
    except OSError:
        return set()
    # A few of some thousand lines: to look for the pattern in all of them takes twice as long as to read them.
    ours = "\n".join(line for line in maps.splitlines() if "/dev/shm/" in line)
    return {(path, int(inode)) for inode, path in _MAPPED.findall(ours)}


def make_private() -> None:
    """Close the files of this process to other users: Fast DDS lets everybody read them, whatever the umask says."""
    for path, _ in used_by(os.getpid()):
        with suppress(OSError):  # a port of somebody else
            os.chmod(path, 0o600)


def unused(files: set[File]) -> set[File]:
    """Those of `files` that still exist and that no other process has mapped or locked."""
    left = {file for file in files if _exists(file)}
    for pid in os.listdir("/proc") if left else ():
        if pid.isdigit() and int(pid) != os.getpid():
            left -= used_by(pid)
    return {file for file in left if not any(_locked(file[0] + ending) for ending in _LOCKS)}


def old() -> set[File]:
    """Files of this user that are a minute old, among them those left by killed nodes of any run."""
    return {(str(path), about.st_ino) for path, about in _minute_old() if _NAME.fullmatch(path.name)}


def remove_stray() -> None:
    """Remove locks and mutexes that are a minute old and whose file is missing.

    Fast DDS removes a port whose owner was killed when it wants its number, and may leave what stood next to it.
    """
    for path, _ in _minute_old():
        beside = _BESIDE.fullmatch(path.name)
        if beside and not (_FOLDER / beside["file"]).exists() and not _locked(str(path)):
            with suppress(OSError):
                path.unlink()


def _minute_old() -> Iterator[tuple[Path, os.stat_result]]:
    for path in _FOLDER.iterdir():
        with suppress(OSError):
            about = path.stat()
            if about.st_uid == os.getuid() and time.time() > about.st_mtime + _OLD:
                yield path, about


def remove_unused(files: set[File]) -> None:
    """Remove the unused ones of `files`, with their lock files.

    Call it after this process has closed its own: what it still has mapped counts as unused.
    """
    for path, inode in unused(files):
        # Somebody else may have found it dead meanwhile, and have made it anew.
        if not _exists((path, inode)):
            continue
        # The mutex of a port is a separate file, mapped only while the port is being opened.
        mutex = path.replace("/dev/shm/", "/dev/shm/sem.") + "_mutex"
        for name in (path, mutex, *(path + ending for ending in _LOCKS)):
            with suppress(OSError):
                os.unlink(name)


@contextmanager
def shared_memory_cleanup() -> Iterator[None]:
    """Around the end of this process's nodes and context: remove the files that are unused afterwards.

    These include the files that killed nodes of other runs have left: some 0.5 MB each, that stay until the machine is
    restarted.
    """
    files = used_by(os.getpid())
    yield
    remove_unused(files | old())
    remove_stray()


def _exists(file: File) -> bool:
    try:
        return os.stat(file[0]).st_ino == file[1]
    except OSError:
        return False


def _locked(path: str) -> bool:
    """Whether a running process, in any container, holds this lock file."""
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(handle)
    return False
