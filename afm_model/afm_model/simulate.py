"""A scenario in process, without ROS: the same instrument and law, the same bytes as the lockstep run over topics."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress

from . import signals
from .control import Controller
from .errors import ParameterError
from .instrument import Block, Instrument, ScoreSummary
from .parameters import ControllerParameters, SimParameters

_BLOCK_SAMPLES = 65536
_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Simulation:
    """A finished run: n control ticks, m detector samples, SI units."""

    parameters: SimParameters
    time: _Array  # (n,) simulated time of the ticks [s]
    measurements: _Array  # (n, MEASUREMENT_SIZE), order of afm_model.signals
    drives: _Array  # (n, 3) drive applied from each tick on [V]
    time_samples: _Array  # (m,) [s]
    samples: _Array  # (CHANNELS, m): deflection [V], lateral force [V], lateral force y [N], normal force [N]
    score: ScoreSummary
    trajectory_sha256: str

    @property
    def position(self) -> _Array:
        """Scanner position (n, 3) [m]."""
        return self.measurements[:, signals.POSITION : signals.POSITION + 3]

    @property
    def velocity(self) -> _Array:
        """Scanner velocity (n, 3) [m/s]."""
        return self.measurements[:, signals.VELOCITY : signals.VELOCITY + 3]

    @property
    def reference(self) -> _Array:
        """Reference: x, y of the scanner, z of the tip (n, 3) [m]."""
        return self.measurements[:, signals.REFERENCE_POSITION : signals.REFERENCE_POSITION + 3]

    @property
    def deflection(self) -> _Array:
        """Cantilever deflection at the ticks (n,) [m]."""
        return self.measurements[:, signals.DEFLECTION]

    @property
    def lateral_force(self) -> _Array:
        """Lateral force x at the ticks (n,) [N]."""
        return self.measurements[:, signals.LATERAL_FORCE]


def simulate(
    parameters: SimParameters,
    controller: ControllerParameters | Controller,
    *,
    progress: bool | Callable[[int, int], None] = False,
) -> Simulation:
    """Run the instrument with a law for `parameters.run.duration`, in lockstep.

    Parameters
    ----------
    parameters : SimParameters
    controller : ControllerParameters or an object with `answer(measurement) -> drive`
    progress : bool or callable
        True: show a bar on the terminal while a run takes longer than a moment. A callable is called now and then with
        ticks done and ticks in all.

    Returns
    -------
    Simulation

    Raises
    ------
    ParameterError
        If the duration is not positive, or the tip does not touch the sample at rest.
    DriveError
        If the law answers with a NaN or an infinity.
    """
    total = ticks_to_simulate(parameters)
    law = Controller(controller) if isinstance(controller, ControllerParameters) else controller
    samples_per_tick = round(parameters.plant.control_period / parameters.detector.sample_period)
    instrument = Instrument(parameters, max(1, min(total, _BLOCK_SAMPLES // samples_per_tick)))
    blocks: list[Block] = []
    with reporting(progress, "simulating") as report:
        while instrument.ticks < total:
            # Our own law is a kernel too: no Python between the ticks.
            if type(law) is Controller:
                instrument.close_loop(law.constants, total - instrument.ticks)
            else:
                instrument.tick(law.answer(instrument.measurement))
            if instrument.block_full or instrument.ticks == total:
                blocks.append(instrument.take_block())
                report(instrument.ticks, total)
    samples = np.concatenate([block.samples for block in blocks], axis=1)
    return Simulation(
        parameters=parameters,
        time=np.arange(total, dtype=np.float64) * parameters.plant.control_period,
        measurements=np.concatenate([block.measurements for block in blocks]),
        drives=np.concatenate([block.drives for block in blocks]),
        time_samples=np.arange(samples.shape[1], dtype=np.float64) * parameters.detector.sample_period,
        samples=samples,
        score=instrument.score(),
        trajectory_sha256=instrument.trajectory_sha256(),
    )


def ticks_to_simulate(parameters: SimParameters) -> int:
    """Control ticks of a run; ParameterError if it is endless."""
    if parameters.total_ticks == 0:
        raise ParameterError("run.duration = 0 s is not allowed in a simulation: it must be > 0 s")
    return parameters.total_ticks


@contextmanager
def reporting(progress: bool | Callable[[int, int], None], what: str) -> Iterator[Callable[[int, int], None]]:
    """What to tell the progress to: done, in all."""
    if callable(progress):
        yield progress
    elif not progress:
        yield lambda done, total: None
    else:
        with Progress(console=Console(stderr=True), transient=True) as bar:
            task = bar.add_task(what, total=None)
            yield lambda done, total: bar.update(task, completed=done, total=total, refresh=True)
