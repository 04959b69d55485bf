"""The folder of a session's results: only complete files have their final names, and nothing gets lost.

What is under way stands in `unfinished-<date>-<time>` in there. A session that fails leaves its recordings there; so
does one that is killed, although it cannot act then.
"""

import fcntl
import os
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from afm_model.core.errors import reason

PICTURE, CARD, RECORDING, RECORD = "overview.png", "scorecard.json", "recording.rrd", "recording.mcap"
_RECORDINGS = ("recording*.mcap", "recording*.rrd")
_END = b"\x89MCAP0\r\n"
"""The last bytes of a record that its recorder has ended."""


class FolderError(RuntimeError):
    """What is wrong with the folder, in one sentence."""


class ResultsFolder:
    """The results of one session. Use as a context manager.

    Parameters
    ----------
    path : Path
        Made if it is not there.
    names : sequence of str
        Final names of the results, without those of the recordings.

    Raises
    ------
    FolderError
        If it cannot be written, or another session writes to it.
    """

    def __init__(self, path: Path, names: Sequence[str] = (PICTURE, CARD)) -> None:
        self.path = path
        self._names = names
        try:
            path.mkdir(parents=True, exist_ok=True)
            # Held as long as this process lives.
            self._lock = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
        except OSError as error:
            raise FolderError(
                f"--out {path} cannot be written ({reason(error)}): it must be a folder you can write"
            ) from None
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            for name in (*names, RECORDING, RECORD):
                if (path / name).is_dir():
                    raise FolderError(f"{path / name} is a folder: it must be a file, or not be there")
            self.work = self._make("unfinished")
            """Folder of unfinished files."""
            # Held open, so that a folder made anew in its place has another inode.
            self._held = os.open(self.work, os.O_RDONLY | os.O_DIRECTORY)
        except OSError as error:
            os.close(self._lock)
            raise FolderError(
                f"another session writes to {path}: choose another folder"
                if isinstance(error, BlockingIOError)
                else f"--out {path} cannot be written ({reason(error)}): it must be a folder you can write"
            ) from None
        except FolderError:
            os.close(self._lock)
            raise
        self._before: Path | None = None

    def __enter__(self) -> "ResultsFolder":
        return self

    def __exit__(self, *_: object) -> None:
        """Keep logs; remove empty folders."""
        with suppress(OSError):
            self._keep_logs()
        with suppress(OSError):
            self.work.rmdir()
        os.close(self._held)
        os.close(self._lock)

    @property
    def there(self) -> bool:
        """Whether the folder is still there, and is still the same.

        Somebody may have removed it, and the recorder, which loses nothing, may have made it again.
        """
        try:
            return os.path.samestat(os.stat(self.work), os.fstat(self._held))
        except OSError:
            return False

    @property
    def left(self) -> list[Path]:
        """Recordings without a final name."""
        with suppress(OSError):
            return sorted(path for pattern in _RECORDINGS for path in self.work.glob(pattern))
        return []

    def set_older_aside(self) -> None:
        """Results of an older run would pass for those of this one; its recordings are kept until this one has its own.

        Raises
        ------
        OSError
            If they cannot be moved.
        """
        recordings = sorted(path for pattern in _RECORDINGS for path in self.path.glob(pattern) if path.is_file())
        older = [*recordings, *(self.path / name for name in self._names)]
        if recordings:
            self._before = self._make("previous")
            self._move(older, self._before)
        for path in older:
            path.unlink(missing_ok=True)

    def publish(self, *, complete: bool) -> list[Path]:
        """Rename the files in `work` to their final names; a recording without an end stays there.

        Parameters
        ----------
        complete : bool
            Whether the recording of the run before is now replaced.

        Returns
        -------
        list of Path
            The results.

        Raises
        ------
        OSError
            If something cannot be moved.
        """
        closed = [path for path in self.left if path.suffix != Path(RECORD).suffix or _has_end(path)]
        results = (self.work / name for name in self._names)
        names = [path.name for path in (*closed, *results) if path.exists()]
        self._move([self.work / name for name in names], self.path)
        if complete and self._before is not None:
            for path in self._before.iterdir():
                path.unlink()
            self._before.rmdir()
        return [self.path / name for name in names]

    def _keep_logs(self) -> None:
        """Move the logs of the nodes next to the results; those of the session before are replaced."""
        logs = self.path / "logs"
        found = sorted(self.work.glob("*.log")) + sorted(self.work.glob("*.yaml"))
        if found:
            logs.mkdir(exist_ok=True)
            self._move(found, logs)

    def _make(self, what: str) -> Path:
        """A new folder in here, named by its purpose and the time."""
        stamp = time.strftime("%Y%m%d-%H%M%S")
        for suffix in ("", *(f"-{n}" for n in range(2, 1000))):
            path = self.path / f"{what}-{stamp}{suffix}"
            try:
                path.mkdir()
            except FileExistsError:
                continue
            return path
        raise FileExistsError(f"{self.path} holds a thousand folders {what}-{stamp}")

    @staticmethod
    def _move(paths: Iterable[Path], folder: Path) -> None:
        for path in paths:
            if path.exists():
                path.replace(folder / path.name)


def _has_end(path: Path) -> bool:
    """Whether the recorder of a record has ended it."""
    with path.open("rb") as file:
        file.seek(max(file.seek(0, os.SEEK_END) - len(_END), 0))
        return file.read() == _END
