"""The verb Withdraw."""

from collections.abc import Iterator

from pydantic import Field

from ...program.orders import Order
from ..execution import Execution, Task, withdrawing
from ..verb import Length, Speed, Verb


class Withdraw(Verb):
    """Switch the feedback off and move z away from the sample."""

    distance: Length = Field(500e-9, description="way of z")
    rate: Speed = Field(10e-6, description="velocity of z")

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        view = run.view
        left = view.offset - view.reach[0]
        steps, run.total = withdrawing(view, self.distance, self.rate)
        run.state.approached = False
        if left < self.distance:
            run.remark = (
                f"z went {left:.4g} m, not distance = {self.distance:g} m: its range ends there, and the tip may still "
                f"touch the sample"
            )
        yield Task(Order(view.stay(), steps), run.total, "withdrawing")
        run.state.near = False
        run.state.feedback = "off"
