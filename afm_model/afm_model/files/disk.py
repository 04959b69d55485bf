"""A file for the HDF5 library that never fails towards it: the library crashes after a write that has failed."""

import io
from pathlib import Path
from typing import Any


class Disk(io.RawIOBase):
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
        super().__init__()
        self._file = path.open("w+b" if overwrite else "x+b", buffering=0)
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
                left = left[self._file.write(left) :]
        except OSError as error:
            self._error = self._error or error
            self._file.seek(len(left), io.SEEK_CUR)
        return size

    def readinto(self, into: Any) -> int:
        """Read; beyond the end, where a write was left out, there is nothing but zeros."""
        view = memoryview(into).cast("B")
        count = self._file.readinto(view) or 0
        view[count:] = bytes(len(view) - count)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        """Change the size."""
        try:
            return self._file.truncate(size)
        except OSError as error:
            self._error = self._error or error
            return size or 0

    def seek(self, place: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place."""
        return self._file.seek(place, whence)

    def tell(self) -> int:
        """The place."""
        return self._file.tell()

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        super().close()

    def readable(self) -> bool:
        """It is."""
        return True

    def writable(self) -> bool:
        """It is."""
        return True

    def seekable(self) -> bool:
        """It is."""
        return True
