"""A scenario in process, without ROS: the same instrument and law, the same bytes as the lockstep run over topics."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..instrument import Block, Instrument, ScoreSummary
from ..instrument.block import Layouts
from ..instrument.controller import Controller
from ..instrument.validity import doubts
from ..law import require_plant, timing_disagreements, warn_of_timing
from ..parameters import ControllerParameters, SimParameters
from ..parts.part import Channel
from .context import RunContext
from .engine import Engine
from .link import Listeners
from .pacing import Asked, Compiled, Pacing
from .plotting import Curves, plot
from .replay import Replay, replayed
from .simulated import AnsweringLaw, ticks_of_a_block, ticks_to_simulate
from .state import OVER, RunState
from .verdict import limited, outside, saturated

if TYPE_CHECKING:
    from .plotting import Figure

_Array = NDArray[np.float64]
_ESTIMATES = 200
"""How often the estimates of a law are kept in a run."""


class RunEvent(NamedTuple):
    """The drive has changed hands, because a limit was passed (`safety.*`) or it was given back."""

    time: float  # [s]
    state: RunState
    sentence: str


@dataclass(frozen=True)
class Simulation:
    """A finished run: n control ticks, m detector samples, SI units. Records have their fields by name."""

    parameters: SimParameters
    time: _Array  # (n,) simulated time of the ticks [s]
    measurements: NDArray[Any]  # (n,) records of afm_model.parts.signals.Measurement
    truth: NDArray[Any]  # (n,) records of afm_model.parts.signals.Truth: what no sensor sees, at the ticks
    drive: _Array  # (n, 3) applied from each tick on [V]
    time_samples: _Array  # (m,) [s]
    samples: _Array  # (channels, m)
    channels: tuple[Channel, ...]
    score: ScoreSummary
    doubts: list[str]  # why the score may not be true, a sentence each
    events: list[RunEvent]  # what its own limits have done
    trajectory_sha256: str
    remark: str = ""  # what the law has to say of itself, such as that it has fallen back
    estimates: dict[str, _Array] = field(default_factory=dict)
    """What the law believes of the microscope, by name (`afm_model.parts.LawEstimate`): some 200 times in the run, with
    `time` of the last tick before each [s]. Empty if the law estimates nothing.
    """

    @property
    def position(self) -> _Array:
        """Scanner position (n, 3) [m] as its sensors read it; `truth.position` is the true one."""
        return self.measurements["position"]

    @property
    def velocity(self) -> _Array:
        """Scanner velocity (n, 3) [m/s]."""
        return self.measurements["velocity"]

    @property
    def reference(self) -> _Array:
        """Reference: x, y of the scanner, z of the tip (n, 3) [m]."""
        return self.measurements["reference_position"]

    @property
    def error(self) -> _Array:
        """Tracking error as measured: x, y of the scanner, z of the tip (n, 3) [m]; the score's is the true one."""
        error = self.position - self.reference
        error[:, 2] = self.parameters.cantilever.a + self.deflection - self.reference[:, 2]
        return error

    @property
    def deflection(self) -> _Array:
        """Cantilever deflection at the ticks (n,) [m]."""
        return self.measurements["deflection"]

    @property
    def lateral_force(self) -> _Array:
        """Lateral force along x at the ticks (n,) [N], as read from the photodetector."""
        return self.measurements["lateral_force"]

    @property
    def lateral_force_y(self) -> _Array:
        """Lateral force along y at the ticks (n,) [N]: the true one, which no photodetector sees."""
        return self.truth["friction"][:, 1]

    def channel(self, name: str) -> _Array:
        """Samples (m,) of a channel in SI units.

        Raises
        ------
        KeyError
            If it was not sampled.
        """
        for number, channel in enumerate(self.channels):
            if channel.name == name:
                return self.samples[number] * channel.scale(self.parameters)
        raise KeyError(f"no channel {name} was sampled; there are {', '.join(each.name for each in self.channels)}")

    def plot(self, title: str = "") -> "Figure":
        """Position and reference, errors, drive, lateral force and friction loop in a figure of pyplot: a notebook
        shows it, `savefig` writes it to a file. ImportError where matplotlib is not installed.
        """
        curves = Curves(self.time, self.position, self.reference, self.error, self.drive, self.lateral_force)
        return plot(curves, title)


def simulate(
    parameters: SimParameters,
    controller: ControllerParameters | AnsweringLaw,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Simulation:
    """Run the instrument with a law for `parameters.run.duration`, in lockstep.

    Parameters
    ----------
    parameters : SimParameters
    controller : ControllerParameters or an object with `answer(measurement) -> drive`
        If it has a `reset`, that is called at the start.
    progress : callable, optional
        Called now and then with ticks done and ticks in all; see `afm_model.core.progress.bar`.

    Warns
    -----
    TimingWarning
        If the law is made for another control period or delay than those of the plant.

    Raises
    ------
    ParameterError
        If the duration is not positive, or the tip does not touch the sample at rest.
    DriveError
        If the law answers with a NaN or an infinity.
    DivergenceError
        If the motion leaves every scanner's range.
    PartError
        If a part of somebody else's does not work.
    """
    law = _parameters_of(controller)
    if law is not None:
        warn_of_timing(timing_disagreements(law.law, parameters))
    blocks: list[Block] = []
    events: list[RunEvent] = []
    if isinstance(controller, ControllerParameters):
        controller = Controller(controller)
    believed: dict[str, list[float]] = {}
    believes = controller if isinstance(controller, Controller) and controller.estimates else None
    ticks = min(ticks_of_a_block(parameters), math.ceil(ticks_to_simulate(parameters) / _ESTIMATES))

    def take(block: Block) -> None:
        blocks.append(block)
        if believes is not None:
            now = (block.first_tick + len(block.measurements) - 1) * parameters.plant.control_period
            for name, value in [("time", now), *((name, value) for name, _, value in believes.estimates)]:
                believed.setdefault(name, []).append(value)

    instrument = run(
        parameters,
        controller,
        take,
        progress=progress,
        on_event=events.append,
        block_ticks=ticks if believes is not None else None,
    )
    found = doubts(parameters, instrument.score(), law)
    if sentence := limited(instrument):
        found.append(f"{sentence}; first at {events[0].time:.6g} s: {events[0].sentence}")
    if sentence := saturated(instrument.samples_saturated):
        found.append(sentence)
    if sentence := outside(instrument.time_outside, parameters.plant.kind):
        found.append(sentence)
    samples = np.concatenate([block.samples for block in blocks], axis=1)
    measurements = np.concatenate([block.measurements for block in blocks]).view(np.recarray)
    return Simulation(
        parameters=parameters,
        time=np.arange(len(measurements), dtype=np.float64) * parameters.plant.control_period,
        measurements=measurements,
        truth=instrument.truth_of(np.concatenate([block.states for block in blocks])),
        drive=np.concatenate([block.drives for block in blocks]),
        time_samples=np.arange(samples.shape[1], dtype=np.float64) * parameters.detector.sample_period,
        samples=samples,
        channels=instrument.channels,
        score=instrument.score(),
        doubts=found,
        events=events,
        trajectory_sha256=instrument.trajectory_sha256(),
        estimates={name: np.array(values) for name, values in believed.items()},
        remark=controller.remark if isinstance(controller, Controller) else "",
    )


def run(
    parameters: SimParameters,
    controller: ControllerParameters | AnsweringLaw,
    take: Callable[[Block], object] | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
    on_event: Callable[[RunEvent], object] | None = None,
    block_ticks: int | None = None,
    hashed: bool = True,
) -> Instrument:
    """As `simulate`, with every block handed to `take` and not kept: memory stays flat however long the run is.

    Parameters
    ----------
    parameters, controller, progress
        As in `simulate`.
    take : callable, optional
        Called with every block; without it nothing is recorded.
    on_event : callable, optional
        Called with what the instrument's own limits do, see `Simulation.events`.
    block_ticks : int, optional
        Control ticks in a block.
    hashed : bool
        False: no `trajectory_sha256`, which takes a tenth of the time of a tick of two steps.

    Returns
    -------
    Instrument
        At the end of the run.
    """
    engine = engine_of(
        parameters, controller, take, progress=progress, on_event=on_event, block_ticks=block_ticks, hashed=hashed
    )
    while engine.state not in OVER:
        engine.step()
    if engine.error is not None:
        raise engine.error
    return engine.instrument


def engine_of(
    parameters: SimParameters,
    controller: ControllerParameters | AnsweringLaw,
    take: Callable[[Block], object] | None = None,
    *,
    progress: Callable[[int, int], None] | None = None,
    on_event: Callable[[RunEvent], object] | None = None,
    block_ticks: int | None = None,
    hashed: bool = True,
    sampled: bool = True,
    layouts: Layouts | None = None,
) -> Engine:
    """What `run` steps until it is over; `sampled` and `layouts` as of `Instrument`."""
    total = ticks_to_simulate(parameters)
    if isinstance(controller, Replay):
        parameters = replayed(parameters)
    if (own := _parameters_of(controller)) is not None:
        require_plant(own, parameters.plant)
    law = Controller(controller) if isinstance(controller, ControllerParameters) else controller

    def pacing(context: RunContext) -> Pacing:
        # A law is compiled, or called from compiled code; other objects are called tick by tick.
        if isinstance(law, Controller) and type(law).answer is Controller.answer:
            return Compiled(context, law)
        return Asked(context, law)

    def on_block(block: Block, round_trips: object) -> None:
        if take is not None:
            take(block)
        if progress is not None:
            progress(engine.instrument.ticks, total)

    def on_change() -> None:
        if on_event is not None and engine.instrument.ticks and engine.state not in OVER:
            sentence = engine.life.detail or "the controller has the drive again"
            on_event(RunEvent(engine.instrument.time, engine.state, sentence))

    heard = None if take is None and progress is None else on_block
    engine = Engine(
        parameters,
        pacing,
        total,
        listeners=Listeners(changed=on_change, block=heard),
        block_ticks=block_ticks or ticks_of_a_block(parameters),
        hashed=hashed,
        sampled=sampled,
        layouts=layouts,
    )
    return engine


def _parameters_of(controller: ControllerParameters | AnsweringLaw) -> ControllerParameters | None:
    """Of a law of ours."""
    if isinstance(controller, Controller):
        return controller.parameters
    return controller if isinstance(controller, ControllerParameters) else None
