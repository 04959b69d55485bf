"""Lockstep: simulated time goes on with each answer."""

import math

from ..core.errors import DivergenceError, DriveError, MalformedError, PartError
from .course import Course, Pacing
from .state import Cause

_RESEND_PERIOD = 1.0
"""Wall time after which an unanswered measurement is sent again [s]: a restarted controller has not seen it."""
_NAMED = 4
"""Wrong sequences that are named in a sentence at most."""


class Lockstep(Pacing):
    """Publish measurement k, wait for the drive that answers k, tick. No delay in simulated time, at any speed."""

    def __init__(self, course: Course) -> None:
        self._course = course
        self._instrument = course.instrument
        # Bound once: at this rate every look-up is felt.
        self._take, self._publish = course.link.take, course.link.publish
        self._tick, self._clock = course.ticker.tick, course.clock
        self._sent_at = self._asked_at = 0.0
        self._stalled = False
        self._wrong: list[int] = []
        self._wrong_at = 0  # tick at which they came
        self._unread_at = -1  # tick at which something came last that cannot be read; -1: nothing has

    def start(self) -> None:
        """Ask for the first drive."""
        # What is still there answers the run before.
        while self._course.take() is not None:
            pass
        self._wrong.clear()
        self._unread_at = -1
        self.resume()
        self._publish(self._instrument.ticks, self._instrument.measurement)

    def resume(self) -> None:
        """Go on after a pause; an answer that came meanwhile has not been taken yet."""
        self._stalled = False
        # The first answer also takes as long as the nodes need to find each other, one after a pause the pause.
        self._course.ticker.doubt_next()
        self._sent_at = self._asked_at = self._clock()

    def adapt(self) -> None:
        """Nothing depends on what may change while running."""

    @property
    def deadline(self) -> float | None:
        """None: there is something to do when a drive arrives."""
        return None

    def step(self) -> bool:
        """Take one answer if there is one."""
        if self._instrument.unasked:
            return self._go_on()
        try:
            taken = self._take()
        except MalformedError as error:
            self._course.drop(error)
            self._unread_at = self._instrument.ticks
            self._look_at_the_clock()
            return True
        if taken is None:
            self._look_at_the_clock()
            return False
        sequence, drive = taken
        instrument = self._instrument
        if sequence != instrument.ticks:
            self._note_wrong(sequence)
            self._look_at_the_clock()
            return True
        if self._stalled:
            self._stalled = False
            self._course.go_on(Cause.ANSWERED)
        try:
            if isinstance(drive, DriveError):
                raise drive
            going_on = self._tick(drive, self._clock() - self._sent_at)
        except DriveError as error:
            self._course.refuse(str(error), sequence)
            self._course.fail(self._course.refusal)
            return True
        except (DivergenceError, PartError) as error:
            self._course.fail(str(error))
            return True
        self._conclude(going_on)
        return True

    def _go_on(self) -> bool:
        """A tick whose measurement got lost by a fault: the drive before goes on."""
        try:
            going_on = self._tick(None, math.nan)
        except (DivergenceError, PartError) as error:
            self._course.fail(str(error))
        else:
            self._conclude(going_on)
        return True

    def _conclude(self, going_on: bool) -> None:
        """Ask for the next drive, or end."""
        if not going_on:
            self._course.finish()
            return
        instrument = self._instrument
        self._sent_at = self._asked_at = self._clock()
        if not instrument.unasked:
            self._publish(instrument.ticks, instrument.measurement)

    def _note_wrong(self, sequence: int) -> None:
        """Count a drive that does not answer the measurement waiting."""
        ticks, counts = self._instrument.ticks, self._course.counts
        if sequence < ticks:
            # The second answer to a measurement that was sent twice, or of a controller that lags behind.
            counts.drives_outdated += 1
        else:
            counts.drives_ahead += 1
        if self._wrong_at != ticks:
            self._wrong_at = ticks
            self._wrong.clear()
        if sequence not in self._wrong:
            self._wrong = [*self._wrong, sequence][-_NAMED:]

    def _look_at_the_clock(self) -> None:
        course = self._course
        now = self._clock()
        if now - self._asked_at > _RESEND_PERIOD:
            # The very first one may have gone out before the controller's side had matched: nothing is lost then.
            if self._instrument.ticks > 0 and self._asked_at == self._sent_at:
                course.counts.drives_lost += 1
            self._asked_at = now
            course.ticker.doubt_next()  # nobody knows which of the two will have been answered
            self._publish(self._instrument.ticks, self._instrument.measurement)
            if self._stalled:
                course.life.tell(self._complaint())
        if not self._stalled and now - self._sent_at > course.parameters.run.lockstep_timeout:
            self._stalled = True
            course.life.go(Cause.UNANSWERED, self._complaint())

    def _complaint(self) -> str:
        """What the controller does in place of answering."""
        ticks, timeout = self._instrument.ticks, self._course.parameters.run.lockstep_timeout
        name, limit = self._course.controller, f"{timeout:g} s (run.lockstep_timeout)"
        if self._wrong and self._wrong_at == ticks:
            sequences = ", ".join(map(str, self._wrong))
            return f"{name} sends drives with sequence {sequences}; measurement {ticks} has been waiting for {limit}"
        if self._unread_at == ticks:
            return f"no drive but {self._course.unreadable}; measurement {ticks} has been waiting for {limit}"
        return f"{name} has not answered measurement {ticks} within {limit}; still waiting"
