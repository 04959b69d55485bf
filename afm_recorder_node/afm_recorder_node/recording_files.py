"""The files of a recorder, one for each run, and the log about them. Needs no ROS."""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from afm_model.core.errors import ParameterError

from .parameters import RecorderParameters
from .writer import RecordingWriter

_NAMES_TRIED = 20


class Log(Protocol):
    """A logger of rclpy or of Python."""

    def info(self, message: str) -> object: ...
    def warning(self, message: str) -> object: ...
    def error(self, message: str) -> object: ...


@dataclass(frozen=True)
class RecordedCounts:
    """What the present run has brought. Fields are named as in afm_msgs/RecorderStatus."""

    path: str
    ticks: int
    samples: int
    ticks_lost: int
    samples_lost: int
    ticks_unwritten: int
    samples_unwritten: int
    lines: int
    lines_lost: int


class RecordingFiles:
    """Opens the recordings of one run after another: recording.rrd, recording-2.rrd, ...; no file is replaced.

    Parameters
    ----------
    parameters : RecorderParameters
    log : Log
    """

    def __init__(self, parameters: RecorderParameters, log: Log) -> None:
        self._parameters, self._log = parameters, log
        self._path = Path(parameters.path).absolute()
        self._number = 0
        self._problem = ""

    def open_first(self) -> RecordingWriter:
        """The recording of the first run.

        Raises
        ------
        ParameterError
            If there cannot be a file at the path.
        """
        try:
            return self._open(patient=False)
        except OSError as error:
            raise ParameterError(f"cannot record to {self._path}: {error}") from None

    def open_next(self) -> RecordingWriter:
        """The recording of the next run, under the next name that is possible.

        Raises
        ------
        ParameterError
            If there is none.
        """
        # During a run nobody can choose another name.
        for _ in range(_NAMES_TRIED):
            try:
                return self._open(patient=True)
            except OSError as error:
                self._log.error(f"cannot record under the next name of {self._path}: {error}")
                self._number += 1
        raise ParameterError(f"cannot record to {self._path}, nor under {_NAMES_TRIED} names after it")

    def watch(self, writer: RecordingWriter) -> None:
        """Log each event of the file once."""
        problem, news = writer.problem, writer.take_news()
        if news:
            self._log.warning(news)
        if problem and not self._problem:
            self._log.error(f"{problem}; data is not recorded until it can be")
        if self._problem and not problem:
            self._log.info(f"{writer.partial} can be written again; an event describes the missing data")
        self._problem = problem

    def _open(self, *, patient: bool) -> RecordingWriter:
        writer = RecordingWriter(
            self._path,
            patient=patient,
            number=self._number + 1,
            every=self._parameters.every,
            title=self._parameters.title,
        )
        if writer.number > self._number + 1:
            self._log.warning(
                f"a recording is never replaced: this run is recorded in {writer.path}, the next free name"
            )
        self._number = writer.number
        if writer.set_aside:
            self._log.warning(
                f"a recorder that died has left {writer.set_aside}: it can be opened as it is, and "
                "`ros2 run afm_recorder_node repair` completes it"
            )
        return writer


def report(log: Log, counts: RecordedCounts, begin: int) -> None:
    """Log the contents of a finished recording, and missing data.

    Parameters
    ----------
    log : Log
    counts : RecordedCounts
    begin : int
        First recorded tick.
    """
    log.info(f"recorded {counts.ticks} ticks and {counts.samples} samples a channel in {counts.path}")
    if begin:
        log.warning(f"the recording begins at tick {begin}: the instrument ran before the recorder was there")
    if counts.ticks_lost or counts.samples_lost:
        log.error(f"{counts.ticks_lost} ticks and {counts.samples_lost} samples a channel are missing in it")
    if counts.lines_lost:
        log.error(f"{counts.lines_lost} lines of scans (trace and retrace counted each) are missing in it")
    if counts.ticks_unwritten or counts.samples_unwritten:
        log.error(
            f"{counts.ticks_unwritten} ticks and {counts.samples_unwritten} samples a channel came while its file "
            "could not be written, and are missing in it"
        )
