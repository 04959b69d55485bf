"""The law inside the simulator: many ticks in one compiled piece, as fast as it goes or by the clock."""

import math

from ..core.errors import DivergenceError, DriveError, PartError
from ..instrument.controller import Controller
from .course import Course, Pacing

_PIECE = 5e-3
"""Wall time of a piece [s]: what else a node has to do waits for so long at most."""


class LawInside(Pacing):
    """Ticks the instrument with a law beside it; nobody is asked and nobody answers.

    The trajectory is that of the same law over topics in lockstep, to the last bit, in real time as well: no drive is
    ever late. In real time a piece is made when the clock has come to its first tick; periods that were missed stay
    left out, as they do with a controller on topics.

    Parameters
    ----------
    course : Course
        Its parameters have a law inside.
    """

    def __init__(self, course: Course) -> None:
        self._course = course
        self._instrument = course.instrument
        parameters = course.parameters.controller_inside
        assert parameters is not None
        self._controller = Controller(parameters)
        self._realtime = course.parameters.run.mode == "realtime"
        self._ticks = 1  # of a piece
        self._deadline = self._period = 0.0

    def start(self) -> None:
        """Begin with a law that has seen nothing."""
        self._controller.reset()
        self.resume()

    def resume(self) -> None:
        """Begin a new series of deadlines."""
        self._period = 0.0
        self.adapt()

    def adapt(self) -> None:
        """Follow a change of the law's parameters, or of the factor of real time."""
        course = self._course
        parameters = course.parameters.controller_inside
        assert parameters is not None
        if parameters != self._controller.parameters:
            self._controller.parameters = parameters
        period = course.parameters.plant.control_period / course.parameters.run.real_time_factor
        if self._realtime and period != self._period:
            self._period = period
            self._ticks = max(1, round(_PIECE / period))
            self._deadline = course.clock() + period

    @property
    def deadline(self) -> float | None:
        """When the next piece is due [s]; in lockstep always now, which is told by `step`."""
        return self._deadline if self._realtime else None

    def step(self) -> bool:
        """Make a piece; in real time if its deadline has come."""
        if not self._realtime:
            return self._make_timed()
        course = self._course
        now = course.clock()
        if now < self._deadline:
            return False
        late = now - self._deadline
        course.ticker.note_delay(late, math.nan)
        # A piece that begins within one is no late one: the ticks in it are made ahead of their time anyhow.
        missed = int(late / self._period) if late >= self._ticks * self._period else 0
        if missed:
            course.counts.late_ticks += 1
            course.counts.periods_missed += missed
        self._deadline += missed * self._period
        before = self._instrument.ticks
        self._make(self._ticks)
        self._deadline += (self._instrument.ticks - before) * self._period
        return True

    def _make_timed(self) -> bool:
        """A piece, and from the time it takes the length of the next one."""
        clock, before = self._course.clock, self._instrument.ticks
        begin = clock()
        self._make(self._ticks)
        took, made = clock() - begin, self._instrument.ticks - before
        if took < 0.5 * _PIECE and made == self._ticks:
            self._ticks *= 2
        elif took > _PIECE:
            self._ticks = max(1, self._ticks // 2)
        return True

    def _make(self, ticks: int) -> None:
        """So many ticks; fewer at the end of a block, where the run stops by itself, and at its end."""
        course = self._course
        if course.stop_at is not None:
            ticks = min(ticks, course.stop_at - self._instrument.ticks)
        try:
            going_on = course.ticker.close_loop(self._controller, ticks)
        except DriveError as error:
            course.refuse(str(error), self._instrument.ticks)
            course.fail(course.refusal)
        except (DivergenceError, PartError) as error:
            course.fail(str(error))
        else:
            if not going_on:
                course.finish()
