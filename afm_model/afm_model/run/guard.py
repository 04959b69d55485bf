"""The instrument's own limits: where one is passed it takes the drive itself, and gives it back."""

import math

import numpy as np
from numpy.typing import NDArray

from ..core.errors import DriveError
from ..instrument import Instrument
from ..instrument.validity import valid_forces
from ..parameters import SimParameters
from ..parts.command import Command, problem
from .course import Course
from .state import Cause, State

_Array = NDArray[np.float64]


def _ticks(time: float, period: float) -> int:
    """Control ticks that a time [s] takes; one at least."""
    return max(1, math.ceil(time / period - 1e-6))


class Guard:
    """Withdraws the sample and brings it back, tick by tick.

    It looks at what the plant really does, not at what sensors with noise and faults tell of it. One look in a control
    tick: a force that comes and goes between two ticks is not seen.

    Parameters
    ----------
    course : Course
        Its `phase` says who has the drive; it changes here alone.
    """

    def __init__(self, course: Course) -> None:
        self._course = course
        self._instrument: Instrument = course.instrument
        self._tick = course.ticker.tick
        parameters: SimParameters = course.parameters
        period, piezo = parameters.plant.control_period, parameters.piezo
        self._safety = safety = parameters.safety
        self._forces = valid_forces(parameters) if safety.validity else (-math.inf, math.inf)
        self._approach_force = safety.approach_force or safety.force_limit or math.inf
        self._contact_ticks = _ticks(safety.contact_timeout, period) if safety.contact_timeout else 0
        self._resume_ticks = _ticks(safety.resume_after, period) if safety.resume_after else 0
        self._settle_ticks = _ticks(safety.settle_time, period)
        self._approach_ticks = _ticks(safety.approach_timeout, period)
        self._rise = safety.approach_speed * period / abs(piezo.sensitivity_z)  # [V] in a tick
        self._distance = parameters.run.retract_distance / abs(piezo.sensitivity_z)  # [V]
        self._ramp_ticks = _ticks(parameters.run.retract_time, period)
        self._sign = math.copysign(1.0, piezo.sensitivity_z)
        self._scored_from = parameters.score_tick
        self._rest = self._instrument.drive
        self.reset()

    def reset(self) -> None:
        """Give the drive to the controller, as at the start."""
        self._course.phase, self._course.limit = State.RUNNING, None
        self._drive = self._rest.copy()
        self._target = self._rest.copy()
        self._moves = np.zeros(3)  # [V] in a tick
        self._since = 0  # tick at which this phase began
        self._lost = 0  # ticks out of contact in a row
        self._touching = 0  # ticks in contact in a row, of an approach
        self._instrument.inside.give_z()

    def tick(self, drive: _Array | Command | None, round_trip: float, sequence: int | None = None) -> bool:
        """Make a tick with this drive, or with one of its own; see `Ticker.tick`.

        Raises
        ------
        DriveError
            Also for a drive that is not put in force: what is refused does not depend on who has the drive.
        """
        course = self._course
        if course.phase != State.RUNNING:
            if drive is not None and (reason := problem(drive)):
                raise DriveError(reason)
            drive = self._own_drive()
            course.counts.ticks_withdrawn += 1
            course.counts.scored_ticks_withdrawn += self._instrument.ticks >= self._scored_from
        going_on = self._tick(drive, round_trip, sequence)
        if going_on:
            self._look()
        return going_on

    def resume(self) -> str:
        """Bring the sample back to the tip; why not, or an empty string: not while a limit is still passed."""
        course = self._course
        if passed := self._passed():
            return passed[1]
        if self._instrument.orders.taken:
            return self._give_back()
        course.phase = State.APPROACHING
        self._since, self._touching = self._instrument.ticks, 0
        course.life.go(Cause.RESUME, f"the sample is brought back to the tip (after: {course.reason})")
        return ""

    def _give_back(self) -> str:
        """An approach is a verb where verbs are ordered: the tip stays withdrawn, z is the loop's again."""
        course = self._course
        self._instrument.inside.give_z()
        course.life.go(Cause.RESUME, f"the tip is withdrawn (after: {course.reason})")
        course.phase, course.limit = State.RUNNING, None
        course.life.go(Cause.APPROACHED)
        return ""

    def _look(self) -> None:
        """What comes of the tick just made."""
        course = self._course
        if course.phase == State.WITHDRAWN:
            if self._resume_ticks and self._instrument.ticks - self._since >= self._resume_ticks:
                self.resume()
            return
        if passed := self._passed():
            self._withdraw(*passed)
        elif course.phase == State.APPROACHING:
            self._approach()

    def _passed(self) -> tuple[Cause, str] | None:
        """The limit that is passed, and a clause about it."""
        instrument, safety = self._instrument, self._safety
        if safety.travel_limit:
            x, y = instrument.inside.scanner_position
            if not (abs(x) <= safety.travel_limit and abs(y) <= safety.travel_limit):
                limit = f"safety.travel_limit = {safety.travel_limit:g} m"
                return Cause.TRAVEL, f"the scanner is at x = {x:.4g} m, y = {y:.4g} m ({limit})"
        force = instrument.inside.normal_force
        # An approach has a limit of its own: a tip that snaps in, or still rings, touches with more than it scans with.
        approaching = self._course.phase == State.APPROACHING
        if safety.force_limit and not approaching and not force <= safety.force_limit:
            return Cause.FORCE, f"the normal force is {force:.4g} N (safety.force_limit = {safety.force_limit:g} N)"
        low, high = self._forces
        if not low <= force <= high:
            return Cause.INVALID, (
                f"the normal force is {force:.4g} N: the plant holds from {low:.4g} to {high:.4g} N (safety.validity)"
            )
        # A sample that comes or was taken away is out of contact on purpose.
        watched = self._course.phase == State.RUNNING and self._course.life.state == State.RUNNING
        if self._contact_ticks and watched:
            self._lost = 0 if instrument.inside.in_contact else self._lost + 1
            if self._lost >= self._contact_ticks:
                return Cause.CONTACT_LOST, (
                    f"the tip has been out of contact for {safety.contact_timeout:g} s (safety.contact_timeout)"
                )
        return None

    def _withdraw(self, cause: Cause, clause: str) -> None:
        """Take the drive: away from the tip, and after too long a way back to the middle."""
        course, instrument = self._course, self._instrument
        if cause != Cause.NOT_APPROACHED:
            course.limit = cause
        course.counts.withdrawals += 1
        self._since, self._lost, self._touching = instrument.ticks, 0, 0
        self._drive = instrument.drive
        self._drive[2] = instrument.inside.z_drive
        self._target = self._drive.copy()
        if cause == Cause.TRAVEL:
            self._target[:2] = self._rest[:2]
        self._target[2] = self._sign * (min(self._sign * self._drive[2], 0.0) - self._distance)
        self._moves = np.abs(self._target - self._drive) / self._ramp_ticks
        course.phase = State.WITHDRAWN
        course.life.go(cause, f"{clause}: the sample is withdrawn")

    def _own_drive(self) -> _Array:
        """The instrument's own drive for the next tick [V]."""
        if self._course.phase == State.WITHDRAWN:
            left = self._target - self._drive
            self._drive = self._drive + np.clip(left, -self._moves, self._moves)
        elif not self._touching:
            self._drive[2] += self._sign * self._rise
        # A loop inside the instrument has z from the first touch on.
        if not self._touching:
            self._instrument.inside.take_z(float(self._drive[2]))
        return self._drive

    def _approach(self) -> None:
        """Go on with an approach, or end it."""
        instrument, course, safety = self._instrument, self._course, self._safety
        force = instrument.inside.normal_force
        if not force <= self._approach_force:
            self._withdraw(
                Cause.NOT_APPROACHED,
                f"the normal force is {force:.4g} N in the approach (safety.approach_force: "
                f"{self._approach_force:g} N)",
            )
            return
        if instrument.inside.in_contact:
            if not self._touching:
                instrument.inside.give_z()
            self._touching += 1
        else:
            self._touching = 0
        if self._touching >= self._settle_ticks:
            course.phase, course.limit = State.RUNNING, None
            self._lost = 0
            course.life.go(Cause.APPROACHED)
        elif instrument.ticks - self._since >= self._approach_ticks:
            self._withdraw(
                Cause.NOT_APPROACHED,
                f"no contact within {safety.approach_timeout:g} s (safety.approach_timeout)",
            )
