"""A disk that gets full, and a limit on the size of files: real ones."""

import resource
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random

import numpy as np
from support import Graph

from afm_recorder_node.recording import Recording
from torture.family import Try, Unavailable
from torture.outcome import Outcome
from torture.trio import RECORDER, Trio, lost, read, ticks_of

_ROOM = 256 * 2**20
"""Bytes of the small disk."""


@contextmanager
def full(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
    """The disk is full for some seconds."""
    disk = folder / "disk"
    disk.mkdir(parents=True, exist_ok=True)
    mount = ["mount", "-t", "tmpfs", "-o", f"size={_ROOM}", "tmpfs", str(disk)]
    done = subprocess.run(mount, capture_output=True, text=True)
    if done.returncode:
        raise Unavailable(f"no small disk without root: {done.stderr.strip()}")
    try:
        ballast = disk / "ballast"

        def fill(_: Trio) -> None:
            with ballast.open("wb", buffering=0) as file, suppress(OSError):
                while file.write(b"\0" * 4096):
                    pass

        with _short_of_room(graph, disk, namespace, fill, lambda _: ballast.unlink(missing_ok=True)) as one:
            yield one
    finally:
        subprocess.run(["umount", "--lazy", str(disk)], check=True)


@contextmanager
def limited(graph: Graph, folder: Path, namespace: str) -> Iterator[Try]:
    """The size of a file is limited for some seconds (RLIMIT_FSIZE of the recorder)."""

    def limit(trio: Trio) -> None:
        size = trio.path.stat().st_size
        resource.prlimit(trio.pid(RECORDER), resource.RLIMIT_FSIZE, (size + 1000, resource.RLIM_INFINITY))

    def lift(trio: Trio) -> None:
        unlimited = (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
        if RECORDER in trio.commands:
            resource.prlimit(trio.pid(RECORDER), resource.RLIMIT_FSIZE, unlimited)

    with _short_of_room(graph, folder, namespace, limit, lift) as one:
        yield one


@contextmanager
def _short_of_room(
    graph: Graph, folder: Path, namespace: str, fill: Callable[[Trio], None], free: Callable[[Trio], None]
) -> Iterator[Try]:
    number = 0

    def one(rng: Random, outcome: Outcome) -> None:
        nonlocal number
        number += 1
        trio = Trio(graph, folder / f"{number}", f"{namespace}_{number}")
        try:
            trio.start_all()
            trio.pass_time(rng.uniform(0.1, 1.0))
            listener, at = trio.listener, time.monotonic()
            fill(trio)
            trio.until(lambda: not listener.recorder.writing)
            told = listener.when_recorder(lambda status: not status.writing, at)
            assert told is not None
            outcome.told["recorder_status reports that nothing can be written"] = told - at
            trio.pass_time(rng.uniform(0.1, 3.0))
            if rng.random() < 0.3:
                killed = trio.kill(RECORDER)
                recording = read(trio.path)
                # What came while nothing could be written is told to be missing.
                outcome.lost = max(0.0, lost(trio.listener, ticks_of(recording, trio.listener), killed) - (killed - at))
                outcome.what = "killed while full: what was written before is readable"
                trio.end()
                return
            free(trio)
            trio.until(lambda: listener.recorder.writing)
            trio.pass_time(0.6)
            missing = listener.recorder.ticks_unwritten
            trio.end()
            recording = read(trio.path)
            _check_gap(recording, ticks_of(recording, trio.listener), missing)
            outcome.what = "goes on when there is room; the recording contains how many ticks are missing"
        finally:
            free(trio)
            trio.destroy()
            with suppress(OSError):
                trio.path.unlink()

    yield one


def _check_gap(recording: Recording, ticks: "np.ndarray[tuple[int], np.dtype[np.int64]]", missing: int) -> None:
    """What is missing is what was told, on the topic and in the recording."""
    told = f"{missing} ticks and "
    assert (told in recording.missing) if missing else recording.complete, recording.missing
    gap = int(ticks[-1] - ticks[0]) + 1 - len(ticks)
    assert gap == missing, f"{gap} ticks are missing in the recording, the recorder told {missing}"
    if missing:
        assert any(text.startswith(told) for _, text in recording.events), f"no event tells of {missing} ticks"
