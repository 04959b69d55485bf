"""How simulated time advances: the number of ticks that are due, and their drive."""

import math
from typing import Any

from ..core.errors import DivergenceError, DriveError, MalformedError, PartError
from ..instrument.controller import Controller
from ..parameters import SimParameters
from .context import RunContext
from .link import Answer

_NO_ANSWER = "drive None is not allowed: every measurement must be answered, with three voltages or a Command"


class Pacing:
    """A way in which simulated time advances. Only the engine calls its methods.

    Parameters
    ----------
    context : RunContext
    """

    law: Controller | None
    """Closes the loop, many ticks in one compiled piece; None: one tick is made with `drive`."""
    drive: Answer | None
    """[V]; None: the previous one is held. As of `Instrument.tick`."""
    sequence: int | None
    """Measurement that it answers; None: that of this tick."""
    round_trip: float
    """Wall time from the measurement to the drive [s]."""
    deadline: float | None
    """When there will be something to do [s]; None: when a drive arrives, or always."""
    by_clock = False
    """Whether simulated time advances between two verbs."""
    scored_ticks_held = 0
    """Scored ticks that were made with a held drive, because no new one had come."""

    def __init__(self, context: RunContext) -> None:
        self._context, self._instrument = context, context.instrument
        # Here, as Python finds what the class has too only after a search.
        self.law = self.drive = self.sequence = self.deadline = None
        self.round_trip = math.nan

    def start(self) -> None:
        """Begin with tick 0."""
        self.resume()

    def resume(self) -> None:
        """Go on after a pause."""

    def adapt(self, parameters: SimParameters) -> None:
        """Follow a change of the parameters."""

    def next(self) -> int | None:
        """Return how many ticks are to be made now. 0: something else was done, such as ticks with nothing to look at
        after them; -1: one was made, and there is; None: there was nothing to do. Never waits.
        """
        raise NotImplementedError

    def made(self) -> None:
        """Called after these ticks, if the run continues."""

    @property
    def answering(self) -> str:
        """Who answers measurements, for a sentence."""
        if self.law is not None:
            return f"law {self.law.parameters.law.kind}"
        return self._context.link.controller or "an unknown node"

    def explain(self, error: DivergenceError | PartError) -> str:
        """Why the run ends, in one sentence."""
        return str(error)


class Compiled(Pacing):
    """As fast as it goes, with a law in the same compiled loop: to the end of a block each time."""

    def __init__(self, context: RunContext, law: Controller, *, by_clock: bool = False) -> None:
        super().__init__(context)
        self.law: Controller = law
        self.by_clock = by_clock

    def start(self) -> None:
        """With a law that has seen nothing."""
        self.law.reset()
        self.resume()

    def next(self) -> int | None:
        """Always more than a block holds."""
        return 2**62


class Asked(Pacing):
    """As fast as it goes, with a law that is an object with `answer`."""

    def __init__(self, context: RunContext, law: Any) -> None:
        super().__init__(context)
        self._law = law

    @property
    def answering(self) -> str:
        """The law, by its class."""
        return type(self._law).__name__

    def start(self) -> None:
        """Reset the law, if it can be."""
        if hasattr(self._law, "reset"):
            self._law.reset()

    def next(self) -> int | None:
        """One, with its answer."""
        instrument = self._instrument
        self.drive = None
        if not instrument.unasked:
            # A copy: behind the instrument's own array stands all of it, truth and score included.
            answer = self._law.answer(instrument.measurement.copy())
            # Over topics a run in lockstep waits for an answer: no drive is held that nobody has asked for.
            self.drive = DriveError(_NO_ANSWER) if answer is None else answer
        return 1


class Peered(Pacing):
    """With a controller at the other end of a link."""

    def __init__(self, context: RunContext, parameters: SimParameters) -> None:
        super().__init__(context)
        self._parameters = parameters

    def start(self) -> None:
        """Nothing of the run before counts."""
        while self._take_readable() is not None:
            pass

    def _take_readable(self) -> tuple[int, Answer] | None:
        """The oldest drive not yet taken, as `Link.take`; what cannot be read is dropped on the way."""
        while True:
            try:
                return self._context.link.take()
            except MalformedError as error:
                self._drop(error)

    def _drop(self, error: MalformedError) -> None:
        """Count a drive that could not be read, with a clause about it."""
        context = self._context
        context.counts.drives_malformed += 1
        context.unreadable = f"{error} from {context.link.controller or 'an unknown node'}"

    @property
    def _controller(self) -> str:
        """Name of the controller for a sentence."""
        return self._context.link.controller or "the controller"
