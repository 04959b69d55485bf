"""Height maps from files: .npy, .gsf, .gwy, .sxm, images. Rows go along y, upwards."""

import json
import os
import stat
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .map_reader import MEMORY, MOST_BYTES, MOST_VALUES, PROCESSOR_TIME, SUFFIXES

_READER = Path(__file__).with_name("map_reader.py")
_PATIENCE = 10 * PROCESSOR_TIME
"""Wall time for the reader [s]: the machine may be busy, and the file on a disk that stands still."""
_ALLOWED = (
    f"allowed are {', '.join(SUFFIXES)} of 4 x 4 to {MOST_VALUES} values and at most {MOST_BYTES >> 20} MB, read "
    f"within {PROCESSOR_TIME} s and {MEMORY >> 30} GB of memory"
)


class StoredMap(NamedTuple):
    """A map as a file holds it."""

    values: NDArray[np.float64]  # (rows, columns), row 0 at the least y
    width: float  # [m]; 0 if the file does not contain it
    height: float


def read_field(path: str) -> StoredMap:
    """Read the first map of a file.

    A separate process reads it, bounded in memory and time: no file ends or stops the process that calls.

    Parameters
    ----------
    path : str
        Of .npy and images the unit is the user's; .gsf, .gwy and .sxm are in metres. Images are read as grey,
        0 to 1, those in floating point as they are.

    Raises
    ------
    ValueError
        If it cannot be read as a map of finite numbers; one sentence that names the file, what is wrong and what is
        allowed.
    """
    file_stamp(path)
    # One thread: each takes of the memory that is allowed.
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    # -P: what stands beside the program is no module of it.
    command = [sys.executable, "-P", str(_READER), path]
    try:
        done = subprocess.run(
            command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, timeout=_PATIENCE, check=False
        )
    except (OSError, subprocess.SubprocessError, MemoryError) as error:
        raise _refused(path, f"its reader failed ({type(error).__name__})") from None
    if done.returncode or not done.stdout:
        raise _refused(path, f"its reader ended with code {done.returncode}")
    head, _, numbers = done.stdout.partition(b"\n")
    found = json.loads(head)
    if "problem" in found:
        raise _refused(path, found["problem"])
    values = np.frombuffer(numbers, "<f8").reshape(found["shape"]).astype(np.float64)
    return StoredMap(values, found["width"], found["height"])


def file_stamp(path: str) -> int:
    """When a file was changed [ns].

    Raises
    ------
    ValueError
        If there is no regular file of that name.
    """
    try:
        about = os.stat(path)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else str(error)
        raise ValueError(f"there is no file {_short(path)}: {why}") from None
    if not stat.S_ISREG(about.st_mode):
        raise ValueError(f"there is no file {_short(path)}: it is not a regular file")
    return about.st_mtime_ns


def _refused(path: str, why: str) -> ValueError:
    return ValueError(f"{_short(path)} cannot be read as a height map: {why}; {_ALLOWED}")


def _short(path: str) -> str:
    """A path as it can stand in a sentence."""
    text = path if path.isprintable() else ascii(path)
    return text if len(text) <= 200 else f"{text[:97]}...{text[-97:]}"
