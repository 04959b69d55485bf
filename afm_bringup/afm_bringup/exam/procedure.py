"""The phases of a test of a controller: lockstep, real time, pause, reset, faults, restart. Needs no ROS."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from afm_model import Instrument, SimParameters, changed
from afm_model.core.errors import DivergenceError, DriveError
from afm_model.core.schema import Value

from .log import Answer, Log, Phase, Sent

_PATIENCE = 2.0
"""Wall time to wait for an answer [s]."""
_UNANSWERED = 3
"""A phase ends after so many measurements without an answer."""
_SETTLE = 0.1
"""Wall time to wait for a second answer [s]."""
_TICKS = {
    Phase.LOCKSTEP: 200,
    Phase.RESUMED: 20,
    Phase.RESET: 20,
    Phase.FAULT: 100,
    Phase.RESTART: 20,
}
_REALTIME_TICKS, _REALTIME_PERIOD = 50, 0.01
_STRONGEST = 1e3
"""Drives are clipped at this voltage: no scanner moves so far [V]."""
_FAULTS: dict[str, dict[str, Value]] = {
    "exam_1": {"kind": "dropout", "signal": "position_x"},
    "exam_2": {"kind": "stuck", "signal": "lateral_force"},
    "exam_3": {"kind": "noise", "signal": "deflection", "size": 1e-9},
    "exam_4": {"kind": "dropout", "signal": "velocity_y"},
    "exam_5": {"kind": "loss", "signal": "measurement", "size": 0.2},
}
"""Faults during the phase FAULT."""


class Connection(Protocol):
    """How measurements reach a controller."""

    def now(self) -> float:
        """Steady wall time [s]."""
        ...

    def publish(self, sequence: int, measurement: NDArray[np.float64]) -> None:
        """Send a measurement."""
        ...

    def wait(self, timeout: float) -> None:
        """Wait until a message may have come, or for `timeout` seconds."""
        ...

    def problem(self) -> str:
        """How the controller has ended by itself; empty if it has not."""
        ...


class TestConnection(Connection, Protocol):
    """How measurements reach the controller under test, and its drives come back."""

    def take(self, phase: Phase) -> Answer | None:
        """The oldest message not yet taken; None if there is none."""
        ...

    def restart(self) -> bool:
        """Close this side and open it again, as a restarted simulator would; True if the controller connects to it."""
        ...


class ControllerEnded(Exception):
    """The process of the controller has ended."""


class Procedure:
    """One test of a controller, phase by phase.

    Parameters
    ----------
    connection : TestConnection
    parameters : SimParameters
    """

    def __init__(self, connection: TestConnection, parameters: SimParameters) -> None:
        self._connection = connection
        self._parameters = parameters
        self._instrument = Instrument(parameters, 1, hashed=False)
        self._phase = Phase.LOCKSTEP
        self._drives: dict[int, NDArray[np.float64]] = {}
        self.log = Log()

    def run(self) -> Log:
        """Run every phase in turn; stop after the first if nothing was answered."""
        steps: list[tuple[Phase, Callable[[], None]]] = [
            (Phase.LOCKSTEP, self._lockstep),
            (Phase.REALTIME, self._realtime),
            (Phase.PAUSE, self._pause),
            (Phase.RESUMED, self._lockstep),
            (Phase.AGAIN, self._send_again),
            (Phase.RESET, self._reset),
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
        except ControllerEnded:
            pass
        return self.log

    # The phases.

    def _lockstep(self) -> None:
        unanswered = 0
        for _ in range(_TICKS[self._phase]):
            if not self._instrument.unasked:
                sequence = self._send()
                if not self._collect(_PATIENCE, lambda sequence=sequence: sequence in self._drives):  # type: ignore[misc]
                    unanswered += 1
                    if unanswered == _UNANSWERED:
                        break
            self._tick()
        self._collect(_SETTLE)

    def _realtime(self) -> None:
        sent = []
        for _ in range(_REALTIME_TICKS):
            sent.append(self._send())
            self._collect(_REALTIME_PERIOD)
            self._tick()
        self._collect(_PATIENCE, lambda: all(each in self._drives for each in sent))
        self._collect(_SETTLE)

    def _pause(self) -> None:
        self._collect(5 * _SETTLE)

    def _send_again(self) -> None:
        sequence = self._send()
        self._collect(_PATIENCE, lambda: sequence in self._drives)
        self._drives.clear()
        self._send()
        self._collect(_PATIENCE, lambda: sequence in self._drives)
        self._tick()
        self._collect(_SETTLE)

    def _reset(self) -> None:
        self._begin_again()
        self._lockstep()

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
        self._lockstep()
        self._instrument.set_faults(self._parameters)

    def _restart(self) -> None:
        self.log.reconnected = self._connection.restart()
        if self.log.reconnected:
            self._begin_again()
            self._lockstep()

    # One tick.

    def _begin_again(self) -> None:
        self._instrument.skip_block()
        self._instrument.reset()

    def _send(self) -> int:
        sequence = self._instrument.ticks
        self.log.sent.append(Sent(self._phase, sequence, self._connection.now()))
        self._connection.publish(sequence, self._instrument.measurement)
        return sequence

    def _tick(self) -> None:
        """Make one tick with the answer, or with the previous drive where none came."""
        drive = self._drives.get(self._instrument.ticks)
        # The effect of a drive is not judged here: one that makes the motion diverge counts as an answer.
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
            # The sequence numbers continue.
            for _ in range(ticks):
                self._instrument.tick(None)
                self._instrument.skip_block()

    def _collect(self, timeout: float, done: Callable[[], bool] = lambda: False) -> bool:
        """Take answers until `done`, or for `timeout` seconds; True if `done`."""
        connection = self._connection
        limit = connection.now() + timeout
        while True:
            while (answer := connection.take(self._phase)) is not None:
                self.log.answers.append(answer)
                if not answer.unreadable:
                    self._drives[answer.sequence] = answer.drives[0]
            if done():
                return True
            if ended := connection.problem():
                self.log.ended = ended
                raise ControllerEnded
            left = limit - connection.now()
            if left <= 0.0:
                return False
            connection.wait(min(left, 0.05))
