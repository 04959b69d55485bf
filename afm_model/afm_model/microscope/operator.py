"""Does what the microscope is asked for, verb by verb. It never waits and ticks nothing.

Who runs the instrument calls `look` between two ticks, at the latest when `Instrument.close_loop` has stopped because
an order is done, and hands over every recorded block with `take`. A verb is begun with `begin`, it is over when `busy`
is False, and `outcome` is complete when the blocks up to then have been taken.
"""

import math
import warnings
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from ..core.elementary import square
from ..core.errors import ParameterError, VerbError
from ..instrument import Block, Instrument
from ..parts.channels import NORMAL_FORCE
from ..program.orders import Order, Step
from ..run.verdict import outside, saturated
from .backend import LoopSettings
from .collect import Collector, Reading, names_of_signals, newest
from .execution import Execution, Task, withdrawing
from .image import Line
from .normal_force import Load
from .results import CANCELLED, COMPLETE, FAILED, MicroscopeState, Outcome, Progress, Standing
from .verb import Verb, objection, saturating
from .verbs import Withdraw
from .view import CALIBRATIONS, ERROR_CHANNEL, InstrumentView

_LOOSE, _LEAST = 0.3, 0.1
"""A warning is given for an rms error of the z loop beyond this part of the setpoint, and this [V]."""
_FLYING = 0.5
"""The same of a tip that taps, over what the amplitude can rise by; that is the error of one that flies."""


def ignore(line: Line) -> None:
    """Nobody listens."""


class Operator(LoopSettings):
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
        self._view = InstrumentView(instrument)
        self.on_line: Callable[[Line], None] = ignore
        """Called with every line of a scan as soon as it is measured."""
        self._state = MicroscopeState(feedback=self._view.setting("feedback", "on"))
        self._execution: Execution | None = None
        self._of_verb: Generator[Task] | None = None
        self._tasks: Iterator[Task] = iter(())
        self._task: Task | None = None
        self._collectors: list[Collector] = []
        self._status, self._message = COMPLETE, ""
        self._begun = instrument.ticks
        names = [channel.name for channel in instrument.channels]
        self._error_row = names.index(ERROR_CHANNEL) if ERROR_CHANNEL in names else None
        self._load_row = names.index(NORMAL_FORCE.name)
        self._load = Load(self._view)
        self._saturated, self._outside, self._errors, self._error_samples = 0, 0.0, 0.0, 0
        self._measured_from = 0  # sample
        self._slides = self._on_sample = self._measures = self._lost = False

    @property
    def state(self) -> MicroscopeState:
        """Where the microscope stands; a copy."""
        self._notice_loss()
        view = self._view
        return replace(
            self._state,
            setpoint=view.setpoint,
            proportional_gain=view.setting("proportional_gain"),
            integral_gain=view.setting("integral_gain"),
            place=view.place,
        )

    def objection(self, verb: Verb) -> str:
        """Why a verb cannot be begun now, one sentence; empty if it can."""
        self._notice_loss()
        return objection(verb, self._view, self._state)

    def _notice_loss(self) -> None:
        """A tip off the sample that its loop will not bring back there is approached no more."""
        state, view = self._state, self._view
        low, high = view.z_range
        # At a setpoint that a free cantilever exceeds the loop moves the tip away.
        leaves = view.setpoint <= 0.0 or not low < view.z < high
        stays = state.feedback in ("hold", "off") or (state.feedback == "on" and leaves)
        if state.doing:
            return
        if state.approached and stays and not view.touching:
            state.approached = False
        # A tip that was moved off its sample, and brought back by its loop.
        elif not state.approached and not stays and state.feedback == "on" and view.follows and view.touching:
            state.approached = state.near = True

    @property
    def busy(self) -> bool:
        """Whether a verb is being done."""
        return bool(self._state.doing)

    def begin(self, verb: Verb) -> None:
        """Begin a verb, between two ticks.

        Raises
        ------
        VerbError
            If it cannot be: the sentence of `objection`.
        """
        if told := self.objection(verb):
            raise VerbError(told)
        self._execution = Execution(self._view, self._state, self._tell)
        self._state.doing, self._slides, self._on_sample = type(verb).__name__, verb.slides, verb.on_sample
        self._measures = verb.returns is not Standing
        self._collectors.clear()
        self._status, self._message = COMPLETE, ""
        self._begun = self.instrument.ticks
        self._saturated, self._outside = self.instrument.samples_saturated, self.instrument.time_outside
        self._errors, self._error_samples, self._load = 0.0, 0, Load(self._view)
        self._tasks = self._of_verb = verb.tasks(self._execution)  # type: ignore[assignment]  # a generator
        self._next()

    def _tell(self, line: Line) -> None:
        self.on_line(line)

    def look(self) -> None:
        """Go on with the next order if the one in force is done; cheap otherwise."""
        if self._state.doing and self.instrument.orders.done:
            self._next()

    def _next(self) -> None:
        try:
            task = next(self._tasks, None)
        except (Exception, SystemExit) as error:
            # Whatever somebody else's verb raises, the tip is withdrawn.
            self._close_collectors()
            told = str(error) if isinstance(error, VerbError | ParameterError) else f"{type(error).__name__}: {error}"
            self._status, self._message = FAILED, told
            self._leave()
            return
        self._close_collectors(task)
        self._task = task
        if task is None:
            self._end()
        else:
            self._put_in_force(task)

    def _put_in_force(self, task: Task) -> None:
        if task.collect is not None and task.collect not in self._collectors:
            if not self._collectors:
                # On the way here the loop may have gone to another setpoint.
                self._measured_from = self._view.next_sample
            self._collectors.append(task.collect)
            task.collect.start(self._view.next_sample)
        self.instrument.order(task.order)

    def _close_collectors(self, task: Task | None = None) -> None:
        """Stop collecting, but for what the next task goes on with."""
        for each in self._collectors:
            if task is None or each is not task.collect:
                each.stop(self._view.next_sample)

    def _leave(self) -> None:
        """Bring the scanner to rest, and the tip off the sample; then the verb is over."""
        assert self._execution is not None
        view = self._view
        self._state.approached = False
        steps, duration = self._away(self._execution) if self._state.near else ((), 0.0)

        def tasks() -> Iterator[Task]:
            yield Task(Order(view.brake(), steps), duration, "withdrawing")
            self._state.withdrawn()

        self._tasks = tasks()
        self._task = next(self._tasks)
        self._put_in_force(self._task)

    def _away(self, execution: Execution) -> tuple[tuple[Step, ...], float]:
        """Steps off the sample, and how long they take [s]: further by what the cantilever is pressed."""
        view, usual = self._view, Withdraw()
        pressed = max(execution.standing().deflection_voltage, 0.0) * view.deflection_sensitivity
        return withdrawing(view, usual.distance + pressed, usual.rate, execution.surface)

    def _end(self) -> None:
        assert self._of_verb is not None
        # What the verb has changed it puts back in its `finally`.
        self._of_verb.close()
        self._state.doing = ""
        approached = self._state.approached
        self._notice_loss()
        self._lost = approached and not self._state.approached

    def take(self, block: Block) -> None:
        """Collect from a recorded block; every block in order, without a gap."""
        for each in self._collectors:
            each.take(block)
        first = max(self._measured_from - block.first_sample, 0)
        if self._collectors and self._error_row is not None and first < block.samples.shape[1]:
            errors = block.samples[self._error_row, first:]
            self._errors += float(np.sum(square(errors)))
            self._error_samples += errors.size
            self._load.take(block.samples[self._load_row, first:])

    @property
    def progress(self) -> Progress:
        """How far the verb is, by the time that it takes at most."""
        if self._execution is None or self._task is None:
            return Progress(0.0 if self.busy else 1.0, "")
        passed = (self.instrument.ticks - self._begun) * self._view.control_period
        total, detail = self._execution.total, self._task.detail
        fraction = min(passed / total, 1.0) if self.busy and total > 0.0 else 1.0
        return Progress(fraction, detail if isinstance(detail, str) else detail())

    def cancel(self, reason: str = "cancelled", *, stay: bool = False) -> None:
        """Stop what is being done, at once: the scanner comes to rest, the tip is withdrawn, then the verb is over.

        Parameters
        ----------
        reason : str
            For the message of the outcome.
        stay : bool
            The tip is not withdrawn if it need not be, see `Backend.stop`.
        """
        if not self._state.doing or self._status != COMPLETE:
            return
        assert self._execution is not None
        follows, back = self._view.follows, self._execution.back
        stay &= follows or back is not None or not self._on_sample
        rests = "stays on the sample" if self._on_sample else "stays where it is"
        self._status = CANCELLED
        self._message = f"{self._state.doing} was {reason}; the tip {rests if stay else 'is withdrawn'}"
        self._close_collectors()
        if stay:
            self._rest(*(((), 0.0) if follows or back is None else back()))
        else:
            self._leave()

    def _rest(self, steps: tuple[Step, ...], duration: float) -> None:
        """Bring the scanner to rest, and the tip back by these steps; then the verb is over."""
        assert self._execution is not None
        execution, name = self._execution, self._state.doing

        def tasks() -> Iterator[Task]:
            yield Task(Order(self._view.brake(), steps), duration, "coming to rest")
            if not steps:
                return
            if not execution.triggered:
                raise VerbError(f"{name} was stopped, and its tip did not find the sample again; it is withdrawn")
            self._state.approached = True

        self._tasks = tasks()
        self._next()

    def withdrawn(self) -> None:
        """Note that the instrument has withdrawn the tip while no verb was being done."""
        self._state.withdrawn()

    def give_up(self, reason: str) -> None:
        """End what is being done here and now, because simulated time does not go on.

        Parameters
        ----------
        reason : str
            One sentence, for the message of the outcome.
        """
        if self._state.doing:
            self._close_collectors()
            self._status, self._message = FAILED, reason
            self._end()

    @property
    def measured(self) -> Any:
        """What the verb that was begun last has measured up to now; of a scan its image, which grows."""
        return self._execution.result() if self._execution is not None else None

    def outcome(self) -> Outcome:
        """How the last verb has ended, with what was measured; when not busy, and every block has been taken."""
        assert self._execution is not None and not self.busy
        try:
            result = self._execution.result()
            return Outcome(self._status, self._message or "; ".join(self._remarks()), result)
        except VerbError as error:
            failed = FAILED if self._status == COMPLETE else self._status
            return Outcome(failed, self._message or str(error), None)

    def _remarks(self) -> Iterator[str]:
        """What is to be known of a result that is whole, a sentence each."""
        assert self._execution is not None
        view = self._view
        if self._lost:
            yield (
                f"the tip is off the sample at the end, and its loop does not bring it back: setpoint "
                f"{view.setpoint:.4g} V, feedback {self._state.feedback}, z = {view.z:.4g} m, which may be "
                f"{view.z_range[0]:.4g} m to {view.z_range[1]:.4g} m; withdraw, and approach with a setpoint above 0 V"
            )
        if self._execution.remark:
            yield self._execution.remark
        if sentence := saturated(self.instrument.samples_saturated - self._saturated):
            yield sentence
        time = self.instrument.time_outside - self._outside
        if self._measures and (sentence := outside(time, view.parameters.plant.kind)):
            yield sentence
        error = math.sqrt(self._errors / max(self._error_samples, 1))
        follows = self._slides and self._state.feedback == "on"
        if follows and not view.taps:
            yield from self._load.remarks()
        if follows and view.taps:
            yield from self._flying(error)
        elif follows and error > _LOOSE * abs(view.setpoint) + _LEAST:
            yield (
                f"the z loop did not hold the setpoint of {view.setpoint:.4g} V: its error was {error:.3g} V rms; it "
                f"oscillates, or is too slow: change its gains, or scan slower"
            )

    def _flying(self, error: float) -> Iterator[str]:
        """What is to be said of a tip that does not tap as it should; error: rms of the z loop [V]."""
        view, metres = self._view, self._view.parameters.detector.deflection_sensitivity
        if error > _FLYING * (view.free_amplitude - view.setpoint):
            yield (
                f"the z loop did not hold the setpoint of {metres * view.setpoint:.4g} m, the free amplitude is "
                f"{metres * view.free_amplitude:.4g} m: its error was {error * metres:.3g} m rms; the tip flies over "
                f"the sample, or the loop oscillates: scan slower, take a lower setpoint, or change its gains"
            )

    def read_signals(self, *names: str) -> dict[str, Reading]:
        """See `Backend`."""
        return newest(self.instrument, names or names_of_signals(self.instrument))

    def set_loop(self, **settings: Any) -> None:
        """See `LoopSettings`. A setpoint that the detector does not reach is refused.

        Warns
        -----
        UserWarning
            If the loop oscillates with its gains.
        """
        view, force = self._view, settings.get("setpoint_force", 0.0)
        volts = settings.get("setpoint_voltage") or view.volts(force)
        for name, side in (("low", 1.0), ("high", -1.0)):
            if name in settings and side * (view.z - settings[name]) < 0.0:
                raise ParameterError(
                    f"{name} = {settings[name]:g} m is not allowed: z = {view.z:g} m is beyond it; move z first"
                )
        for sentence in saturating("a setpoint", volts, view):
            raise ParameterError(sentence)
        # A loop that knows a voltage only need not be told that there is no force.
        view.set_loop(
            **{
                name: value
                for name, value in settings.items()
                if value or name in view.loop.settings or name in CALIBRATIONS
            }
        )
        if "feedback" in settings:
            # As it was understood.
            self._state.feedback = view.setting("feedback", self._state.feedback)
        if "proportional_gain" in settings or "integral_gain" in settings:
            for sentence in view.loop.warnings(view.parameters):
                warnings.warn(sentence, stacklevel=5)
