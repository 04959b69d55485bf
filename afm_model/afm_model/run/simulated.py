"""Real time without waiting: a run in virtual time, with latencies from a seed."""

import heapq
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from annotated_types import Ge, Lt
from numpy.typing import NDArray
from pydantic import Field

from ..core.elementary import exp
from ..core.errors import DivergenceError, DriveError, ParameterError
from ..core.random_numbers import RandomStream
from ..core.schema import Group, NonNegative, Positive, Unit
from ..instrument import Block, ScoreSummary
from ..instrument.controller import Controller
from ..law import ExternalLaw, timing_disagreements, warn_of_timing
from ..parameters import SimParameters
from ..parts.drives_ahead import Command
from .counts import Snapshot
from .link import Link, Listeners
from .run import Run
from .timing import Delays, VirtualClock
from .verdict import reasons, warning

_Array = NDArray[np.float64]
_BLOCK_SAMPLES = 65536
_LATENCIES = 3000
"""Stream of the random numbers of latencies."""


class AnsweringLaw(Protocol):
    """Anything that answers measurements."""

    def answer(self, measurement: _Array, /) -> Any:
        """Drive [V], (3,), or Command, for a measurement in the order of `afm_model.parts.signals.Measurement`."""
        ...


def ticks_to_simulate(parameters: SimParameters) -> int:
    """Control ticks of a run; ParameterError if it is endless."""
    if parameters.total_ticks == 0:
        raise ParameterError("run.duration = 0 s is not allowed in a simulation: it must be > 0 s")
    return parameters.total_ticks


def ticks_of_a_block(parameters: SimParameters) -> int:
    """Control ticks in a block of a run that is kept: as many as make a handy number of samples."""
    samples_per_tick = round(parameters.plant.control_period / parameters.detector.sample_period)
    return max(1, min(ticks_to_simulate(parameters), _BLOCK_SAMPLES // samples_per_tick))


class SimulatedLink(Link):
    """Answers every measurement by a law, after a latency of virtual time. Drives may overtake one another.

    Parameters
    ----------
    law : AnsweringLaw
        Called once for each measurement, in order.
    clock : VirtualClock
    latency : callable
        The latency of the next drive [s]; infinite: it is lost.
    control_period : float [s]
        Between two measurements.
    """

    def __init__(
        self, law: AnsweringLaw, clock: VirtualClock, latency: Callable[[], float], control_period: float
    ) -> None:
        self._law, self._clock, self._latency = law, clock, latency
        self._control_period = control_period
        self._on_the_way: list[tuple[float, int, _Array | Command]] = []
        self._arrived = math.nan

    def publish(self, sequence: int, measurement: _Array) -> None:
        """Have a measurement answered."""
        drive = self._answer(sequence, measurement)
        if not isinstance(drive, Command):
            drive = np.array(drive, np.float64)
            if drive.shape != (3,):
                raise DriveError(f"drive {drive.tolist()} is not allowed: it must be three voltages")
        arrives = self._clock() + self._latency()
        if math.isfinite(arrives):
            heapq.heappush(self._on_the_way, (arrives, sequence, drive))

    def _answer(self, sequence: int, measurement: _Array) -> Any:
        if isinstance(self._law, Controller):
            return self._law.answer(measurement, sequence * self._control_period)
        return self._law.answer(measurement)

    def take(self) -> tuple[int, _Array | Command] | None:
        """The drive that has arrived first and has not been taken."""
        if not self._on_the_way or self._on_the_way[0][0] > self._clock():
            return None
        self._arrived, sequence, drive = heapq.heappop(self._on_the_way)
        return sequence, drive

    def arrived(self) -> float:
        """When the drive taken last arrived [s]."""
        return self._arrived


class Latency(Group):
    """Wall time from publishing a measurement to the arrival of its drive, drawn for each separately from a seed."""

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
        random = RandomStream(self.seed, _LATENCIES)

        def draw() -> float:
            # Always both: whether drives are lost changes no latency.
            deviation, lost = float(random.standard_normal(1)[0]), bool(random.random(1)[0] <= self.loss)
            if self.kind == "lognormal":
                latency = self.median * exp(self.spread * deviation)
            else:
                latency = self.median * (1.0 + self.spread * deviation)
            return math.inf if lost else max(latency, self.floor)

        return draw


@dataclass(frozen=True)
class RealtimeSimulation:
    """A finished run in virtual time."""

    parameters: SimParameters
    blocks: list[Block]
    round_trips: _Array  # (n,) latency of the drive that was put in force at each tick [s]; NaN: none was
    score: ScoreSummary
    snapshot: Snapshot  # at the end, with all counts
    delays: Delays
    trajectory_sha256: str
    doubts: list[str]  # why the score may not be true, a sentence each, as `reason` of afm_msgs/Score
    warning: str  # what else to know before reading it, as there

    @property
    def drive(self) -> _Array:
        """Drive applied from each tick on (n, 3) [V]."""
        return np.concatenate([block.drives for block in self.blocks])


def simulate_realtime(parameters: SimParameters, law: AnsweringLaw, latency: Latency) -> RealtimeSimulation:
    """Run the instrument in real time against a controller that answers late: the same bits for the same seed.

    The clock is virtual: every tick is in time, `run.real_time_factor` says how much simulated time a latency takes.
    Watchdog and retract act as over topics.

    Parameters
    ----------
    parameters : SimParameters
        `run.mode` is taken as realtime.
    law : AnsweringLaw
        Called once for each measurement, in order.
    latency : Latency

    Warns
    -----
    TimingWarning
        If it is a law of ours that is made for another control period or delay than those of the plant.

    Raises
    ------
    ParameterError
        If the duration is not positive, or the tip does not touch the sample at rest.
    DriveError
        If the law answers with something else than three numbers. A NaN or an infinity is refused and counted.
    DivergenceError
        If the motion diverged.
    """
    if isinstance(law, Controller):
        warn_of_timing(timing_disagreements(law.parameters.law, parameters))
    block_ticks = ticks_of_a_block(parameters)
    run_parameters = parameters.run.model_copy(update={"mode": "realtime", "start_paused": False})
    # The law given is the one that counts.
    parameters = parameters.model_copy(update={"run": run_parameters, "law": ExternalLaw()})
    clock = VirtualClock()
    blocks: list[Block] = []
    round_trips: list[NDArray[np.float32]] = []

    def keep(block: Block, times: NDArray[np.float32]) -> None:
        blocks.append(block)
        round_trips.append(times)

    link = SimulatedLink(law, clock, latency.draw(), parameters.plant.control_period)
    run = Run(parameters, link, clock, Listeners(block=keep), block_ticks=block_ticks)
    run.step()
    while (deadline := run.deadline) is not None:
        clock.now = deadline
        run.step()
    snapshot = run.snapshot()
    if isinstance(run.error, DivergenceError):
        raise DivergenceError(snapshot.detail) from run.error
    if run.error is not None:
        raise run.error
    score = run.instrument.score()
    return RealtimeSimulation(
        parameters=parameters,
        blocks=blocks,
        round_trips=np.concatenate(round_trips).astype(np.float64),
        score=score,
        snapshot=snapshot,
        delays=run.delays(),
        trajectory_sha256=run.instrument.trajectory_sha256(),
        doubts=reasons(score, snapshot, parameters, law.parameters if isinstance(law, Controller) else None),
        warning=warning(score, snapshot),
    )
