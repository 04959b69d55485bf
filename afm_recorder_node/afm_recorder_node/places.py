"""Where recordings are: records, what stands next to them, folders, bags. Needs no ROS."""

import glob
import os
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

from .names import RECORD, VIEW
from .record import NotOurs, RecordEntry, open_record
from .recording import RecordingError


@runtime_checkable
class MessageSource(Protocol):
    """The messages of one run, from a record or a bag."""

    path: Path
    about: dict[str, str]

    @property
    def missing(self) -> str:
        """Why it is not complete; empty if it is."""
        ...

    def messages(
        self, topics: Collection[str] | None = None, begin_ns: int = 0, end_ns: int = 2**63
    ) -> Iterator[RecordEntry]:
        """See `Record.messages`."""
        ...


def recordings(places: Sequence[str]) -> list[Path]:
    """The recordings at these places: records, bags, folders with all recordings below them, patterns with *.

    Raises
    ------
    RecordingError
        If one of the places has no recording.
    """
    found: dict[Path, None] = {}
    for place in places:
        path = Path(place)
        here = [path] if path.exists() else [Path(each) for each in sorted(glob.glob(place, recursive=True))]
        here = [file for each in here for file in (_below(each) if each.is_dir() else [_record_of(each)])]
        if not here:
            raise RecordingError(f"{place} is no readable recording: there is no {RECORD} file")
        found |= dict.fromkeys(here)
    return list(found)


def open_recording(path: str | os.PathLike[str]) -> MessageSource:
    """Check a recording, and give its messages.

    Parameters
    ----------
    path : path
        A record (.mcap), the view next to it (.rrd), a folder with one of them, or a bag of `ros2 bag record`.

    Raises
    ------
    DamagedRecording
        If it is not what was written.
    RecordingError
        If there is no recording, or several.
    """
    place = Path(path)
    if place.is_dir():
        here = _below(place)
        if not here:
            raise RecordingError(f"{place} is no readable recording: there is no {RECORD} file in it")
        if len(here) > 1:
            names = ", ".join(each.name for each in here[:5])
            raise RecordingError(f"{place} holds {len(here)} recordings: give one of {names}")
        place = here[0]
    place = _record_of(place)
    if place.suffix == RECORD and not place.is_dir():
        try:
            return open_record(place)
        except NotOurs:
            pass
    from .bag import open_bag

    return open_bag(place)


def _record_of(path: Path) -> Path:
    """The record of a view."""
    if path.suffix != VIEW:
        return path
    record = path.with_suffix(RECORD)
    if not record.exists():
        if not path.exists():
            return path
        raise RecordingError(
            f"{path} is no readable recording: it is for the viewer, and its record {record.name} is not next to it"
        )
    return record


def _below(folder: Path) -> list[Path]:
    """Records and bags in a folder, and below it; a bag is a folder with metadata.yaml."""
    bags = [file.parent for file in folder.rglob("metadata.yaml")]
    records = [file for file in folder.rglob(f"*{RECORD}") if file.parent not in bags]
    return sorted([*bags, *records])
