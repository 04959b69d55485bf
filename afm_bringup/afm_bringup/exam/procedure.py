"""The phases of a test of a controller, one after the other. Needs no ROS."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from afm_model import Command, Instrument, SimParameters, changed
from afm_model.core.errors import DivergenceError, DriveError
from afm_model.core.schema import Value
from afm_model.parts.signals import Measurement

from .log import NO_JUMP, Answer, Jump, Log, Phase, Sent

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
_AFTERWARDS = 100
"""Measurements of the phase FAULT after the faults."""
LONG_TICKS = 100_000
"""Measurements of the phase LONG."""
_LOOKS = 100
"""How often the memory is looked at in it."""
_MOST_MEMORY = 500_000_000
"""It ends when the controller has taken so much more [bytes]."""
_SETTLED, _JUMPS = 100, 128
"""In the phase STEPS nothing jumps at first, then one thing after the other, to and fro at random."""
_JUMP = np.array([5e-10, 5e-10, 2e-9])
"""How far along x, y and z [m]."""
_SHAKE = 1e-3
"""All measured positions move by about so much of it besides, so that no sensor seems to be stuck."""
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
        """Return the oldest message not yet taken; None if no message is left."""
        ...

    def begin_run(self) -> None:
        """Name another run in the measurements from here on."""
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
    seed : int
        Of what is at random.
    """

    def __init__(
        self, connection: TestConnection, parameters: SimParameters, long_ticks: int = LONG_TICKS, seed: int = 1
    ) -> None:
        self._connection = connection
        self._random = np.random.default_rng(seed)
        self._long_ticks = long_ticks
        self._parameters = parameters
        self._instrument = Instrument(parameters, 1, hashed=False)
        self._at_rest = self._instrument.measurement.copy()
        self._rest = float(self._at_rest.view(Measurement)[0].deflection)
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

    def _ask(self, ticks: int) -> bool:
        """Make ticks with answers; False if too many did not come."""
        unanswered = 0
        for _ in range(ticks):
            if not self._instrument.unasked and not self._answered(self._send()):
                unanswered += 1
                if unanswered == _UNANSWERED:
                    return False
            self._tick()
        return True

    def _long(self) -> None:
        # What a fault has done to the controller is not counted here, nor in the phase STEPS.
        self._begin_run()
        memory = self.log.memory
        for _ in range(_LOOKS):
            if not self._ask(self._long_ticks // _LOOKS):
                break
            memory.append(self._connection.memory())
            if memory[-1] - memory[0] > _MOST_MEMORY:
                break
        self._collect(_SETTLE)

    def _jump(self) -> None:
        """Measurements of a microscope that no drive moves: what a drive answers is not mixed with what it has done."""
        jumps = [NO_JUMP] * _SETTLED
        for measured in (False, True):
            for axis in range(3):
                jumps += [Jump(axis, sense, measured) for sense in self._random.choice((-1, 1), _JUMPS).tolist()]
        unanswered = 0
        for sequence, jump in enumerate(jumps, self._instrument.ticks):
            measurement = self._still(sequence, jump, _SHAKE * self._random.standard_normal(3))
            if not self._answered(self._publish(sequence, measurement, jump)):
                unanswered += 1
                if unanswered == _UNANSWERED:
                    break

    def _still(self, sequence: int, jump: Jump, shake: NDArray[np.float64]) -> NDArray[np.float64]:
        """A measurement at rest, but for a jump, and positions that are moved by `shake`, in units of a jump."""
        measurement = self._at_rest.copy()
        y = measurement.view(Measurement)[0]
        y.reference_position[:2] = y.position[:2]
        y.reference_velocity[:] = y.reference_acceleration[:] = 0.0
        moved = _JUMP * shake
        (moved if jump.measured else y.reference_position)[jump.axis] += _JUMP[jump.axis] * jump.sense
        y.position += moved
        # A scanner that rises lifts the tip.
        y.deflection += moved[2]
        y.deflection_voltage += moved[2] / self._parameters.detector.deflection_sensitivity
        newest = sequence - 1 - self._late
        y.newest_drive_sequence = max(newest, -1)
        y.drive_sequence = max(newest - self._parameters.plant.delay_ticks, -1)
        return measurement

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
        self._answered(self._send())
        self._drives.clear()
        self._answered(self._send())
        self._tick()
        self._collect(_SETTLE)

    def _reset(self) -> None:
        self._begin_run()
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
        answers = self._ask(_TICKS[self._phase])
        self._instrument.set_faults(self._parameters)
        if answers:
            self._ask(_AFTERWARDS)
        self._collect(_SETTLE)

    def _restart(self) -> None:
        self.log.reconnected = self._connection.restart()
        if self.log.reconnected:
            self._begin_run()
            self._lockstep()

    # One tick.

    def _begin_run(self) -> None:
        self._connection.begin_run()
        self._begin_again()

    def _begin_again(self) -> None:
        self._instrument.skip_block()
        self._instrument.reset()

    def _send(self) -> int:
        return self._publish(self._instrument.ticks, self._instrument.measurement)

    def _publish(self, sequence: int, measurement: NDArray[np.float64], jump: Jump = NO_JUMP) -> int:
        self.log.sent.append(Sent(self._phase, sequence, self._connection.now(), jump))
        self._connection.publish(sequence, measurement)
        return sequence

    def _answered(self, sequence: int) -> bool:
        """Wait for the answer to a measurement; False if it did not come."""
        return self._collect(_PATIENCE, lambda: sequence in self._drives)

    def _note_motion(self) -> None:
        """Keep what the drives make of the exam's own plant."""
        y = self._instrument.measurement.view(Measurement)[0]
        self.log.motion.append(np.array([[*y.position[:2], y.deflection], [*y.reference_position[:2], self._rest]]))

    def _tick(self) -> None:
        """Make one tick with the answer, or with the previous drive where none came."""
        if self._phase is Phase.LOCKSTEP:
            self._note_motion()
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
