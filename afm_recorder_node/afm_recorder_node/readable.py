"""What of the file of a recording can be read, and whether it has changed since it was written."""

import fcntl
import glob
import os
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from afm_model.core.errors import reason

from .checksums import Extent, measure
from .recording import DamagedRecording, RecordingError

_BAGS = (".mcap", ".db3")


def is_bag(path: Path) -> bool:
    """Whether there is a bag of `ros2 bag record` at a path: its file, or its folder."""
    return path.suffix in _BAGS or (path / "metadata.yaml").is_file()


def recordings(places: Sequence[str]) -> list[Path]:
    """The recordings at these places: files, bags, folders with all recordings below them, patterns with *.

    Raises
    ------
    RecordingError
        If there is none at one of them.
    """
    found: dict[Path, None] = {}
    for place in places:
        path = Path(place)
        here = [path] if path.exists() else [Path(each) for each in sorted(glob.glob(place, recursive=True))]
        here = [file for each in here for file in (_below(each) if each.is_dir() and not is_bag(each) else [each])]
        if not here:
            raise RecordingError(f"{place} is no readable recording: there is no .rrd file")
        found |= dict.fromkeys(here)
    return list(found)


def _below(folder: Path) -> list[Path]:
    return sorted([*folder.rglob("*.rrd"), *(file.parent for file in folder.rglob("metadata.yaml"))])


@contextmanager
def readable(path: str | os.PathLike[str], *, salvage: bool = False) -> Iterator[tuple[Path, Extent]]:
    """A file that rerun can read to its end, and what of the recording is in it.

    Of one that breaks off within a message, or still grows, that is a copy of what is whole; of a bag, a recording made
    of it.

    Parameters
    ----------
    path : path
    salvage : bool
        Leave out what has changed since it was written, in place of raising.

    Raises
    ------
    DamagedRecording
        If it is not what was written.
    RecordingError
        If there is no file, or it is no .rrd file.
    """
    if is_bag(Path(path)):
        try:
            from .bag import recording_of
        except ImportError as error:
            raise RecordingError(
                f"{os.fspath(path)} is a bag, and {error}: it is read in the environment of env.sh, with "
                "`pip install rosbags`"
            ) from None
        path = recording_of(Path(path))
    try:
        with open(path, "rb") as file:
            extent = measure(file.fileno())
            if not extent.whole:
                raise RecordingError(f"{os.fspath(path)} is no readable recording: it is no .rrd file")
            if extent.damaged and not salvage:
                (begin, end), size = extent.damaged[0], sum(end - begin for begin, end in extent.damaged)
                raise DamagedRecording(
                    f"{os.fspath(path)} is damaged: bytes {begin} to {end} are not what was written ({size} bytes in "
                    "all); `ros2 run afm_recorder_node repair` copies the rest"
                )
            still = extent.whole == os.fstat(file.fileno()).st_size and not _grows(file.fileno())
            if not extent.damaged and (extent.complete or still):
                yield Path(path), extent
                return
            with tempfile.NamedTemporaryFile(suffix=".rrd") as copy:
                _copy_whole(os.fspath(path), file.fileno(), copy.fileno(), extent)
                extent.complete = False
                yield Path(copy.name), extent
    except OSError as error:
        # The words of an OSError name the file once more.
        raise RecordingError(f"{os.fspath(path)} is no readable recording: {reason(error)}") from error


def _copy_whole(name: str, file: int, copy: int, extent: Extent) -> None:
    position = 0
    try:
        for begin, end in (*extent.damaged, (extent.whole, extent.whole)):
            # The recorder may cut it back meanwhile, when its disk is full.
            while position < begin and (block := os.sendfile(copy, file, position, begin - position)):
                position += block
            position = max(position, end)
    except OSError as error:
        raise no_room(name, error) from error


def no_room(name: str, error: OSError) -> RecordingError:
    """Return the error for a recording of which no copy can be written."""
    return RecordingError(
        f"{name} cannot be read: the copy for it cannot be written into {tempfile.gettempdir()} ({reason(error)}): "
        "make room there, or set TMPDIR"
    )


def _grows(file: int) -> bool:
    """Whether a recorder writes on in it, as the lock of its file tells: the next message may be there by half."""
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    fcntl.flock(file, fcntl.LOCK_UN)
    return False
