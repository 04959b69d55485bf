"""How a file of results comes to its place: whole, or not at all; and one that grows, on a disk that may be full."""

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import get_ident
from typing import Any

from ..core.errors import ResultFileError, reason


def checked(path: Path | str, suffix: str) -> Path:
    """The path, if a file of this kind can have it.

    Raises
    ------
    ResultFileError
        If the name does not end with `suffix` or cannot be, if it is a folder, or if its folder does not exist.
    """
    path = Path(path)
    if path.suffix.lower() != suffix:
        raise ResultFileError(f"{path} cannot be written: its name must end with {suffix}")
    try:
        if path.is_dir():
            raise ResultFileError(f"{path} cannot be written: it is a folder")
        if not path.parent.is_dir():
            raise ResultFileError(f"{path} cannot be written: there is no folder {path.parent}")
    except OSError as error:
        raise ResultFileError(f"{path} cannot be written: {reason(error)}") from None
    return path


@contextmanager
def replacing(path: Path | str, suffix: str) -> Iterator[Path]:
    """Temporary path of a file that replaces `path` when it is complete: after a failure the old file stays.

    Raises
    ------
    ResultFileError
        If it cannot be written; the message names it and says why.
    """
    path = checked(path, suffix)
    # The suffix stays last: libraries choose the format by it.
    beside = path.with_name(f".{os.getpid()}_{get_ident()}{suffix}")
    try:
        yield beside
        os.replace(beside, path)
    except OSError as error:
        raise ResultFileError(f"{path} cannot be written: {reason(error)}") from None
    finally:
        with suppress(OSError):
            beside.unlink()


class Disk(io.FileIO):
    """A file on the disk. What cannot be written is left out, and said when it is asked for.

    Parameters
    ----------
    path : Path
    overwrite : bool
        Without, there must be no file of this name.

    Raises
    ------
    OSError
        If it cannot be opened.
    """

    def __init__(self, path: Path, *, overwrite: bool) -> None:
        super().__init__(path, "w+" if overwrite else "x+")
        self._error: OSError | None = None

    def check(self) -> None:
        """Raise the error of the first write that has failed since the last time."""
        error, self._error = self._error, None
        if error is not None:
            raise error

    def write(self, content: Any) -> int:
        """Write all of it, or as much as can be."""
        left = memoryview(content).cast("B")
        size = len(left)
        try:
            while len(left):
                left = left[super().write(left) :]
        except OSError as error:
            self._error = self._error or error
            self.seek(len(left), io.SEEK_CUR)
        return size

    def readinto(self, into: Any) -> int:
        """Read; beyond the end, where a write was left out, there is nothing but zeros."""
        view = memoryview(into).cast("B")
        count = super().readinto(view) or 0
        view[count:] = bytes(len(view) - count)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Change the size."""
        try:
            return super().truncate(size)
        except OSError as error:
            self._error = self._error or error
            return size or 0
