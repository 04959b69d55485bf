"""Does what the microscope is asked for, verb by verb. It never waits and ticks nothing.

Who runs the instrument calls `look` between two ticks, at the latest when `Instrument.close_loop` has stopped because
an order is done, and hands over every recorded block with `take`. A verb is begun with `begin`, it is over when `busy`
is False, and `outcome` is complete when the blocks up to then have been taken.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Literal

from ..core.errors import ParameterError, VerbError
from ..instrument import Block, Instrument
from ..program.orders import Order, Step
from .bench import Bench
from .calibrating import CalibratingLateral, CalibratingSensitivity, Tuning
from .collect import Collector
from .imaging import Scanning
from .jobs import Approaching, Desk, Job, Moving, Task, Withdrawing, standing, withdrawing
from .refusal import objection
from .results import CANCELLED, COMPLETE, FAILED, Line, Outcome, Progress
from .spectroscopy import Curving
from .tracing import Following, Looping
from .verbs import (
    Approach,
    CalibrateLateral,
    CalibrateSensitivity,
    ForceCurve,
    FrictionLoop,
    MoveTo,
    Scan,
    ScanPath,
    ThermalTune,
    Verb,
    Withdraw,
)

JOBS: dict[type[Verb], type[Job]] = {
    Approach: Approaching,
    Withdraw: Withdrawing,
    MoveTo: Moving,
    ForceCurve: Curving,
    FrictionLoop: Looping,
    Scan: Scanning,
    ScanPath: Following,
    ThermalTune: Tuning,
    CalibrateSensitivity: CalibratingSensitivity,
    CalibrateLateral: CalibratingLateral,
}


def ignore(line: Line) -> None:
    """Nobody listens."""


class Operator:
    """Orders of an instrument what verbs come to, and collects what is measured.

    Parameters
    ----------
    instrument : Instrument
        With `reference.kind` verbs and the channels of `with_verbs`; at its start.

    Raises
    ------
    ParameterError
        If it takes no orders.
    """

    def __init__(self, instrument: Instrument) -> None:
        if not instrument.orders.taken:
            raise ParameterError(
                f"reference.kind = {instrument.parameters.reference.kind} is not allowed with verbs: it must be verbs"
            )
        self.instrument = instrument
        self._bench = Bench(instrument)
        self.on_line: Callable[[Line], None] = ignore
        """Told every line of a scan as soon as it is measured."""
        self._desk = Desk(feedback=self._bench.parameters.onboard.feedback)
        self._job: Job | None = None
        self._tasks: Iterator[Task] = iter(())
        self._task: Task | None = None
        self._collectors: list[Collector] = []
        self._status, self._message = COMPLETE, ""
        self._begun = instrument.ticks

    @property
    def state(self) -> Desk:
        """Where the microscope stands; a copy."""
        loop = self._bench.parameters.onboard
        return replace(
            self._desk,
            setpoint=self._bench.setpoint,
            proportional_gain=loop.proportional_gain,
            integral_gain=loop.integral_gain,
            place=self._bench.place,
        )

    def objection(self, verb: Verb) -> str:
        """Why a verb cannot be begun now, one sentence; empty if it can."""
        return objection(verb, self._bench, self._desk)

    @property
    def busy(self) -> bool:
        """Whether a verb is being done."""
        return bool(self._desk.doing)

    def begin(self, verb: Verb) -> None:
        """Begin a verb, between two ticks.

        Raises
        ------
        VerbError
            If it cannot be: the sentence of `objection`.
        """
        if told := self.objection(verb):
            raise VerbError(told)
        self._job = JOBS[type(verb)](verb, self._bench, self._desk)
        self._job.on_line = self._tell
        self._desk.doing = type(verb).__name__
        self._collectors.clear()
        self._status, self._message = COMPLETE, ""
        self._begun = self.instrument.ticks
        if isinstance(verb, Approach):
            self._desk.near = True
            self.set_feedback("on")
        self._tasks = self._job.tasks()
        self._next()

    def _tell(self, line: Line) -> None:
        self.on_line(line)

    def look(self) -> None:
        """Go on with the next order if the one in force is done; cheap otherwise."""
        if self._desk.doing and self.instrument.orders.done:
            self._next()

    def _next(self) -> None:
        try:
            task = next(self._tasks, None)
        except VerbError as error:
            self._close_collectors()
            self._status, self._message = FAILED, str(error)
            self._leave()
            return
        if task is None or not task.goes_on:
            self._close_collectors()
        self._task = task
        if task is None:
            self._end()
        else:
            self._put_in_force(task)

    def _put_in_force(self, task: Task) -> None:
        if task.collect is not None:
            self._collectors.append(task.collect(self.instrument.ticks * self.instrument.samples_per_tick))
        self.instrument.order(task.order)

    def _close_collectors(self) -> None:
        for each in self._collectors:
            if each.end is None:
                each.end = self.instrument.ticks * self.instrument.samples_per_tick

    def _leave(self) -> None:
        """Bring the scanner to rest, and the tip off the sample; then the verb is over."""
        assert self._job is not None
        bench = self._bench
        self._desk.approached = False
        steps, duration = self._away(self._job.surface) if self._desk.near else ((), 0.0)

        def tasks() -> Iterator[Task]:
            yield Task(Order(bench.brake(), steps), duration, "withdrawing")
            self._desk.near = False

        self._tasks = tasks()
        self._task = next(self._tasks)
        self._put_in_force(self._task)

    def _away(self, surface: float) -> tuple[tuple[Step, ...], float]:
        """Steps off the sample, and how long they take [s]: further by what the cantilever is pressed."""
        bench, usual = self._bench, Withdraw()
        pressed = max(standing(bench).deflection, 0.0) * bench.parameters.detector.deflection_sensitivity
        return withdrawing(bench, usual.distance + pressed, usual.rate, surface)

    def _end(self) -> None:
        assert self._job is not None
        self._job.leave()
        self._desk.doing = ""

    def take(self, block: Block) -> None:
        """Collect from a recorded block; every block in order, without a gap."""
        for each in self._collectors:
            each.take(block)

    @property
    def progress(self) -> Progress:
        """How far the verb is, by the time that it takes at most."""
        if self._job is None or self._task is None:
            return Progress(0.0 if self.busy else 1.0, "")
        passed = (self.instrument.ticks - self._begun) * self._bench.control_period
        fraction = min(passed / self._job.total, 1.0) if self.busy and self._job.total > 0.0 else 1.0
        told = self._task.detail if self._status != COMPLETE else self._job.detail or self._task.detail
        return Progress(fraction, told)

    def cancel(self, reason: str = "cancelled") -> None:
        """Stop what is being done, at once: the scanner comes to rest, the tip is withdrawn, then the verb is over.

        Parameters
        ----------
        reason : str
            For the message of the outcome.
        """
        if not self._desk.doing or self._status != COMPLETE:
            return
        self._status, self._message = CANCELLED, f"{self._desk.doing} was {reason}; the tip is withdrawn"
        self._close_collectors()
        self._leave()

    def give_up(self, reason: str) -> None:
        """End what is being done here and now, because simulated time does not go on.

        Parameters
        ----------
        reason : str
            One sentence, for the message of the outcome.
        """
        if self._desk.doing:
            self._close_collectors()
            self._status, self._message = FAILED, reason
            self._end()

    def outcome(self) -> Outcome:
        """How the last verb has ended, with what was measured; when not busy, and every block has been taken."""
        assert self._job is not None and not self.busy
        try:
            message = self._message or self._job.remark
            return Outcome(self._status, message, self._job.result())
        except VerbError as error:
            failed = FAILED if self._status == COMPLETE else self._status
            return Outcome(failed, self._message or str(error), None)

    # What may be changed at any time, between two ticks.

    def set_setpoint(self, *, force: float = 0.0, voltage: float = 0.0) -> None:
        """Setpoint of the deflection, as force of the cantilever [N] or as voltage [V].

        Raises
        ------
        ParameterError
            If none is given, or both, the plant tells no spring constant for a force, or the detector does not reach
            so far.
        """
        if (force == 0.0) == (voltage == 0.0):
            raise ParameterError(
                f"force = {force:g} N with voltage = {voltage:g} V is not allowed: one of them must be given, not 0"
            )
        bench = self._bench
        volts = voltage or bench.volts(force)
        if volts > bench.most_deflection:
            raise ParameterError(
                f"a setpoint of {volts:.4g} V is not allowed: the detector saturates at {bench.most_deflection:.4g} V, "
                f"and z would go on into the sample"
            )
        bench.set_loop(setpoint_force=force, setpoint_voltage=voltage)

    def set_gains(self, proportional: float | None = None, integral: float | None = None) -> None:
        """Gains P [m/V] and I [m/(V s)] of the z loop; None: as it is.

        Raises
        ------
        ParameterError
            If one is negative.
        """
        given = {"proportional_gain": proportional, "integral_gain": integral}
        self._bench.set_loop(**{name: value for name, value in given.items() if value is not None})

    def set_feedback(self, mode: Literal["on", "hold", "off", "external"]) -> None:
        """What the z loop does with an approached tip.

        on: it follows the setpoint. hold: z stays where it is. off: the same, and verbs that need the loop are refused.
        external: z is driven by the controller. A withdrawn tip stays withdrawn whatever it is.

        Raises
        ------
        ParameterError
            If it is none of these.
        """
        self._bench.set_loop(feedback=mode)
        self._desk.feedback = mode
