"""How a file of results comes to its place: whole, or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import get_ident

from ..core.errors import ResultFileError


def reason(error: BaseException) -> str:
    """Why something with a file went wrong, in words."""
    strerror = getattr(error, "strerror", None)
    return str(strerror or error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__


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
