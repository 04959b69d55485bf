"""One run of a comparison, in a worker: score, chatter, energy, force on the tip, margin."""

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..core.errors import LawError, ParameterError, PartError
from ..instrument import Block, Instrument
from ..lanes.together import REFUSALS, run_together
from ..parameters import ControllerParameters, SimParameters
from ..run.simulation import run
from ..run.verdict import limited
from .linear import linearise
from .linear_model import LinearError, nominal_friction
from .unranked import unranked

_Array = NDArray[np.float64]
NUMBERS = ("error_max", "error_rms", "chatter", "energy", "tip_force", "contact", "margin", "z_rms")
"""Columns of a run."""
FAILURES = (*REFUSALS, LawError)
"""Errors that end a run and are reported by a message in its row."""
_BLOCK_TICKS = 512
_FREQUENCIES = 400
"""At which the distance of the open loop from -1 is looked at, up to half the control frequency."""


class Trial(NamedTuple):
    """One run of a comparison."""

    sim: SimParameters
    controller: ControllerParameters | None
    """None: the law is no part, `begin` begins it."""
    kind: str
    told: SimParameters | None = None
    """The instrument with which the loop is linearised; None: it is not."""
    begin: Callable[[], AbstractContextManager[Any]] = nullcontext
    """Gives an object with `answer(measurement)` for this run."""


class Drives:
    """Sums over the scored part of a run: the square of the drive, and how far a smooth one would go.

    The smooth drive is that of the free scanner inverted along the reference, with the friction of a flat sample along
    it: what no law can do without.
    """

    def __init__(self, sim: SimParameters) -> None:
        self._start = sim.score_start - 0.5 * sim.plant.control_period
        self._period = sim.plant.control_period
        scanner, piezo = sim.scanner, sim.piezo
        self._omega = 2.0 * math.pi * np.array(scanner.frequencies[:2])
        self._xi = np.array([scanner.xi_x, scanner.xi_y])
        self._per_volt = self._omega**2 * np.array(piezo.sensitivities[:2])  # [m/s^2/V]
        self._friction = np.linalg.norm(nominal_friction(sim)) * sim.scales.w0**2 * sim.scales.x0  # [m/s^2]
        self._last: _Array | None = None
        self.smooth_variation = self.square = 0.0
        self.ticks = 0

    def take(self, block: Block) -> None:
        """Count a block."""
        ticks = block.first_tick + np.arange(len(block.drives))
        scored = ticks * self._period >= self._start
        if not scored.any():
            return
        drive, y = block.drives[scored, :2], block.measurements[scored]
        r, v, a = (y[f"reference_{name}"][:, :2] for name in ("position", "velocity", "acceleration"))
        speed = np.linalg.norm(v, axis=1, keepdims=True)
        along = np.divide(v, speed, out=np.zeros_like(v), where=speed > 0.0)
        needed = a + 2.0 * self._xi * self._omega * v + self._omega**2 * r + self._friction * along
        smooth = needed / self._per_volt
        self.square += float(np.sum(drive**2))
        self.ticks += len(drive)
        if self._last is not None:
            smooth = np.vstack([self._last, smooth])
        self.smooth_variation += float(np.sum(np.abs(np.diff(smooth, axis=0))))
        self._last = smooth[-1:]


def run_trials(sets: Sequence[Trial], lanes: bool = True) -> list[dict[str, Any]]:
    """The numbers of many runs: those with laws that are parts together, then the others.

    Parameters
    ----------
    sets : sequence of Trial
    lanes : bool
        As of `compare`.

    Returns
    -------
    list of dict
        NUMBERS, `trajectory_sha256`, and `error` if it diverged, was refused or is `unranked`.
    """
    parts = [(each.sim, each.controller) for each in sets if each.controller is not None]
    drives = [Drives(sim) for sim, _ in parts]
    ends = iter(
        zip(
            run_together(
                parts, lambda number, block: drives[number].take(block), lanes=lanes, block_ticks=_BLOCK_TICKS
            ),
            drives,
            strict=True,
        )
    )
    return [_row(each, *(next(ends) if each.controller is not None else _run_object(each))) for each in sets]


def _run_object(given: Trial) -> tuple[Instrument | Exception, Drives]:
    """Run a law that is an object, or runs elsewhere: the instrument at the end, or why it has ended."""
    drives = Drives(given.sim)
    try:
        with given.begin() as law:
            return run(given.sim, law, drives.take, block_ticks=_BLOCK_TICKS), drives
    except FAILURES as error:
        return error, drives
    except (Exception, SystemExit) as error:
        # An object may raise anything; the other runs continue.
        return LawError(f"law {given.kind}: {type(error).__name__}: {error}"), drives


def _row(given: Trial, instrument: Instrument | Exception, drives: Drives) -> dict[str, Any]:
    sim, controller = given.sim, given.controller
    row: dict[str, Any] = {}
    if given.told is not None:
        row["margin"] = math.nan if controller is None else margin(given.told, controller)
    if isinstance(instrument, Exception):
        return row | {"error": str(instrument)}
    if sentence := limited(instrument):
        return row | {"error": sentence}
    score = instrument.score()
    if sentence := unranked(sim, score, controller):
        row["error"] = f"{sentence}: this run is not ranked"
    amplitude = max(abs(each) for each in sim.reference.amplitude[:2])
    # Of all drives that come into force, those between two ticks included.
    variation = float(np.sum(score.drive_total_variation[:2])) * score.ticks * sim.plant.control_period
    return row | {
        "error_max": 100.0 * float(np.max(score.max[:2])) / amplitude,
        "error_rms": 100.0 * float(np.max(score.rms[:2])) / amplitude,
        "chatter": variation / drives.smooth_variation if drives.smooth_variation > 0.0 else math.nan,
        "energy": drives.square / max(drives.ticks, 1),
        "tip_force": max(abs(force) for force in score.normal_force),
        "contact": score.contact_fraction,
        "z_rms": float(score.rms[2]),
        "trajectory_sha256": instrument.trajectory_sha256(),
    }


def margin(sim: SimParameters, controller: ControllerParameters) -> float:
    """Smallest distance of the open loop from -1 over all axes and frequencies; 0: unstable; NaN: no linear model."""
    try:
        loop = linearise(sim, controller)
    except (LinearError, ParameterError, PartError, ArithmeticError, np.linalg.LinAlgError):
        return math.nan
    if not loop.stable:
        return 0.0
    omega = np.pi / loop.period * np.geomspace(1e-4, 0.999, _FREQUENCIES)
    return loop.distance(omega)
