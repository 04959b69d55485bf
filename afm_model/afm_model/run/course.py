"""What a run consists of, as its pacing gets it."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.errors import DriveError, MalformedError
from ..instrument import Instrument
from ..parameters import SimParameters
from ..parts.command import Command
from .counts import Counts
from .link import Link
from .state import BACK, EVENTS, PHASES, REASONS, Cause, Life, State
from .ticker import Ticker


@dataclass
class Course:
    """The parts of one run."""

    parameters: SimParameters
    instrument: Instrument
    ticker: Ticker
    link: Link
    clock: Callable[[], float]
    life: Life
    counts: Counts
    finish: Callable[[], None]
    """finish(): the duration is over."""
    fail: Callable[[str], None]
    """fail(sentence): the run ends in a fault."""
    refusal: str = ""
    """The sentence about the drive refused last."""
    unreadable: str = ""
    """A clause about the drive that could not be read last."""
    stop_at: int | None = None
    """Tick at which the run pauses by itself; None: it does not."""
    idle: Callable[[], bool] = lambda: False
    """idle(): whether simulated time stands still until something is ordered."""

    @property
    def phase(self) -> State:
        """Who has the drive while simulated time goes on."""
        return PHASES[self.instrument.guard.phase]

    @property
    def reason(self) -> str:
        """Why the controller's drive is not in force, in two words; empty if it is."""
        return REASONS.get(EVENTS.get(self.instrument.guard.limit, self.life.state), "")

    def go_on(self, cause: Cause) -> None:
        """Let simulated time go on that stood still: as what the run was before."""
        if self.phase not in BACK:
            self.life.go(cause)
        else:
            back, what = BACK[self.phase]
            self.life.go(back, f"{what} (after: {self.reason})")

    def look_at_limits(self) -> None:
        """Follow the instrument, whose drive has changed hands."""
        guard = self.instrument.guard
        phase, cause = self.phase, EVENTS.get(guard.event)
        if cause is None or phase == self.life.state:
            return
        if phase == State.WITHDRAWN:
            self.life.go(cause, f"{guard.clause(guard.event)}: the sample is withdrawn")
        elif phase == State.APPROACHING:
            self.life.go(cause, f"the sample is brought back to the tip (after: {self.reason})")
        elif self.life.state == State.WITHDRAWN:
            self.life.go(cause, "the tip is withdrawn")
            self.life.go(Cause.APPROACHED)
        else:
            self.life.go(cause)

    @property
    def controller(self) -> str:
        """Name of the controller for a sentence."""
        return self.link.controller or "the controller"

    def refuse(self, problem: str, sequence: int) -> None:
        """Count a drive that was refused, with a sentence about it."""
        self.counts.drives_refused += 1
        self.refusal = f"{problem} (answer to measurement {sequence} from {self.link.controller or 'an unknown node'})"

    def drop(self, error: MalformedError) -> None:
        """Count a drive that could not be read, with a clause about it."""
        self.counts.drives_malformed += 1
        self.unreadable = f"{error} from {self.link.controller or 'an unknown node'}"

    def take(self) -> tuple[int, NDArray[np.float64] | Command | DriveError] | None:
        """The oldest drive not yet taken, as `Link.take`; what cannot be read is dropped on the way."""
        while True:
            try:
                return self.link.take()
            except MalformedError as error:
                self.drop(error)


class Pacing(ABC):
    """One of the ways in which simulated time goes on. The run alone calls its methods."""

    @abstractmethod
    def start(self) -> None:
        """Begin with tick 0."""

    @abstractmethod
    def resume(self) -> None:
        """Go on after a pause."""

    @abstractmethod
    def adapt(self) -> None:
        """Follow a change of the parameters."""

    @abstractmethod
    def step(self) -> bool:
        """Do one tick if it is time for it; False if there was nothing to do. Never waits."""

    @property
    @abstractmethod
    def deadline(self) -> float | None:
        """When there will be something to do [s]; None: when a drive arrives."""
