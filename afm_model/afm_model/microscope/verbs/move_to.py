"""The verb MoveTo."""

from collections.abc import Iterator

from pydantic import Field

from ..execution import Execution, Task
from ..results import MicroscopeState
from ..verb import Metre, Speed, Verb, outside
from ..view import InstrumentView


class MoveTo(Verb):
    """Move the scanner along x and y on a straight line; the feedback stays as it is."""

    x: Metre = Field(0.0, description="place to go to")
    y: Metre = Field(0.0, description="place to go to")
    speed: Speed = Field(10e-6, description="velocity along the line")

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        yield from outside(view, "", [(self.x, self.y)])

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        yield from run.going(self.x, self.y, self.speed)
