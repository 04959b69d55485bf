"""The growing file of a recording: locked by one process, and readable at any time. Needs no ROS."""

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from .names import check_name, check_plain, claim, numbered, partial_of

_COPIED_AT_ONCE = 1 << 24
_NONE = -1


class InUse(OSError):
    """Another recorder writes there."""


class Partial:
    """The file that a recording grows in, beside the name it will have: the first free one of run.rrd, run-2.rrd, ...

    It is locked by the kernel for as long as this process lives, so that no two recorders write one file. What a
    recorder that died has left there is set aside: recording.interrupted.rrd, then recording.interrupted-2.rrd.

    Writing raises nothing. What could not be written is kept and tried again with the next write; the file is cut back
    to what was whole, so that it can be read in between.

    Parameters
    ----------
    path : Path
        First name of the recording.
    header : bytes
        First bytes of the file.
    patient : bool
        If the file cannot be made now, try again with each write in place of raising.
    number : int
        First number to be tried.

    Raises
    ------
    InUse
        If another recorder writes there.
    OSError
        If the file cannot be made; the message says why.
    """

    def __init__(self, path: Path, header: bytes, *, patient: bool = False, number: int = 1) -> None:
        self._first = path
        self.number = number - 1
        for self.name in numbered(path, number):
            self.number += 1
            check_name(self.name)
            if not self.name.exists():
                break
        self.path = partial_of(self.name)
        self.set_aside: Path | None = None
        """What a recorder that died had left; None if there was nothing."""
        self.problem = ""
        """Why the last data was not written; empty if it was."""
        self.news = ""
        """Message for the log, once; empty if there is none."""
        self._written = 0
        self._waiting = bytearray(header)
        self._file = _NONE
        try:
            self._file = self._open()
        except OSError as error:
            if not patient or isinstance(error, InUse):
                raise
        if not self.write(b"") and not patient:
            self.discard()
            raise OSError(self.problem)

    def write(self, messages: bytes) -> bool:
        """Append `messages`. False if it was not possible: see `problem`."""
        self._waiting += messages
        try:
            if not self._there():
                self._make_again()
            done = 0
            while done < len(self._waiting):
                with memoryview(self._waiting) as rest:
                    done += os.pwrite(self._file, rest[done:], self._written + done)
        except OSError as error:
            self.problem = f"{self.path} cannot be written: {error.strerror or error}"
            # Whole messages stay readable.
            with suppress(OSError):
                os.ftruncate(self._file, self._written)
            return False
        self._written += done
        self._waiting.clear()
        self.problem = ""
        return True

    @property
    def names(self) -> Iterator[Path]:
        """Names that it may get, of which the first free one is its own."""
        return numbered(self._first, self.number)

    def give_name(self) -> Path:
        """The file is complete: give it the first name that is free."""
        os.fsync(self._file)
        name = claim(self.path, self.names)
        self.release()
        return name

    def discard(self) -> None:
        """Remove the file."""
        if self._there():
            self.path.unlink()
        self.release()

    def release(self) -> None:
        """Let the file go, where it is."""
        if self._file != _NONE:
            os.close(self._file)
            self._file = _NONE

    def _open(self) -> int:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        while True:
            check_plain(self.path)
            flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
            file = os.open(self.path, flags, 0o666)
            try:
                if not _lock(file):
                    raise InUse(f"another recorder writes {self.path}: choose another path")
                if self._is(file):  # not removed or set aside by another recorder just now
                    if os.fstat(file).st_size == 0:
                        return file
                    stem = self.path.stem.removesuffix(".partial")
                    self.set_aside = claim(self.path, numbered(self.path.with_stem(f"{stem}.interrupted")))
            except BaseException:
                os.close(file)
                raise
            os.close(file)

    def _there(self) -> bool:
        return self._file != _NONE and self._is(self._file)

    def _is(self, file: int) -> bool:
        """Whether the path still leads to this open file."""
        try:
            return os.path.samestat(os.lstat(self.path), os.fstat(file))
        except (FileNotFoundError, NotADirectoryError):
            return False

    def _make_again(self) -> None:
        """Make the removed file again from the open one, whose contents still exist."""
        old, self._file = self._file, self._open()
        if old == _NONE:
            return
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


def _lock(file: int) -> bool:
    """Lock an open file. A reader that asks whether it grows holds its lock for a moment: that is no recorder."""
    for pause in (0.01, 0.0):
        with suppress(BlockingIOError):
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        time.sleep(pause)
    return False
