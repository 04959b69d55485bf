"""What a process uses, read from /proc."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

from afm_node_common.shared_memory import used_by


@dataclass(frozen=True)
class Sample:
    """What a process uses at a time."""

    at: float
    """Monotonic time [s]."""
    memory: float
    """Resident memory that belongs to no file [bytes]."""
    shared: float
    """Resident shared memory [bytes]."""
    descriptors: float
    threads: float
    segments: float
    """Files of the middleware in /dev/shm that it has mapped."""
    processor: float
    """Processor time used since its start [s]."""


_TICK = os.sysconf("SC_CLK_TCK")


def sample(pid: int) -> Sample:
    """What the process uses now.

    Raises
    ------
    OSError
        If it has ended.
    """
    folder = Path(f"/proc/{pid}")
    status = dict(line.split(":", 1) for line in (folder / "status").read_text().splitlines())
    # Behind the name, which may hold anything: fields 14 and 15 of proc(5).
    times = (folder / "stat").read_text().rpartition(")")[2].split()[11:13]
    return Sample(
        at=time.monotonic(),
        memory=_bytes(status["RssAnon"]),
        shared=_bytes(status["RssShmem"]),
        descriptors=len(os.listdir(folder / "fd")),
        threads=int(status["Threads"]),
        segments=len(used_by(pid)),
        processor=sum(map(int, times)) / _TICK,
    )


def _bytes(entry: str) -> int:
    number, unit = entry.split()
    assert unit == "kB"
    return 1024 * int(number)
