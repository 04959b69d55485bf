"""Lockstep: simulated time advances with each answer."""

import math
from collections.abc import Callable
from functools import partial

from ..core.errors import MalformedError
from ..instrument.wire import Wire
from ..parameters import SimParameters
from .context import RunContext
from .link import Answer
from .pacing import Peered
from .state import Cause

_RESEND_PERIOD = 1.0
"""Wall time after which an unanswered measurement is sent again [s]: a restarted controller has not seen it."""
_NAMED = 4
"""Wrong sequences that are named in a sentence at most."""


class Lockstep(Peered):
    """Publish measurement k, wait for the drive that answers k, tick. No delay in simulated time, at any speed."""

    def __init__(self, context: RunContext, parameters: SimParameters) -> None:
        super().__init__(context, parameters)
        # Looked up once: at this rate every look-up is felt.
        self._take, self._publish, self._clock = context.link.take, context.link.publish, context.clock
        self._sent_at = self._asked_at = 0.0
        self._stalled = self._lost = False  # no answer in time; no measurement was sent
        self._wrong: list[int] = []
        self._wrong_at = 0  # tick at which they came
        self._unread_at = -1  # tick at which something came last that cannot be read; -1: nothing has

    def start(self) -> None:
        """Ask for the first drive."""
        super().start()
        self._wrong.clear()
        self._unread_at = -1
        self.resume()
        self.made()

    def resume(self) -> None:
        """Go on after a pause; an answer that came meanwhile has not been taken yet."""
        self._stalled = False
        # The first answer also takes as long as the nodes need to find each other, one after a pause the pause.
        self._context.blocks.doubt_next()
        self._sent_at = self._asked_at = self._clock()

    def adapt(self, parameters: SimParameters) -> None:
        """Follow a change of the timeout."""
        self._parameters = parameters

    def next(self) -> int | None:
        """Take one answer if there is one."""
        if self._lost:
            # The measurement got lost by a fault: the previous drive is held.
            self.drive, self.round_trip = None, math.nan
            return 1
        return self._judge(self._take)

    def _judge(self, take: Callable[[], tuple[int, Answer] | None]) -> int | None:
        """What an answer, if there is one, is good for."""
        instrument = self._instrument
        try:
            taken = take()
        except MalformedError as error:
            self._drop(error)
            self._unread_at = instrument.ticks
            self._look_at_the_clock()
            return 0
        if taken is None:
            self._look_at_the_clock()
            return None
        sequence, drive = taken
        if sequence != instrument.ticks:
            self._note_wrong(sequence)
            self._look_at_the_clock()
            return 0
        if self._stalled:
            self._stalled = False
            self._context.go_on(Cause.ANSWERED)
        self.drive, self.round_trip = drive, self._clock() - self._sent_at
        return 1

    def made(self) -> None:
        """Ask for the next drive."""
        instrument, clock, publish = self._instrument, self._clock, self._publish
        self._sent_at = self._asked_at = clock()
        self._lost = instrument.unasked
        if not self._lost:
            publish(instrument.ticks, instrument.measurement)

    def _note_wrong(self, sequence: int) -> None:
        """Count a drive that does not answer the measurement waiting."""
        ticks, counts = self._instrument.ticks, self._context.counts
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
        context = self._context
        now = self._clock()
        if now - self._asked_at > _RESEND_PERIOD:
            # The very first one may have gone out before the controller's side had matched: nothing is lost then.
            if self._instrument.ticks > 0 and self._asked_at == self._sent_at:
                context.counts.drives_lost += 1
            self._asked_at = now
            context.blocks.doubt_next()  # either of the two may have been answered
            self._publish(self._instrument.ticks, self._instrument.measurement)
            if self._stalled:
                context.life.tell(self._complaint())
        if not self._stalled and now - self._sent_at > self._parameters.run.lockstep_timeout:
            self._stalled = True
            context.life.go(Cause.UNANSWERED, self._complaint())

    def _complaint(self) -> str:
        """What the controller does in place of answering."""
        ticks, timeout = self._instrument.ticks, self._parameters.run.lockstep_timeout
        name, limit = self._controller, f"{timeout:g} s (run.lockstep_timeout)"
        if self._wrong and self._wrong_at == ticks:
            sequences = ", ".join(map(str, self._wrong))
            return f"{name} sends drives with sequence {sequences}; measurement {ticks} has been waiting for {limit}"
        if self._unread_at == ticks:
            return f"no drive but {self._context.unreadable}; measurement {ticks} has been waiting for {limit}"
        cause = self._context.link.cause()
        return f"{name} has not answered measurement {ticks} within {limit}; still waiting{cause and f' ({cause})'}"


class Wired(Lockstep):
    """Lockstep over the messages of a link in place: from the drive that came to the measurement that goes out it is
    one compiled call. What that call does not read goes the ordinary way.
    """

    def __init__(self, context: RunContext, parameters: SimParameters, wire: Wire) -> None:
        super().__init__(context, parameters)
        self._wire = wire
        # As above. What is used more than once is called sooner through a local name.
        self._take_bytes, self._publish_bytes = wire.take, wire.publish
        self._came, self._length = wire.drive, len(wire.drive)
        self._goes, self._sequence = wire.measurement, wire.sequence

    def next(self) -> int | None:
        """Make one tick with an answer, if there is one, and ask for the next drive."""
        if self._lost or self._stalled:
            return super().next()
        context, instrument = self._context, self._instrument
        take, publish, clock = self._take_bytes, self._publish_bytes, self._clock
        taken = take()
        if taken is None:
            self._look_at_the_clock()
            return None
        data = taken[0]
        round_trips = context.blocks.round_trips
        round_trips.append(clock() - self._sent_at)
        stopped = None
        if len(data) == self._length:
            self._came[:] = data
            stopped = instrument.exchange(self._wire)
        if stopped is None:
            round_trips.pop()
            return self._judge(partial(context.link.read, data))
        ticks = instrument.ticks
        if stopped or ticks >= context.look_at:
            return -1
        if self._sequence[0] == ticks:
            self._sent_at = self._asked_at = clock()
            publish(self._goes.tobytes())
        else:
            self.made()
        return 0
