"""Names of recordings, of which none is ever taken from a file that has it. Needs no ROS."""

import itertools
import os
import stat
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path


def numbered(path: Path, first: int = 1) -> Iterator[Path]:
    """run.rrd, run-2.rrd, run-3.rrd, ..., from number `first` on."""
    return (path.with_stem(f"{path.stem}-{n}") if n > 1 else path for n in itertools.count(first))


def partial_of(path: Path) -> Path:
    """Where the recording `path` grows: recording.partial.rrd for recording.rrd."""
    return path.with_stem(f"{path.stem}.partial")


def claim(source: Path, names: Iterator[Path]) -> Path:
    """Give a file the first of these names that is free; another process may want it at the same moment.

    Raises
    ------
    FileExistsError
        If none is free.
    OSError
        If it cannot be renamed.
    """
    for name in names:
        try:
            os.link(source, name, follow_symlinks=False)
        except FileExistsError:
            continue
        except OSError:  # a file system without links
            with suppress(FileExistsError):
                os.close(os.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL))
                os.replace(source, name)
                return name
            continue
        source.unlink()
        return name
    raise FileExistsError(f"{name} exists: give another name, nothing is overwritten")


def check_name(path: Path) -> None:
    """Raise if the path cannot be that of a recording.

    Raises
    ------
    OSError
        If something other than a plain file stands there, or the name is kept for recordings under way.
    """
    if path.stem.endswith((".partial", ".closing")):
        raise OSError(f"the name {path.name} is kept for recordings under way: take another one")
    check_plain(path)


def check_plain(path: Path) -> None:
    """Raise if the path is no plain file: a link would be followed, a device replaced."""
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return
    for is_kind, what in ((stat.S_ISDIR, "folder"), (stat.S_ISLNK, "symbolic link"), (stat.S_ISREG, "")):
        if is_kind(mode):
            if what:
                raise OSError(f"{path} is a {what}: it must be a plain file or not exist")
            return
    raise OSError(f"{path} is a device, pipe or socket: it must be a plain file or not exist")
