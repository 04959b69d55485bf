"""The virtual instrument: measurement out, drive in, tick by tick, with no clock and no transport of its own."""

import hashlib
import math
import sys
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import signals
from ..errors import ParameterError
from ..parameters import InstrumentParameters
from ..plant import plant_constants, rest, state
from . import tally
from .constants import RECORD, instrument_constants
from .tick import (
    APPLIED,
    COMMANDED,
    DIVERGED,
    MEASUREMENT,
    PENDING,
    RANDOM,
    RANGE,
    REFUSED,
    ROW,
    STATE,
    TALLY,
    close_loop,
    measure,
    tick,
)

_Array = NDArray[np.float64]
_DRAW_TICKS = 256
"""Random numbers are drawn for so many ticks at a time, wherever blocks are taken: a run depends on its seed alone."""


class DivergenceError(RuntimeError):
    """The motion has left every scanner's range; the message tells when and what to change."""


class DriveError(ValueError):
    """A drive that no piezo can follow; the message names the axis, the value and what is allowed."""


@dataclass(frozen=True)
class Block:
    """A stretch of consecutive control ticks, as recorded."""

    first_tick: int
    measurements: _Array  # (ticks, MEASUREMENT_SIZE), order of afm_model.signals
    drives: _Array  # (ticks, 3) [V], applied from each tick on
    first_sample: int
    samples: _Array  # (CHANNELS, samples): deflection [V], lateral force [V], lateral force y [N], normal force [N]


class Instrument:
    """The microscope between two control ticks.

    Usage: read `measurement`, decide on a drive, call `tick`; when `block_full`, call `take_block`. `measurement` is
    one array that every tick overwrites: copy what you keep.

    Parameters
    ----------
    parameters : InstrumentParameters
    block_ticks : int
        Control ticks in a block.
    hashed : bool
        False: no `trajectory_sha256`, which takes a tenth of the time of a tick of two steps.

    Raises
    ------
    ParameterError
        If the tip does not touch the sample at rest, or the piezo's range does not reach to there.
    """

    def __init__(self, parameters: InstrumentParameters, block_ticks: int = 500, *, hashed: bool = True) -> None:
        self.parameters = parameters
        self._hashed = hashed
        try:
            self._plant = plant_constants(parameters, parameters.plant.dt)
            self._instrument = instrument_constants(parameters)
        except ArithmeticError as error:
            raise ParameterError(f"some parameter is too large or too small to compute with ({error})") from None
        self._block_ticks = block_ticks
        self.samples_per_tick = round(parameters.plant.control_period / parameters.detector.sample_period)
        self._rows = np.zeros((block_ticks, ROW))
        self._samples = np.zeros((signals.CHANNELS, block_ticks * self.samples_per_tick))
        self._random = np.zeros((_DRAW_TICKS, RANDOM + 2 * self.samples_per_tick))
        self._constants = np.concatenate([self._plant, self._instrument])
        self._registers = np.zeros(PENDING + 3 * parameters.plant.delay_ticks)
        self._state = self._registers[STATE:MEASUREMENT]
        self._commanded = self._registers[COMMANDED : COMMANDED + 3]
        self.measurement = self._registers[MEASUREMENT:COMMANDED]
        self.reset()

    def reset(self) -> None:
        """Return to the start: at rest, in contact, tick 0, the same random numbers again."""
        parameters = self.parameters
        # One stream for each source: to switch one on changes no other.
        seeds = np.random.SeedSequence(parameters.plant.seed).spawn(3)
        self._disturbance, self._noise, self._position_noise = map(np.random.default_rng, seeds)
        self._registers[:] = 0.0
        z_r = parameters.reference.z_r / parameters.scales.z0
        self._state[:], u_z = rest(self._plant, z_r, drawn=self._drawn_at_random)
        applied = self._registers[APPLIED : APPLIED + 3]
        applied[2] = u_z / self._instrument.view(RECORD)[0].gain_z
        limit = parameters.piezo.limit
        if 0.0 < limit < abs(applied[2]):
            raise ParameterError(
                f"piezo.limit = {limit:g} V is not allowed: to hold the tip at reference.z_r = "
                f"{parameters.reference.z_r:g} m takes {applied[2]:.4g} V"
            )
        self._registers[PENDING:].reshape(-1, 3)[:] = applied
        self._hash = hashlib.sha256()
        self.ticks = self._drawn = 0
        self._row = 0
        noise, position_noise = self._noise.standard_normal(2), self._position_noise.standard_normal(3)
        measure(self._state, self._instrument, 0, applied, noise, position_noise, self.measurement)

    @property
    def _drawn_at_random(self) -> bool:
        """Whether f_z is drawn, section 4.2 of the paper."""
        return self.parameters.plant.kind == "paper" and self.parameters.plant.z == "uniform"

    @property
    def time(self) -> float:
        """Simulated time of the next control tick [s]."""
        return self.ticks * self.parameters.plant.control_period

    @property
    def state(self) -> _Array:
        """Copy of the state, (SIZE,), in the order of `afm_model.plant.state`."""
        return self._state.copy()

    @property
    def in_contact(self) -> bool:
        """Whether the tip touches the sample."""
        return bool(self._state[state.CONTACT] != 0.0)

    @property
    def block_full(self) -> bool:
        """Whether the block must be taken before the next tick."""
        return self._row == self._block_ticks

    def tick(self, drive: _Array) -> None:
        """Apply `drive` [V], (3,), for one control period; `measurement` is then that of the next tick.

        With plant.delay_ticks it is applied so many ticks later, and now the one of so many ticks ago.

        Raises
        ------
        DriveError
            If it is not three numbers, or a component is NaN or infinite; nothing has moved then.
        DivergenceError
            If the position is beyond RANGE: the loop is unstable, or the step is too coarse for this contact.
        RuntimeError
            If the block is full.
        """
        self._prepare()
        if getattr(drive, "shape", None) != (3,) and np.shape(drive) != (3,):
            raise DriveError(f"drive {drive} is not allowed: it must be three voltages")
        # Whatever kind of array came, the kernel always gets the same one: another kind would compile it anew.
        self._commanded[:] = drive
        outcome = tick(
            self.ticks,
            self._row,
            self.ticks % _DRAW_TICKS,
            self._constants,
            self._registers,
            self._random,
            self._rows,
            self._samples,
        )
        self._conclude(outcome, 0 if outcome == REFUSED else 1)

    def close_loop(self, law: _Array, ticks: int) -> None:
        """Close the loop with `law` for `ticks` ticks, or to the end of the block: `tick` many times, in one piece.

        Parameters
        ----------
        law : ndarray
            Constants of a law, from `afm_model.Controller.constants`.
        ticks : int

        Raises
        ------
        DriveError, DivergenceError, RuntimeError
            As `tick` does.
        """
        end = self.ticks + min(ticks, max(self._block_ticks - self._row, 1))
        while self.ticks < end:
            self._prepare()
            outcome, done = close_loop(
                law,
                min(end, self._drawn) - self.ticks,
                self.ticks,
                self._row,
                self.ticks % _DRAW_TICKS,
                self._constants,
                self._registers,
                self._random,
                self._rows,
                self._samples,
            )
            self._conclude(outcome, done)

    def _prepare(self) -> None:
        """What a tick needs: a row in the block, random numbers."""
        if self._row == self._block_ticks:
            raise RuntimeError("the block is full: call take_block before the next tick")
        if self.ticks == self._drawn:
            self._draw()

    def _conclude(self, outcome: int, done: int) -> None:
        """Count the ticks done and report what the last one came to."""
        self.ticks += done
        self._row += done
        if outcome == REFUSED:
            raise DriveError(_describe(self._commanded))
        if outcome == DIVERGED:
            raise DivergenceError(
                f"the motion diverged (beyond {RANGE:g} m) at {self.time:g} s under a drive of {self._commanded} V: "
                f"the loop is unstable, or plant.dt = {self.parameters.plant.dt:g} s is too long"
            )

    def take_block(self) -> Block:
        """The ticks since the last call, at any time; a block may hold fewer ticks than a full one, or none."""
        rows = self._row
        first = self.ticks - rows
        block = Block(
            first_tick=first,
            measurements=self._rows[:rows, MEASUREMENT:COMMANDED].copy(),
            drives=self._rows[:rows, COMMANDED:].copy(),
            first_sample=first * self.samples_per_tick,
            samples=self._samples[:, : rows * self.samples_per_tick].copy(),
        )
        self.skip_block()
        return block

    def skip_block(self) -> None:
        """Forget the ticks since the last block: where nobody wants them, `take_block` without the copies."""
        if self._hashed:
            self._hash.update(self._rows[: self._row, STATE:MEASUREMENT].tobytes())
        self._row = 0

    def trajectory_sha256(self) -> str:
        """SHA-256 over the bytes of the state at every tick up to now, this one included."""
        if not self._hashed:
            raise RuntimeError("this instrument was made with hashed=False")
        digest = self._hash.copy()
        digest.update(self._rows[: self._row, STATE:MEASUREMENT].tobytes())
        digest.update(self._state.tobytes())
        return digest.hexdigest()

    def score(self) -> tally.ScoreSummary:
        """Score of the run up to now."""
        return tally.summarize(self._registers[TALLY:PENDING], self.parameters)

    def _draw(self) -> None:
        """Random numbers for the next ticks. What is off is not drawn and stays zero."""
        parameters = self.parameters
        uniform = self._drawn_at_random
        if uniform:
            self._random[:, 0] = self._disturbance.uniform(-parameters.plant.M_z, parameters.plant.M_z, _DRAW_TICKS)
        if parameters.detector.noise > 0.0:
            self._random[:, RANDOM:] = self._noise.standard_normal((_DRAW_TICKS, 2 * self.samples_per_tick))
        if parameters.detector.position_noise > 0.0:
            self._random[:, 1:RANDOM] = self._position_noise.standard_normal((_DRAW_TICKS, 3))
        anything = uniform or parameters.detector.noise > 0.0 or parameters.detector.position_noise > 0.0
        # Zeros last for ever.
        self._drawn = self._drawn + _DRAW_TICKS if anything else sys.maxsize


def _describe(drive: _Array) -> str:
    bad = ", ".join(f"{axis} = {value} V" for axis, value in zip("xyz", drive, strict=True) if not math.isfinite(value))
    return f"drive {bad} is not allowed: every voltage must be a finite number"
