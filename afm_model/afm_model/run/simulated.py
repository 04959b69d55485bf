"""A run in virtual time: real time with latencies from a seed, and a recorded run played again."""

import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Literal, Protocol

import numpy as np
from annotated_types import Ge, Lt
from numpy.typing import NDArray
from pydantic import Field

from ..errors import ParameterError
from ..instrument import Block, ScoreSummary
from ..parameters import SimParameters
from ..parameters.schema import Group, NonNegative, Positive, Unit
from .counts import Snapshot
from .link import Link
from .run import Listeners, Run
from .timing import Delays

_Array = NDArray[np.float64]
_BLOCK_SAMPLES = 65536


class Law(Protocol):
    """Whatever answers a measurement."""

    def answer(self, measurement: _Array) -> _Array:
        """The drive (3,) [V] for a measurement, order of `afm_model.signals`."""
        ...


class Latency(Group):
    """Wall time from publishing a measurement to the arrival of its drive, drawn anew for each from a seed."""

    kind: Literal["lognormal", "normal"] = Field("lognormal", description="distribution of the latency")
    median: Annotated[Positive, Unit("s")] = Field(2e-4, description="half of the drives arrive within it")
    spread: NonNegative = Field(
        0.3,
        description="lognormal: standard deviation of the logarithm; normal: standard deviation over the median; "
        "0: every latency is the median",
    )
    floor: Annotated[NonNegative, Unit("s")] = Field(0.0, description="no drive arrives sooner")
    loss: Annotated[float, Ge(0.0), Lt(1.0)] = Field(0.0, description="part of the drives that never arrive")
    seed: Annotated[int, Ge(0)] = Field(0, description="of all that is drawn")

    def draw(self) -> Callable[[], float]:
        """A function that draws one latency after the other [s]; infinite: the drive is lost."""
        random = np.random.default_rng(self.seed)

        def draw() -> float:
            # Always both: whether drives are lost changes no latency.
            deviation, lost = random.standard_normal(), random.random() < self.loss
            if self.kind == "lognormal":
                latency = self.median * math.exp(self.spread * deviation)
            else:
                latency = self.median * (1.0 + self.spread * deviation)
            return math.inf if lost else max(latency, self.floor)

        return draw


class VirtualClock:
    """A clock that stands still until it is set."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        """The time [s]."""
        return self.now


class SimulatedLink(Link):
    """Answers every measurement by a law, after a latency of virtual time. Drives may overtake one another.

    Parameters
    ----------
    law : Law
        Called once for each measurement, in order.
    clock : VirtualClock
    latency : callable
        The latency of the next drive [s]; infinite: it is lost.
    """

    def __init__(self, law: Law, clock: VirtualClock, latency: Callable[[], float]) -> None:
        self._law, self._clock, self._latency = law, clock, latency
        self._on_the_way: list[tuple[float, int, _Array]] = []
        self._arrived = math.nan

    def publish(self, sequence: int, measurement: _Array) -> None:
        """Have a measurement answered."""
        drive = np.array(self._law.answer(measurement), np.float64)
        arrives = self._clock() + self._latency()
        if math.isfinite(arrives):
            heapq.heappush(self._on_the_way, (arrives, sequence, drive))

    def take(self) -> tuple[int, _Array] | None:
        """The drive that has arrived first and has not been taken."""
        if not self._on_the_way or self._on_the_way[0][0] > self._clock():
            return None
        self._arrived, sequence, drive = heapq.heappop(self._on_the_way)
        return sequence, drive

    def arrived(self) -> float:
        """When the drive taken last arrived [s]."""
        return self._arrived


class Replay:
    """A law that gives the drives of a recorded run, tick by tick.

    Parameters
    ----------
    drives : ndarray (n, 3) [V]
        Applied from each tick on, as recorded: `Recording.drive`, `Simulation.drives`.
    delay_ticks : int
        `plant.delay_ticks` of the instrument. What is recorded has been delayed, so that it is given so many ticks sooner.

    Raises
    ------
    ParameterError
        If the drives are not n rows of three finite numbers: a recording with a gap cannot be replayed.
    """

    def __init__(self, drives: _Array, delay_ticks: int = 0) -> None:
        drives = np.asarray(drives, np.float64)
        if drives.ndim != 2 or drives.shape[1] != 3 or not len(drives):
            raise ParameterError(f"drives of shape {drives.shape} cannot be replayed: they must be n rows of three")
        gaps = np.flatnonzero(~np.isfinite(drives).all(axis=1))
        if gaps.size:
            raise ParameterError(
                f"drives with {gaps.size} gaps cannot be replayed (the first at tick {gaps[0]}): the recording must be whole"
            )
        self._drives = drives
        self._delay_ticks = delay_ticks
        self._next = 0

    def answer(self, measurement: _Array) -> _Array:
        """The drive of the next tick [V]; after the last one, that again."""
        at = min(self._next + self._delay_ticks, len(self._drives) - 1)
        self._next += 1
        return self._drives[at]

    def reset(self) -> None:
        """Begin again."""
        self._next = 0


@dataclass(frozen=True)
class RealtimeSimulation:
    """A finished run in virtual time."""

    parameters: SimParameters
    blocks: list[Block]
    round_trips: (
        _Array  # (n,) latency of the drive that was put in force at each tick [s]; NaN: the one before was held
    )
    score: ScoreSummary
    snapshot: Snapshot  # at the end, with all counts
    delays: Delays
    trajectory_sha256: str

    @property
    def drives(self) -> _Array:
        """Drive applied from each tick on (n, 3) [V]."""
        return np.concatenate([block.drives for block in self.blocks])


def simulate_realtime(parameters: SimParameters, law: Law, latency: Latency) -> RealtimeSimulation:
    """Run the instrument in real time against a controller that answers late: the same bits for the same seed.

    The clock is virtual: every tick is in time, `run.real_time_factor` says how much simulated time a latency takes.
    Watchdog and retract act as over topics.

    Parameters
    ----------
    parameters : SimParameters
        `run.mode` is taken as realtime.
    law : Law
        Called once for each measurement, in order.
    latency : Latency

    Raises
    ------
    ParameterError
        If the duration is not positive, or the tip does not touch the sample at rest.
    DivergenceError
        If the motion diverged.
    """
    if parameters.total_ticks == 0:
        raise ParameterError("run.duration = 0 s is not allowed in a simulation: it must be > 0 s")
    run_parameters = parameters.run.model_copy(update={"mode": "realtime", "start_paused": False})
    parameters = parameters.model_copy(update={"run": run_parameters})
    clock = VirtualClock()
    blocks: list[Block] = []
    round_trips: list[NDArray[np.float32]] = []

    def keep(block: Block, times: NDArray[np.float32]) -> None:
        blocks.append(block)
        round_trips.append(times)

    samples_per_tick = round(parameters.plant.control_period / parameters.detector.sample_period)
    block_ticks = max(1, min(parameters.total_ticks, _BLOCK_SAMPLES // samples_per_tick))
    run = Run(
        parameters, SimulatedLink(law, clock, latency.draw()), clock, Listeners(block=keep), block_ticks=block_ticks
    )
    run.step()
    while (deadline := run.deadline) is not None:
        clock.now = deadline
        run.step()
    snapshot = run.snapshot()
    if snapshot.state == snapshot.state.FAULT:
        raise DivergenceError(snapshot.detail)
    return RealtimeSimulation(
        parameters=parameters,
        blocks=blocks,
        round_trips=np.concatenate(round_trips).astype(np.float64),
        score=run.instrument.score(),
        snapshot=snapshot,
        delays=run.delays(),
        trajectory_sha256=run.instrument.trajectory_sha256(),
    )
