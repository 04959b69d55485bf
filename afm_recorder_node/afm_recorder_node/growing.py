"""A file that grows: locked by one process, whole at any time, patient with a full disk. Needs no ROS."""

import fcntl
import itertools
import os
import stat
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

_COPIED_AT_ONCE = 1 << 24
_NONE = -1


class InUse(OSError):
    """Another recorder writes there."""


def numbered(path: Path, first: int = 1) -> Iterator[Path]:
    """run.mcap, run-2.mcap, run-3.mcap, ..., from number `first` on."""
    return (path.with_stem(f"{path.stem}-{n}") if n > 1 else path for n in itertools.count(first))


def check_plain(path: Path) -> None:
    """Raise OSError if something other than a plain file stands at a path: a link would be followed."""
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return
    if stat.S_ISREG(mode):
        return
    kinds = ((stat.S_ISDIR, "folder"), (stat.S_ISLNK, "symbolic link"))
    what = next((name for is_kind, name in kinds if is_kind(mode)), "device, pipe or socket")
    raise OSError(f"{path} is a {what}: it must be a plain file or not exist")


class GrowingFile:
    """A new file at the first free one of the names run.mcap, run-2.mcap, ..., locked while this process lives.

    Writing raises nothing. What could not be written is kept and tried again with the next write; the file is cut back
    to what was whole, so that it can be read in between.

    Parameters
    ----------
    path : Path
        First name.
    patient : bool
        If the file cannot be made now, try again with each write in place of raising.
    number : int
        First number to be tried.
    also : str
        Suffix of a second file that will have the same name: a name is free if that one is free, too.

    Raises
    ------
    InUse
        If another recorder writes under that name.
    OSError
        If the file cannot be made; the message says why.
    """

    def __init__(self, path: Path, *, patient: bool = False, number: int = 1, also: str = "") -> None:
        self.path, self.number = path, number
        self._first, self._also = path, also
        self.problem = ""
        """Why the last data was not written; empty if it was."""
        self.news = ""
        """Message for the log, once; empty without news."""
        self._written = 0
        self._waiting = bytearray()
        self._file = _NONE
        try:
            self._make()
        except OSError as error:
            if not patient or isinstance(error, InUse):
                raise
            self.problem = str(error)

    def write(self, data: bytes | bytearray) -> bool:
        """Append `data`. False if that was not possible: see `problem`."""
        if self._waiting:
            self._waiting += data
            data = self._waiting
        try:
            if self._file == _NONE:
                self._make()
            elif not self._there():
                self._make_again()
            done = 0
            while done < len(data):
                with memoryview(data) as rest:
                    done += os.pwrite(self._file, rest[done:], self._written + done)
        except OSError as error:
            self.problem = f"{self.path} cannot be written: {error.strerror or error}"
            self._waiting = data if isinstance(data, bytearray) else bytearray(data)
            if self._file != _NONE:
                with suppress(OSError):
                    os.ftruncate(self._file, self._written)
            return False
        self._written += done
        self._waiting = bytearray()
        self.problem = ""
        return True

    @property
    def waiting(self) -> int:
        """Bytes that could not be written yet."""
        return len(self._waiting)

    def finish(self) -> None:
        """Have the system write what it still holds, and let the file go."""
        if self._file != _NONE:
            with suppress(OSError):
                os.fsync(self._file)
        self.release()

    def discard(self) -> None:
        """Remove the file."""
        if self._file != _NONE and self._there():
            self.path.unlink()
        self.release()

    def release(self) -> None:
        """Let the file go, where it is."""
        if self._file != _NONE:
            os.close(self._file)
            self._file = _NONE

    def _make(self) -> None:
        """Make the file under the first name that is free."""
        for path in numbered(self._first, self.number):
            check_plain(path)
            path.parent.mkdir(parents=True, exist_ok=True)
            if self._also and os.path.lexists(path.with_suffix(self._also)):
                self.number += 1
                continue
            flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
            try:
                self._file = os.open(path, flags, 0o666)
            except FileExistsError:
                if _in_use(path):
                    raise InUse(f"another recorder writes {path}: choose another path") from None
                self.number += 1
                continue
            fcntl.flock(self._file, fcntl.LOCK_EX)
            self.path = path
            return

    def _there(self) -> bool:
        """Whether the path still leads to this open file."""
        try:
            return os.path.samestat(os.lstat(self.path), os.fstat(self._file))
        except (FileNotFoundError, NotADirectoryError):
            return False

    def _make_again(self) -> None:
        """Make the removed file again from the open one, whose contents still exist."""
        old = self._file
        self._make()
        try:
            position = 0
            while position < self._written:
                block = os.pread(old, min(_COPIED_AT_ONCE, self._written - position), position)
                done = 0
                while done < len(block):
                    done += os.pwrite(self._file, memoryview(block)[done:], position + done)
                position += len(block)
        except OSError:
            with suppress(OSError):
                self.path.unlink()
            os.close(self._file)
            self._file = old
            raise
        os.close(old)
        self.news = f"{self.path} was removed while it was written: it has been made again, nothing is lost"


def _in_use(path: Path) -> bool:
    """Whether another process holds the lock of a file. A reader may hold one for a moment: that is not a recorder."""
    for pause in (0.01, 0.0):
        try:
            file = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError:
            return False
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
            return False
        except OSError:
            time.sleep(pause)
        finally:
            os.close(file)
    return True


def grows(path: Path) -> bool:
    """Return whether a recorder writes a file at present, as the lock of the file shows."""
    return _in_use(path)
