"""Real time: simulated time follows the steady clock."""

import math

import numpy as np
from numpy.typing import NDArray

from ..core.errors import DivergenceError, DriveError, PartError
from ..parameters import SimParameters
from ..parts.drives_ahead import Command, problem
from ..parts.ticks import ticks_of
from .context import RunContext
from .pacing import Peered
from .state import Cause, RunState

_Array = NDArray[np.float64]
_LONGEST_WAY = 2.0
"""The drive goes back to that of a controller that was silent within the time that so many times the way of a retract
takes: one that answers with leaps has the drive then, too.
"""
_IN_TIME = 2.5
"""Control periods up to which a drive in force is old where none is late, without `plant.delay_ticks`."""
_RING = 4096
"""Measurements whose time of publication is known; a drive for an older one counts as outdated."""


class Realtime(Peered):
    """Tick at absolute deadlines of the clock, with the newest drive or the last one held.

    The newest drive is the one with the highest sequence. One for an older measurement than the drive in force answers,
    or for the same again, is counted and not put in force, whenever it arrives.
    """

    by_clock = True

    def __init__(self, context: RunContext, parameters: SimParameters) -> None:
        super().__init__(context, parameters)
        self._asked: _Array | Command = np.zeros(3)  # drive of the controller that was put in force last, or held
        self.sequence: int = -1  # measurement that the drive in force answers; -1: none
        self._published_at = np.zeros(_RING)
        self._last_drive_at = self._linked_at = self._asked_at = math.nan
        self._held = self._way_back = 0  # ticks without a drive; ticks that the way back may still take
        self._late_tick = 0  # the last one with a drive that was too old
        self.deadline: float = 0.0
        self._period = self._catch_up = self._in_time = 0.0

    def start(self) -> None:
        """Hold the drive of the start; the first deadline is one period from now."""
        super().start()
        self._asked = self._instrument.drive
        self.sequence = -1
        self._held = self._way_back = self.scored_ticks_held = 0
        self._asked_at = math.nan  # when the measurement behind the drive in force was published
        self._linked_at = math.nan  # when the first drive arrived
        self.resume()
        self.made()

    def resume(self) -> None:
        """Begin a new series of deadlines; a controller has its time again."""
        self._period = 0.0
        if self._context.phase == RunState.RETRACTED:
            # What was retracted stays where it is until the controller answers, or is silent again.
            self._asked = self._instrument.drive
            self._release()
        self.adapt(self._parameters)
        self._last_drive_at = self._context.clock()

    def adapt(self, parameters: SimParameters) -> None:
        """Follow a change of the parameters: another period is a new series of deadlines."""
        self._parameters = parameters
        period = parameters.plant.control_period / parameters.run.real_time_factor
        self._catch_up = max(parameters.run.catch_up, period)
        self._in_time = (_IN_TIME + parameters.plant.delay_ticks) * period
        if period != self._period:
            self._period = period
            self.deadline = self._context.clock() + period

    def made(self) -> None:
        """Publish the next measurement."""
        ticks = self._instrument.ticks
        self._published_at[ticks % _RING] = self._context.clock()
        if not self._instrument.unasked:
            self._context.link.publish(ticks, self._instrument.measurement)

    def next(self) -> int | None:
        """One, if its deadline has come."""
        now = self._context.clock()
        if now < self.deadline:
            return None
        context = self._context
        late = now - self.deadline
        self.deadline += self._period
        if late >= self._period:
            context.counts.late_ticks += 1
            if late >= self._catch_up:
                # Periods left out stay left out: a burst of ticks would show the controller a time that never was.
                missed = int(late / self._period)
                context.counts.periods_missed += missed
                self.deadline += missed * self._period
        self.round_trip = self._take_newest(now)
        if math.isnan(self.round_trip):
            if self._foreseen():
                context.counts.horizon_ticks += 1
            else:
                context.counts.drives_lost += 1
                self.scored_ticks_held += self._instrument.ticks >= self._parameters.score_tick
                self._held += 1
        else:
            if self._held > self._ticks(self._parameters.run.retract_time):
                self._go_back()
            self._held = 0
        self._watch_over(now)
        self.drive = self._returning() if self._way_back and context.phase == RunState.RUNNING else self._asked
        age = now - self._asked_at
        if age > self._in_time:
            self._late_tick = self._instrument.ticks
        context.blocks.note_delay(late, age)
        return 1

    def _take_newest(self, now: float) -> float:
        """Put the newest valid drive in force; its round trip [s], NaN if none came since the last tick."""
        context, ticks = self._context, self._instrument.ticks
        taken_at = math.nan
        while (taken := self._take_readable()) is not None:
            sequence, drive = taken
            if sequence > ticks:
                context.counts.drives_ahead += 1
            elif sequence <= self.sequence or ticks - sequence >= _RING:
                context.counts.drives_outdated += 1
            elif reason := problem(drive):
                context.refuse(reason, sequence, self.answering)
            else:
                assert not isinstance(drive, DriveError)
                self._asked = drive if isinstance(drive, Command) else drive.copy()
                self.sequence = sequence
                self._last_drive_at = now
                # A drive is taken at a tick, but it may have come any time before.
                taken_at = context.link.arrived()
                if math.isnan(self._linked_at):
                    self._linked_at = taken_at
        if math.isnan(taken_at):
            return math.nan
        self._asked_at = float(self._published_at[self.sequence % _RING])
        # What was published before the first drive arrived may have waited for the nodes to find each other.
        if self._asked_at <= self._linked_at:
            context.blocks.doubt_next()
        return min(max(taken_at, self._asked_at), now) - self._asked_at

    def _foreseen(self) -> bool:
        """Whether the drive in force has one in its horizon for the tick that begins."""
        drive, period = self._asked, self._parameters.plant.control_period
        return isinstance(drive, Command) and drive.covers((self._instrument.ticks - self.sequence) * period)

    def _watch_over(self, now: float) -> None:
        """Retract the sample when the controller has been silent for too long; come back with its next drive."""
        context = self._context
        run, life, counts = self._parameters.run, context.life, context.counts
        silent = now - self._last_drive_at > run.watchdog_timeout
        if silent and life.state == RunState.RUNNING:
            self._asked = self._instrument.drive
            self._instrument.guard.retract()
            life.go(
                Cause.SILENT,
                f"no valid drive from {self._controller} for {run.watchdog_timeout:g} s (run.watchdog_timeout; "
                f"{counts.drives_refused} refused as NaN or infinite{self._unused()}): the sample is retracted"
                f"{(cause := context.link.cause()) and f' ({cause})'}",
            )
        elif not silent and life.state == RunState.RETRACTED:
            self._release()
            life.go(Cause.ANSWERED)

    def _release(self) -> None:
        """Give the drive back to the controller."""
        self._instrument.guard.release()
        self._go_back()

    def _go_back(self) -> None:
        """Let the drive go back to that of a controller that was silent, not leap: a sample that leaps loses the tip,
        and x and y are where no law expects them.
        """
        run = self._parameters.run
        self._way_back = self._ticks(_LONGEST_WAY * run.retract_distance / run.return_speed)

    def _ticks(self, time: float) -> int:
        return ticks_of(time, self._parameters.plant.control_period)

    def _returning(self) -> _Array:
        """The drive of the controller, as far as `run.return_speed` allows."""
        parameters, now = self._parameters, self._instrument.drive
        way = parameters.run.return_speed * parameters.plant.control_period
        most = way / np.array(parameters.piezo.sensitivities)
        change = (self._asked.voltage if isinstance(self._asked, Command) else self._asked) - now
        self._way_back = 0 if (np.abs(change) <= most).all() else self._way_back - 1
        return np.asarray(now + np.clip(change, -most, most))

    def _unused(self) -> str:
        """Drives that came and were not put in force, for a sentence."""
        counts = self._context.counts
        kinds = (
            (counts.drives_outdated, "for an older measurement"),
            (counts.drives_ahead, "for a future one"),
            (counts.drives_malformed, "that cannot be read"),
        )
        return "".join(f", {count} {kind}" for count, kind in kinds if count)

    def explain(self, error: DivergenceError | PartError) -> str:
        """Add to a divergence how old the drives were; late ones are the likely cause, and come first."""
        if not isinstance(error, DivergenceError):
            return str(error)
        context = self._context
        context.blocks.flush()
        oldest = context.blocks.oldest_command / self._period
        if context.blocks.oldest_command <= self._in_time:
            return f"{error}; the drives came in time, they were up to {oldest:.3g} control periods old"
        return (
            f"the drives came too late, they were up to {oldest:.3g} control periods old, the last late one "
            f"{self._instrument.ticks - self._late_tick} periods before (lower run.real_time_factor = "
            f"{self._parameters.run.real_time_factor:g}, or run our controller in the simulator's process: session "
            f"--composed): {error}"
        )
