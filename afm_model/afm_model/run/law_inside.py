"""The law inside the simulator: many ticks in one compiled piece, as fast as it goes or by the clock."""

import math

from ..instrument.controller import Controller
from ..parameters import ControllerParameters, SimParameters
from .context import RunContext
from .pacing import Compiled

_PIECE = 5e-3
"""Wall time of a piece [s]: what else a node has to do waits for so long at most."""


class LawInside(Compiled):
    """Ticks the instrument with a law in the same process, without a link.

    The trajectory is that of the same law over topics in lockstep, to the last bit, in real time as well: no drive is
    ever late. In real time a piece is made when the clock has come to its first tick; periods that were missed stay
    left out, as they do with a controller on topics.

    Parameters
    ----------
    context : RunContext
    parameters : SimParameters
    controller : ControllerParameters, optional
        With the law; without, that inside the simulator's parameters.
    """

    def __init__(
        self, context: RunContext, parameters: SimParameters, controller: ControllerParameters | None = None
    ) -> None:
        law = controller or parameters.controller_inside
        assert law is not None
        super().__init__(context, Controller(law), by_clock=parameters.run.mode == "realtime")
        self._parameters, self._given = parameters, controller
        self._ticks = 1  # of a piece
        self._begun, self._first = 0.0, 0  # of the piece that is being made: wall time and tick
        self._period = 0.0

    def resume(self) -> None:
        """Begin a new series of deadlines."""
        self._period = 0.0
        self.adapt(self._parameters)

    def adapt(self, parameters: SimParameters) -> None:
        """Follow a change of the law's parameters, or of the factor of real time."""
        self._parameters = parameters
        law = self._given or parameters.controller_inside
        assert law is not None
        if law != self.law.parameters:
            self.law.parameters = law
        period = parameters.plant.control_period / parameters.run.real_time_factor
        if self.by_clock and period != self._period:
            self._period = period
            self._ticks = max(1, round(_PIECE / period))
            self.deadline = self._context.clock() + period

    def next(self) -> int | None:
        """A piece; in real time if its deadline has come."""
        context, now = self._context, self._context.clock()
        if self.deadline is not None:
            if now < self.deadline:
                return None
            late = now - self.deadline
            context.blocks.note_delay(late, math.nan)
            # A piece that begins within one is no late one: the ticks in it are made ahead of their time anyhow.
            if late >= self._ticks * self._period:
                missed = int(late / self._period)
                context.counts.late_ticks += 1
                context.counts.periods_missed += missed
                self.deadline += missed * self._period
        self._begun, self._first = now, self._instrument.ticks
        return self._ticks

    def made(self) -> None:
        """When the next piece is due; as fast as it goes, from the time it took, how long it is."""
        made = self._instrument.ticks - self._first
        if self.deadline is not None:
            self.deadline += made * self._period
            return
        took = self._context.clock() - self._begun
        if took < 0.5 * _PIECE and made == self._ticks:
            self._ticks *= 2
        elif took > _PIECE:
            self._ticks = max(1, self._ticks // 2)
