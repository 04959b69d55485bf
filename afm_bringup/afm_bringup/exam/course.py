"""The course of an examination: an instrument that asks, pauses, is reset, fails and is restarted. Needs no ROS."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from afm_model import Instrument, SimParameters, changed
from afm_model.core.errors import DivergenceError, DriveError
from afm_model.core.schema import Value

from .log import Answer, Asked, Log, Phase

_PATIENCE = 2.0
"""Wall time after which an answer does not come any more [s]."""
_UNANSWERED = 3
"""Measurements without an answer after which a phase is over."""
_SETTLE = 0.1
"""Wall time in which a second answer would come [s]."""
_TICKS = {
    Phase.LOCKSTEP: 200,
    Phase.RESUMED: 20,
    Phase.RESET: 20,
    Phase.FAULT: 100,
    Phase.RESTART: 20,
}
_REALTIME_TICKS, _REALTIME_PERIOD = 50, 0.01
_STRONGEST = 1e3
"""Drives beyond it are not put in force: no scanner moves so far [V]."""
_FAULTS: dict[str, dict[str, Value]] = {
    "exam_1": {"kind": "dropout", "signal": "position_x"},
    "exam_2": {"kind": "stuck", "signal": "lateral_force"},
    "exam_3": {"kind": "noise", "signal": "deflection", "size": 1e-9},
    "exam_4": {"kind": "dropout", "signal": "velocity_y"},
    "exam_5": {"kind": "loss", "signal": "measurement", "size": 0.2},
}
"""What fails in the phase of the faults."""


class Desk(Protocol):
    """Where examiner and controller meet."""

    def now(self) -> float:
        """Steady wall time [s]."""
        ...

    def publish(self, sequence: int, measurement: NDArray[np.float64]) -> None:
        """Send a measurement."""
        ...

    def take(self, phase: Phase) -> Answer | None:
        """The oldest message not yet taken; None if there is none."""
        ...

    def wait(self, timeout: float) -> None:
        """Let time pass until something may have come, or for `timeout` seconds."""
        ...

    def problem(self) -> str:
        """How the controller has ended by itself; empty if it has not."""
        ...

    def restart(self) -> bool:
        """End the simulator's side and begin anew; whether the controller connects to it."""
        ...


class Over(Exception):
    """The controller has ended."""


class Course:
    """One examination."""

    def __init__(self, desk: Desk, parameters: SimParameters) -> None:
        self._desk = desk
        self._parameters = parameters
        self._instrument = Instrument(parameters, 1, hashed=False)
        self._phase = Phase.LOCKSTEP
        self._drives: dict[int, NDArray[np.float64]] = {}
        self.log = Log()

    def run(self) -> Log:
        """Every phase in turn. Where nothing is answered at all the others are not tried."""
        steps: list[tuple[Phase, Callable[[], None]]] = [
            (Phase.LOCKSTEP, self._one_by_one),
            (Phase.REALTIME, self._by_the_clock),
            (Phase.PAUSE, self._pause),
            (Phase.RESUMED, self._one_by_one),
            (Phase.AGAIN, self._again),
            (Phase.RESET, self._from_the_start),
            (Phase.FAULT, self._with_faults),
            (Phase.RESTART, self._restart),
        ]
        try:
            for phase, step in steps:
                self._phase = phase
                self._drives.clear()
                self.log.begun.append(phase)
                step()
                if not self.log.answers:
                    break
        except Over:
            pass
        return self.log

    # The phases.

    def _one_by_one(self) -> None:
        unanswered = 0
        for _ in range(_TICKS[self._phase]):
            if not self._instrument.unasked:
                sequence = self._ask()
                if not self._spend(_PATIENCE, lambda sequence=sequence: sequence in self._drives):  # type: ignore[misc]
                    unanswered += 1
                    if unanswered == _UNANSWERED:
                        break
            self._tick()
        self._spend(_SETTLE)

    def _by_the_clock(self) -> None:
        asked = []
        for _ in range(_REALTIME_TICKS):
            asked.append(self._ask())
            self._spend(_REALTIME_PERIOD)
            self._tick()
        self._spend(_PATIENCE, lambda: all(each in self._drives for each in asked))
        self._spend(_SETTLE)

    def _pause(self) -> None:
        self._spend(5 * _SETTLE)

    def _again(self) -> None:
        sequence = self._ask()
        self._spend(_PATIENCE, lambda: sequence in self._drives)
        self._drives.clear()
        self._ask()
        self._spend(_PATIENCE, lambda: sequence in self._drives)
        self._tick()
        self._spend(_SETTLE)

    def _from_the_start(self) -> None:
        self._begin_again()
        self._one_by_one()

    def _with_faults(self) -> None:
        if self._parameters.fault.kind != "scheduled":
            self.log.begun.remove(self._phase)
            return
        start = (self._instrument.ticks + 1) * self._parameters.plant.control_period
        values: dict[str, Value] = {}
        for name, fields in _FAULTS.items():
            values |= {f"fault.{name}.{field}": value for field, value in fields.items()}
            values[f"fault.{name}.start"] = start
        self._instrument.set_faults(changed(self._parameters, values))
        self._one_by_one()
        self._instrument.set_faults(self._parameters)

    def _restart(self) -> None:
        self.log.reconnected = self._desk.restart()
        if self.log.reconnected:
            self._begin_again()
            self._one_by_one()

    # One tick.

    def _begin_again(self) -> None:
        self._instrument.skip_block()
        self._instrument.reset()

    def _ask(self) -> int:
        sequence = self._instrument.ticks
        self.log.asked.append(Asked(self._phase, sequence, self._desk.now()))
        self._desk.publish(sequence, self._instrument.measurement)
        return sequence

    def _tick(self) -> None:
        """Go on with the answer, or with the drive before."""
        drive = self._drives.get(self._instrument.ticks)
        # What a drive does is not judged here: one that makes the motion diverge is an answer like any other.
        if drive is not None and np.isfinite(drive).all():
            drive = np.clip(drive, -_STRONGEST, _STRONGEST)
        else:
            drive = None
        self._instrument.skip_block()
        try:
            self._instrument.tick(drive)
        except (DivergenceError, DriveError):
            ticks = self._instrument.ticks
            self._begin_again()
            # The numbers go on.
            for _ in range(ticks):
                self._instrument.tick(None)
                self._instrument.skip_block()

    def _spend(self, timeout: float, done: Callable[[], bool] = lambda: False) -> bool:
        """Take what comes until `done`, or for so long; whether it was."""
        desk = self._desk
        limit = desk.now() + timeout
        while True:
            while (answer := desk.take(self._phase)) is not None:
                self.log.answers.append(answer)
                if not answer.unreadable:
                    self._drives[answer.sequence] = answer.drives[0]
            if done():
                return True
            if ended := desk.problem():
                self.log.ended = ended
                raise Over
            left = limit - desk.now()
            if left <= 0.0:
                return False
            desk.wait(min(left, 0.05))
