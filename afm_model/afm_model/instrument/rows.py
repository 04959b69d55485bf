"""What is recorded of the ticks: the block that grows, blocks cut off it, and the hash over all of them."""

import hashlib
from collections import deque
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled.records import size
from ..parts.signals import Measurement

_Array = NDArray[np.float64]


@dataclass(frozen=True)
class Block:
    """A stretch of consecutive control ticks, as recorded. Fields of records by name: `measurements["position"]`."""

    first_tick: int
    measurements: NDArray[Any]  # (ticks,) records of afm_model.parts.signals.Measurement
    drives: _Array  # (ticks, 3) [V], applied from each tick on
    first_sample: int
    samples: _Array  # (channels, samples), in the order of Instrument.channels; times Channel.scale in SI units
    states: _Array  # (ticks, numbers): of the parts, at each tick; see Instrument.truth


class Cut(NamedTuple):
    """Ticks as the compiled loop has left them; `Rows.block` makes a block of them."""

    first_tick: int
    rows: _Array
    samples: _Array


class Rows:
    """The block that ticks are recorded in.

    Parameters
    ----------
    ticks : int
        Of a full block.
    state_size : int
        Numbers of the states of all parts.
    channels, samples_per_tick : int
    hashed : bool
        Whether `digest` is wanted.
    """

    def __init__(self, ticks: int, state_size: int, channels: int, samples_per_tick: int, *, hashed: bool) -> None:
        self._state_size, self._samples_per_tick, self._hashed = state_size, samples_per_tick, hashed
        self.rows = np.zeros((ticks, state_size + size(Measurement) + 3))
        """(ticks, numbers): states, measurement and drive of each tick; another array after each `cut`."""
        self.samples = np.zeros((channels, ticks * samples_per_tick))
        """(channels, samples)."""
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._hash = hashlib.sha256()
        self._not_hashed: deque[_Array] = deque()

    def cut(self, first_tick: int, ticks: int) -> Cut:
        """Take what was recorded, `ticks` from `first_tick` on, and begin a new block: some microseconds."""
        cut = Cut(first_tick, self.rows[:ticks], self.samples[:, : ticks * self._samples_per_tick])
        if 2 * ticks < len(self.rows):
            # A few ticks must not keep the memory of many.
            cut = Cut(first_tick, cut.rows.copy(), cut.samples.copy())
        else:
            self.rows, self.samples = np.empty_like(self.rows), np.empty_like(self.samples)
        if self._hashed:
            self._not_hashed.append(cut.rows)
        return cut

    def hash_cut(self) -> None:
        """Hash what was cut off and is not hashed yet."""
        while self._not_hashed:
            self._hash.update(self._states(self._not_hashed.popleft()))

    def skip(self, ticks: int) -> None:
        """Hash what was recorded, and record over it."""
        if self._hashed:
            self.hash_cut()
            self._hash.update(self._states(self.rows[:ticks]))

    def digest(self, ticks: int, state: _Array) -> str:
        """SHA-256 of all states up to now: those cut off, those of `ticks` more, and the present one.

        Raises
        ------
        RuntimeError
            If no hash was wanted.
        """
        if not self._hashed:
            raise RuntimeError("this instrument was made with hashed=False")
        self.hash_cut()
        digest = self._hash.copy()
        digest.update(self._states(self.rows[:ticks]))
        digest.update(state.tobytes())
        return digest.hexdigest()

    def _states(self, rows: _Array) -> bytes:
        return rows[:, : self._state_size].tobytes()

    def block(self, cut: Cut) -> Block:
        """A block of what was cut off."""
        end = cut.rows.shape[1] - 3
        measurements = np.ascontiguousarray(cut.rows[:, self._state_size : end]).view(Measurement)
        return Block(
            first_tick=cut.first_tick,
            measurements=measurements.reshape(len(cut.rows)).view(np.recarray),
            drives=cut.rows[:, end:],
            first_sample=cut.first_tick * self._samples_per_tick,
            samples=cut.samples,
            states=cut.rows[:, : self._state_size],
        )
