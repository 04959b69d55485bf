"""The phases of a test of a controller, one after the other. Needs no ROS."""

from collections.abc import Callable, Iterable
from itertools import repeat
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from afm_model import Command, Instrument, SimParameters, changed
from afm_model.core.errors import DivergenceError, DriveError
from afm_model.core.schema import Value
from afm_model.parts.signals import Measurement

from .log import Answer, Log, Phase, Sent

_PATIENCE = 2.0
"""Time to wait for an answer, by the clock of the connection [s]."""
_UNANSWERED = 3
"""A phase ends after so many measurements without an answer."""
_SETTLE = 0.1
"""Time to wait for a second answer [s]."""
_TICKS = {
    Phase.LOCKSTEP: 2000,
    Phase.RESUMED: 20,
    Phase.RESET: 20,
    Phase.FAULT: 100,
    Phase.REPEAT: 2000,
    Phase.RESTART: 20,
}
"""Measurements of a phase; what comes in REPEAT is compared with LOCKSTEP."""
LONG_TICKS = 100_000
"""Measurements of the phase LONG."""
_LOOKS = 100
"""How often the memory is looked at in it."""
_MOST_MEMORY = 500_000_000
"""It ends when the controller has taken so much more [bytes]."""
_JUMPS = np.random.default_rng(1).choice((-1, 1), 128).tolist()
_JUMP = 5e-10, 5e-10, 2e-9
"""In the phase STEPS the reference of one axis after the other is moved by so much to and fro, at random [m]."""
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
        """Time by which deadlines count [s]."""
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

    def memory(self) -> int:
        """What the controller holds [bytes]."""
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
    long_ticks : int
        Measurements of the phase LONG.
    """

    def __init__(self, connection: TestConnection, parameters: SimParameters, long_ticks: int = LONG_TICKS) -> None:
        self._connection = connection
        self._long_ticks = long_ticks
        self._parameters = parameters
        self._instrument = Instrument(parameters, 1, hashed=False)
        # In real time an answer comes while the tick goes on, and is in force from the next one on.
        self._late = int(parameters.run.mode == "realtime")
        self._phase = Phase.LOCKSTEP
        self._drives: dict[int, Answer] = {}
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
            (Phase.LONG, self._long),
            (Phase.STEPS, self._jump),
            (Phase.REPEAT, self._reset),
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
        self._ask(_TICKS[self._phase])
        self._collect(_SETTLE)

    def _ask(self, ticks: int, jumps: Iterable[tuple[int, int]] = repeat((0, 0))) -> bool:
        """Make ticks with answers; False if too many did not come."""
        unanswered = 0
        for _, jump in zip(range(ticks), jumps, strict=False):
            if not self._instrument.unasked:
                sequence = self._send(jump)
                if not self._collect(_PATIENCE, lambda sequence=sequence: sequence in self._drives):  # type: ignore[misc]
                    unanswered += 1
                    if unanswered == _UNANSWERED:
                        return False
            self._tick()
        return True

    def _long(self) -> None:
        memory = self.log.memory
        for _ in range(_LOOKS):
            if not self._ask(self._long_ticks // _LOOKS):
                break
            memory.append(self._connection.memory())
            if memory[-1] - memory[0] > _MOST_MEMORY:
                break
        self._collect(_SETTLE)

    def _jump(self) -> None:
        for axis in range(3):
            self._ask(len(_JUMPS), [(axis, sense) for sense in _JUMPS])

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

    def _send(self, jump: tuple[int, int] = (0, 0)) -> int:
        sequence, measurement = self._instrument.ticks, self._instrument.measurement
        if jump[1]:
            measurement = measurement.copy()
            measurement.view(Measurement)[0].reference_position[jump[0]] += _JUMP[jump[0]] * jump[1]
        self.log.sent.append(Sent(self._phase, sequence, self._connection.now(), jump))
        self._connection.publish(sequence, measurement)
        return sequence

    def _tick(self) -> None:
        """Make one tick with the answer, or with the previous drive where none came."""
        answered = self._instrument.ticks - self._late
        answer = self._drives.get(answered)
        drive: NDArray[np.float64] | Command | None = None
        # The effect of a drive is not judged here: one that makes the motion diverge counts as an answer.
        if answer is not None and np.isfinite(answer.drives[0]).all():
            drives, period = np.clip(answer.drives, -_STRONGEST, _STRONGEST), answer.horizon_period
            drive = Command(drives[0], drives[1:], period) if period and np.isfinite(drives).all() else drives[0]
        self._instrument.skip_block()
        try:
            self._instrument.tick(drive, answered)
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
                    self._drives[answer.sequence] = answer
            if done():
                return True
            if ended := connection.problem():
                self.log.ended = ended
                raise ControllerEnded
            left = limit - connection.now()
            if left <= 0.0:
                return False
            connection.wait(min(left, 0.05))
