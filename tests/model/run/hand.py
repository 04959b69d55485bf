"""A run in the hands of a test: its own clock, its own drives, everything that was told written down."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from afm_model import Block, Command, DriveError, SimParameters, build
from afm_model.core.errors import MalformedError
from afm_model.run import Link, Listeners, Run, RunState

PERIOD = 2.0**-10
"""Control period, and at a real-time factor of 1 wall time between two ticks [s]: some 1 ms, exact as a float."""
START = 1024.0
"""Where the clock begins [s]: any origin will do."""


class HandLink(Link):
    """Drives arrive when the test sends them."""

    def __init__(self, bench: "Bench") -> None:
        self._bench = bench
        self._inbox: deque[tuple[float, int, NDArray[np.float64] | Command | DriveError | MalformedError]] = deque()
        self._arrived = 0.0
        self.published: list[int] = []
        self.is_ready = True
        self.rival = ""

    def publish(self, sequence: int, measurement: NDArray[np.float64]) -> None:
        self.published.append(sequence)

    def send(self, sequence: int, x: float = 0.0, z: float | None = None, arrived: float | None = None) -> None:
        """A drive for measurement `sequence`, here since `arrived`."""
        drive = np.array([x, 0.0, self._bench.rest if z is None else z])
        self._inbox.append((self._bench.now if arrived is None else arrived, sequence, drive))

    def send_drive(self, sequence: int, voltage: NDArray[np.float64]) -> None:
        """Any drive for measurement `sequence` [V], (3,)."""
        self._inbox.append((self._bench.now, sequence, voltage.copy()))

    def send_horizon(self, sequence: int, *xs: float) -> None:
        """A drive for measurement `sequence`, and one for each of the next control periods."""
        drives = np.array([[x, 0.0, self._bench.rest] for x in xs])
        self._inbox.append((self._bench.now, sequence, Command(drives[0], drives[1:], PERIOD)))

    def send_refused(self, sequence: int, reason: str) -> None:
        """What answers measurement `sequence` and cannot be a drive."""
        self._inbox.append((self._bench.now, sequence, DriveError(reason)))

    def send_nonsense(self) -> None:
        """Something that is no drive."""
        self._inbox.append((self._bench.now, -1, MalformedError("2 bytes that are no PiezoDrive")))

    def take(self) -> tuple[int, NDArray[np.float64] | Command | DriveError] | None:
        if not self._inbox:
            return None
        self._arrived, sequence, drive = self._inbox.popleft()
        if isinstance(drive, MalformedError):
            raise drive
        return sequence, drive

    def arrived(self) -> float:
        return self._arrived

    def ready(self) -> bool:
        return self.is_ready

    def objection(self) -> str:
        return self.rival

    @property
    def controller(self) -> str:
        return "/afm/hand"


class Bench:
    """A run, its link, its clock, and what its listeners heard."""

    def __init__(
        self, mode: str, ticks: int = 0, block_ticks: int = 500, *, in_pieces: bool = False, **values: object
    ) -> None:
        self.now = START
        self.told: list[tuple[RunState, str]] = []
        self.blocks: list[Block] = []
        self.round_trips: list[float] = []
        self.ends = 0
        self.link = HandLink(self)
        parameters = {
            "plant.control_period": PERIOD,
            "plant.dt": 2.0**-20,
            "detector.sample_period": PERIOD,
            "run.mode": mode,
            "run.duration": ticks * PERIOD,
            "score.start": 0.0,
        }
        self.parameters = build(SimParameters, parameters | values)  # type: ignore[arg-type]
        listeners = Listeners(changed=self._changed, block=self._block, ended=self._ended)
        self.run = Run(
            self.parameters, self.link, lambda: self.now, listeners, block_ticks=block_ticks, in_pieces=in_pieces
        )
        self.rest = float(self.run.instrument.drive[2])

    def _changed(self) -> None:
        run = self.run.snapshot()
        self.told.append((run.state, run.detail))

    def _block(self, block: Block, round_trips: NDArray[np.float32]) -> None:
        self.blocks.append(block)
        self.round_trips.extend(round_trips)

    def _ended(self) -> None:
        self.ends += 1
        assert self.run.state != RunState.FINISHED, "the end is told before the state changes"

    @property
    def state(self) -> RunState:
        return self.run.state

    @property
    def states(self) -> list[RunState]:
        return [state for state, _ in self.told]

    @property
    def ticks(self) -> int:
        return self.run.instrument.ticks

    @property
    def drives(self) -> NDArray[np.float64]:
        """Drives applied up to now [V], (n, 3)."""
        self.run.flush()
        return np.concatenate([np.zeros((0, 3)), *(block.drives for block in self.blocks)])

    def counts(self) -> dict[str, int]:
        """Counts that are not zero."""
        counts = self.run.snapshot().counts
        return {name: value for name in counts.__slots__ if (value := getattr(counts, name))}

    def at(self, periods: float) -> bool:
        """Let so many periods have passed since the start, and step once."""
        self.now = START + periods * PERIOD
        return self.run.step()

    def answer(self, x: float = 0.0) -> bool:
        """Lockstep: answer the measurement that waits, and step once."""
        self.link.send(self.ticks, x)
        return self.run.step()
