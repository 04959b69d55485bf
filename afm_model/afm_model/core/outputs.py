"""Whether results can be written where they are wanted, before the work for them begins."""

import os
import tempfile
from pathlib import Path

from .errors import ResultFileError, reason


def require_file(path: Path | None) -> None:
    """Raise ResultFileError if no file can be written at a path; None is not wanted. Nothing is left there."""
    if path is None:
        return
    if path.is_dir():
        raise ResultFileError(f"{path} cannot be written: it is a folder")
    if not path.exists():
        _try(path.parent, path)
    elif not os.access(path, os.W_OK):
        raise ResultFileError(f"{path} cannot be written: Permission denied")


def require_folder(path: Path) -> None:
    """Raise ResultFileError if no file can be written into a folder, which need not exist. Nothing is left there."""
    _try(next(each for each in (path, *path.absolute().parents) if os.path.lexists(each)), path)


def _try(folder: Path, path: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ResultFileError(f"{path} cannot be written: {reason(error)}") from None
