"""Messages in; one record for each run of the instrument out. Needs no ROS."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from afm_model.core.errors import ParameterError

from .growing import GrowingFile
from .heads import MessageHead
from .names import VIEW
from .record_writer import RecordWriter
from .runs import RunProgress

_FLUSH_PERIOD = 0.4
"""Wall time between two chunks [s]: a kill loses at most this and the time between two calls of `update`."""
_WAITING = 16_000_000
"""Bytes that wait for a full disk, at most; blocks that come then are not written."""
_EARLY = 4000
"""Messages of a run without a block that are kept, at most: an image of 512 lines and its events."""
_NAMES_TRIED = 20
_TOLD = 100
"""Events about gaps in a record, at most."""


class Logger(Protocol):
    """A logger of rclpy or of Python."""

    def info(self, message: str) -> object: ...
    def warning(self, message: str) -> object: ...
    def error(self, message: str) -> object: ...


@dataclass(frozen=True, slots=True)
class Message:
    """A message as it came."""

    topic: str  # within the namespace of the instrument
    kind: str  # such as afm_msgs/msg/Waveform
    time_ns: int  # simulated
    received_ns: int  # wall time
    data: bytes


@dataclass(frozen=True)
class RecordedCounts:
    """What the present run has brought. Fields are named as in afm_msgs/RecorderStatus."""

    run_id: int
    path: str
    ticks: int
    samples: int
    ticks_lost: int
    samples_lost: int
    ticks_unwritten: int
    samples_unwritten: int
    lines: int
    lines_lost: int


class _Run:
    """A run, and its record once there is a block of it."""

    def __init__(self, progress: RunProgress) -> None:
        self.progress = progress
        self.writer: RecordWriter | None = None
        self.early: list[Message] = []  # before the first block
        self.seen: set[int] = set()  # hashes of the messages that are not blocks
        self.gaps = 0


class Recorder:
    """Sorts messages by the run that they name, and keeps those of each run in a file.

    Parameters
    ----------
    path : Path
        Of the first record; those of later runs have the next names that are free, run-2.mcap, ...
    log : Logger
    definition : callable
        definition(kind): text of a type of message.
    trace : str
        Topic of the blocks of control ticks.
    channels : list of str
        Topics of the channels that every instrument has.
    about : mapping of str to str
        What stands in every record.
    event : callable
        event(run_id, time_ns, text): an event of the recorder as a message.
    opened : callable
        opened(run_id, time_ns): a record begins.
    done : callable
        done(path): a record has been written to its end.

    Raises
    ------
    ParameterError
        If there cannot be a file at the path.
    """

    def __init__(
        self,
        path: Path,
        log: Logger,
        definition: Callable[[str], str],
        *,
        trace: str,
        channels: list[str],
        about: Mapping[str, str],
        event: Callable[[int, int, str], Message],
        opened: Callable[[int, int], None] = lambda *_: None,
        done: Callable[[Path], None] = lambda _: None,
    ) -> None:
        self._path, self._log, self._definition, self._about = path, log, definition, dict(about)
        self._trace, self._channels, self._event, self._opened, self._done = trace, channels, event, opened, done
        self._runs: dict[int, _Run] = {}
        self._closed: set[int] = set()
        self._present = 0  # the run that a record was opened for last
        self._flush_at = 0.0
        self._problem = ""
        self._last = RunProgress(0, trace, channels)
        self._last_path = path
        try:
            self._next: GrowingFile | None = GrowingFile(path, also=VIEW)
        except OSError as error:
            raise ParameterError(f"cannot record to {path}: {error}") from None
        self._number = 1
        self._take_name(self._next)

    @property
    def present(self) -> RunProgress:
        """The latest run that blocks have come of, also when its record is closed."""
        run = self._runs.get(self._present)
        return run.progress if run else self._last

    @property
    def path(self) -> Path:
        """Record of the latest run; before there is one, that of the next."""
        run = self._runs.get(self._present)
        if run is not None and run.writer is not None:
            return run.writer.file.path
        return self._next.path if self._next is not None else self._last_path

    @property
    def problem(self) -> str:
        """Why a file cannot be written at present; empty if all can."""
        return next(
            (run.writer.file.problem for run in self._runs.values() if run.writer and run.writer.file.problem), ""
        )

    def counts(self) -> RecordedCounts:
        """What the present run has brought up to now."""
        progress = self.present
        ticks, channels = progress.stream(self._trace), [progress.stream(name) for name in self._channels]
        return RecordedCounts(
            run_id=progress.run_id,
            path=str(self.path),
            ticks=ticks.received,
            samples=min(channel.received for channel in channels),
            ticks_lost=ticks.lost,
            samples_lost=max(channel.lost for channel in channels),
            ticks_unwritten=ticks.unwritten,
            samples_unwritten=max(channel.unwritten for channel in channels),
            lines=progress.lines.received,
            lines_lost=progress.lines.lost,
        )

    def block(self, message: Message, block: MessageHead) -> None:
        """Take a block of samples or of control ticks."""
        run = self._of(block.run_id)
        if run is None:
            return
        progress, stream = run.progress, run.progress.stream(message.topic)
        lost = stream.lost
        if not stream.put(block):
            return
        progress.count_block(message.topic)
        progress.heard_at = time.monotonic()
        progress.time_ns = max(progress.time_ns, message.time_ns)
        if run.writer is None:
            self._open(run)
        if stream.lost > lost and run.gaps < _TOLD:
            run.gaps += 1
            text = f"{stream.lost - lost} values of {message.topic} are missing before this"
            self._write(run, self._event(block.run_id, message.time_ns, text), always=True)
        if not self._write(run, message):
            stream.unwritten += block.count

    def put(self, message: Message, run_id: int, *, once: bool = True) -> RunProgress | None:
        """Take any other message; the run that it belongs to, None if it is not new, or its record is closed.

        `once`: the same bytes again are the same message.
        """
        run = self._of(run_id or self._present)
        if run is None:
            return None
        if once:
            key = hash((message.topic, message.data))
            if key in run.seen:
                return None
            run.seen.add(key)
        run.progress.heard_at = time.monotonic()
        run.progress.time_ns = max(run.progress.time_ns, message.time_ns)
        if run.writer is not None:
            self._write(run, message, always=once)
        elif len(run.early) < _EARLY:
            run.early.append(message)
        return run.progress

    def update(self) -> None:
        """Write what has come, and close the records of runs that are over; to be called some times a second."""
        now = time.monotonic()
        if now < self._flush_at:
            return
        self._flush_at = now + _FLUSH_PERIOD
        for run_id, run in list(self._runs.items()):
            if run.writer is not None:
                run.writer.flush()
                self._watch(run)
            # One that has brought no block yet may wait for its start.
            left = run_id < self._present if run.writer is None else run_id != self._present or run.progress.over
            if left and run.progress.ended():
                self._close(run_id)

    def waits(self) -> bool:
        """Whether something may still come of a run that has a record."""
        return any(run.writer is not None and not run.progress.ended() for run in self._runs.values())

    def close(self) -> None:
        """Close every record.

        Raises
        ------
        OSError
            If one could not be written to its end.
        """
        for run_id in list(self._runs):
            self._close(run_id)
        if self._next is not None:
            self._next.discard()
            self._next = None
        if not self._present:
            self._log.warning("nothing recorded: no block has come from the instrument")
        if self._problem:
            raise OSError(self._problem)

    def _of(self, run_id: int) -> _Run | None:
        if run_id in self._closed:
            return None
        if run_id not in self._runs:
            self._runs[run_id] = _Run(RunProgress(run_id, self._trace, self._channels))
        return self._runs[run_id]

    def _write(self, run: _Run, message: Message, *, always: bool = False) -> bool:
        """Give a message to the file; False if too much waits for the disk already."""
        assert run.writer is not None
        if run.writer.file.waiting > _WAITING and not always:
            return False
        run.writer.put(message.topic, message.kind, message.time_ns, message.received_ns, message.data)
        return True

    def _open(self, run: _Run) -> None:
        file, self._next = self._next or self._next_file(), None
        run_id = run.progress.run_id
        run.writer = RecordWriter(file, self._definition, self._about | {"run_id": str(run_id)})
        self._present = run_id
        self._opened(run_id, run.progress.time_ns)
        for message in run.early:
            self._write(run, message, always=True)
        run.early.clear()

    def _next_file(self) -> GrowingFile:
        # During a run nobody can choose another name.
        for _ in range(_NAMES_TRIED):
            self._number += 1
            try:
                file = GrowingFile(self._path, patient=True, number=self._number, also=VIEW)
            except OSError as error:
                self._log.error(f"cannot record under the next name of {self._path}: {error}")
                continue
            self._take_name(file)
            return file
        raise ParameterError(f"cannot record to {self._path}, and not under {_NAMES_TRIED} names after it")

    def _take_name(self, file: GrowingFile) -> None:
        if file.number > self._number:
            self._log.warning(f"a recording is never replaced: this run is recorded in {file.path}, the next free name")
        self._number = file.number

    def _watch(self, run: _Run) -> None:
        """Log each event of a file once."""
        assert run.writer is not None
        file = run.writer.file
        if file.news:
            self._log.warning(file.news)
            file.news = ""
        if file.problem and not self._problem:
            self._log.error(f"{file.problem}; what comes waits in memory, {_WAITING / 1e6:g} MB at most")
        if self._problem and not file.problem:
            lost = run.progress.unwritten()
            self._log.info(f"{file.path} can be written again")
            if lost:
                text = f"{lost[0]} ticks and {lost[1]} samples a channel are missing: {self._problem}"
                self._write(run, self._event(run.progress.run_id, run.progress.time_ns, text), always=True)
        self._problem = file.problem

    def _close(self, run_id: int) -> None:
        run = self._runs.pop(run_id)
        self._closed.add(run_id)
        if run.writer is None:
            return
        progress = run.progress
        missing = "; ".join(progress.missing())
        ticks, lines = progress.stream(self._trace).received, progress.lines.received
        end = {"complete": "false" if missing else "true", "missing": missing, "ticks": str(ticks), "lines": str(lines)}
        try:
            path = run.writer.close(end)
        except OSError as error:
            self._problem = str(error)
            self._log.error(self._problem)
            path = run.writer.file.path
        if run_id == self._present:
            self._last, self._last_path = progress, path
        samples = min(progress.stream(name).received for name in self._channels)
        self._log.info(f"recorded {ticks} ticks and {samples} samples a channel in {path}")
        if missing:
            self._log.warning(f"{path} is not complete: {missing}")
        if not self._problem:
            self._done(path)
