"""What the engine of a run and its pacing both work on."""

from collections.abc import Callable
from dataclasses import dataclass, field

from ..instrument import Instrument
from .blocks import Blocks
from .counts import Counts
from .link import Link
from .state import BACK, EVENTS, REASONS, Cause, Life, RunState


@dataclass(slots=True)
class RunContext:
    """Hold the instrument of a run, the link to its controller, and the account of what has happened."""

    instrument: Instrument  # ticked by the engine alone; another one after `Run.exchange`
    link: Link
    clock: Callable[[], float]  # steady wall time [s]
    blocks: Blocks
    life: Life
    counts: Counts = field(default_factory=Counts)
    refusal: str = ""  # the sentence about the drive refused last
    unreadable: str = ""  # a clause about the drive that could not be read last
    look_at: int = 0  # the next tick behind which there is something to look at, whatever comes of those before

    @property
    def phase(self) -> RunState:
        """State that says which of controller and limits has the drive."""
        return RunState(self.instrument.guard.phase)

    @property
    def reason(self) -> str:
        """Why the controller's drive is not in force, in two words; empty if it is."""
        return REASONS.get(EVENTS.get(self.instrument.guard.limit, self.life.state), "")

    def go_on(self, cause: Cause) -> None:
        """Let simulated time go on that stood still: as what the run was before."""
        if self.phase in BACK:
            back, what = BACK[self.phase]
            self.life.go(back, f"{what} (after: {self.reason})")
        else:
            self.life.go(cause)

    def refuse(self, problem: str, sequence: int, answering: str) -> None:
        """Count a drive that was refused, with a sentence about it and who has sent it."""
        self.counts.drives_refused += 1
        self.refusal = f"{problem} (answer to measurement {sequence} from {answering})"
