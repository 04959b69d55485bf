"""Realtime: simulated time goes on with the steady clock."""

import math

import numpy as np
from numpy.typing import NDArray

from ..core.errors import DivergenceError, DriveError, PartError
from ..parts.command import Command, problem
from .course import Course, Pacing
from .state import Cause, State

_Array = NDArray[np.float64]
_RING = 4096
"""Measurements whose time of publication is known; a drive for an older one counts as outdated."""


class Realtime(Pacing):
    """Tick at absolute deadlines of the clock, with the newest drive or the last one held.

    The newest drive is the one with the highest sequence. One for an older measurement than the drive in force answers,
    or for the same again, is counted and not put in force, whenever it arrives.
    """

    def __init__(self, course: Course) -> None:
        self._course = course
        self._instrument = course.instrument
        self._drive: _Array | Command = np.zeros(3)
        self._published_at = np.zeros(_RING)
        self._answered = -1  # sequence of the measurement that the drive in force answers; -1: none does
        self._last_drive_at = self._linked_at = self._asked_at = math.nan
        self._period = self._deadline = self._catch_up = 0.0

    def start(self) -> None:
        """Hold the drive of the start; the first deadline is one period from now."""
        # What is still there answers the run before.
        while self._course.take() is not None:
            pass
        self._drive = self._instrument.drive
        self._answered = -1
        self._asked_at = math.nan  # when the measurement behind the drive in force was published
        self._linked_at = math.nan  # when the first drive arrived
        self.resume()
        self._publish()

    def resume(self) -> None:
        """Begin a new series of deadlines; a controller has its time again."""
        self._period = 0.0
        if self._course.phase == State.RETRACTED:
            # What was retracted stays where it is until the controller answers, or is silent again.
            self._drive = self._instrument.drive
            self._instrument.guard.release()
        self.adapt()
        self._last_drive_at = self._course.clock()

    def adapt(self) -> None:
        """Follow a change of the parameters: another period is a new series of deadlines."""
        parameters = self._course.parameters
        period = parameters.plant.control_period / parameters.run.real_time_factor
        self._catch_up = max(parameters.run.catch_up, period)
        if period != self._period:
            self._period = period
            self._deadline = self._course.clock() + period

    @property
    def deadline(self) -> float | None:
        """When the next tick is due [s]."""
        return self._deadline

    def _publish(self) -> None:
        ticks = self._instrument.ticks
        self._published_at[ticks % _RING] = self._course.clock()
        if not self._instrument.unasked:
            self._course.link.publish(ticks, self._instrument.measurement)

    def step(self) -> bool:
        """Tick if the deadline has come."""
        now = self._course.clock()
        if now < self._deadline:
            return False
        course = self._course
        late = now - self._deadline
        self._deadline += self._period
        if late >= self._period:
            course.counts.late_ticks += 1
            if late >= self._catch_up:
                # Periods left out stay left out: a burst of ticks would show the controller a time that never was.
                missed = int(late / self._period)
                course.counts.periods_missed += missed
                self._deadline += missed * self._period
        round_trip = self._take_newest(now)
        if math.isnan(round_trip):
            if self._foreseen():
                course.counts.horizon_ticks += 1
            else:
                course.counts.drives_lost += 1
        self._watch_over(now)
        course.ticker.note_delay(late, now - self._asked_at)
        try:
            going_on = course.ticker.tick(self._drive, round_trip, self._answered)
        except DivergenceError as error:
            course.fail(self._explain(error))
            return True
        except PartError as error:
            course.fail(str(error))
            return True
        if going_on:
            self._publish()
        else:
            course.finish()
        return True

    def _take_newest(self, now: float) -> float:
        """Put the newest valid drive in force; its round trip [s], NaN if none came since the last tick."""
        course, ticks = self._course, self._instrument.ticks
        taken_at = math.nan
        while (taken := course.take()) is not None:
            sequence, drive = taken
            if sequence > ticks:
                course.counts.drives_ahead += 1
            elif sequence <= self._answered or ticks - sequence >= _RING:
                course.counts.drives_outdated += 1
            elif reason := problem(drive):
                course.refuse(reason, sequence)
            else:
                assert not isinstance(drive, DriveError)
                self._drive = drive if isinstance(drive, Command) else drive.copy()
                self._answered = sequence
                self._last_drive_at = now
                # A drive is taken at a tick, but it may have come any time before.
                taken_at = course.link.arrived()
                if math.isnan(self._linked_at):
                    self._linked_at = taken_at
        if math.isnan(taken_at):
            return math.nan
        self._asked_at = float(self._published_at[self._answered % _RING])
        # What was published before the first drive arrived may have waited for the nodes to find each other.
        if self._asked_at <= self._linked_at:
            course.ticker.doubt_next()
        return min(max(taken_at, self._asked_at), now) - self._asked_at

    def _foreseen(self) -> bool:
        """Whether the drive in force has one in its horizon for the tick that begins."""
        drive, period = self._drive, self._course.parameters.plant.control_period
        return isinstance(drive, Command) and drive.covers((self._instrument.ticks - self._answered) * period)

    def _watch_over(self, now: float) -> None:
        """Retract the sample when the controller has been silent for too long; come back with its next drive."""
        course = self._course
        run, life, counts = course.parameters.run, course.life, course.counts
        silent = now - self._last_drive_at > run.watchdog_timeout
        if silent and life.state == State.RUNNING:
            self._drive = self._instrument.drive
            self._instrument.guard.retract()
            life.go(
                Cause.SILENT,
                f"no valid drive from {course.controller} for {run.watchdog_timeout:g} s (run.watchdog_timeout; "
                f"{counts.drives_refused} refused as NaN or infinite{self._unused()}): the sample is retracted",
            )
        elif not silent and life.state == State.RETRACTED:
            self._instrument.guard.release()
            life.go(Cause.ANSWERED)

    def _unused(self) -> str:
        """Drives that came and were not put in force, for a sentence."""
        counts = self._course.counts
        kinds = (
            (counts.drives_outdated, "for an older measurement"),
            (counts.drives_ahead, "for a future one"),
            (counts.drives_malformed, "that cannot be read"),
        )
        return "".join(f", {count} {kind}" for count, kind in kinds if count)

    def _explain(self, error: DivergenceError) -> str:
        """Add how old the drives were, which makes a loop unstable that is not in lockstep."""
        course = self._course
        course.ticker.flush()
        oldest = course.ticker.oldest_command / self._period
        return (
            f"{error}, or the drives are too late: they were up to {oldest:.3g} control periods old (lower "
            f"run.real_time_factor = {course.parameters.run.real_time_factor:g} to give the controller time)"
        )
