"""What each tick brought, handed on in blocks, and the wall times of the ticks."""

import math
from array import array
from collections import deque
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..instrument import Block, Cut, Instrument
from .timing import DelayLog, Delays

BlockListener = Callable[[Block, NDArray[np.float32]], None]
"""Called with a block and the round trips of its ticks [s], (ticks,); NaN where no drive arrived."""

_MOST_WAITING = 30
"""Pieces of work that wait at most: a run that leaves no time for them has to take it."""


class Blocks:
    """What an instrument has recorded.

    Parameters
    ----------
    instrument : Instrument
        Another one may be assigned, at its start.
    on_block : BlockListener or None
        None: nobody wants the blocks.
    in_pieces : bool
        A full block is handed on in pieces by `do_one`; False: at once.
    """

    def __init__(self, instrument: Instrument, on_block: BlockListener | None, *, in_pieces: bool = False) -> None:
        self.instrument = instrument
        self._on_block = on_block
        self._delays = DelayLog()
        self.round_trips = array("d")
        """Wall times of the ticks since the last block [s], noted before each tick; NaN without a measurement."""
        self._doubtful: list[int] = []
        self._in_pieces = in_pieces
        self._waiting: deque[Callable[[], None]] = deque()

    def warm_up(self) -> None:
        """Compile or load what counts wall times."""
        self._delays.count(np.zeros(1, np.float32), np.zeros(1), np.zeros(1))

    def reset(self) -> None:
        """Begin again with the instrument. What has not been handed on is lost: see `flush`."""
        self._delays.reset()
        self.round_trips = array("d")
        self._doubtful.clear()
        self._waiting.clear()

    def note_delay(self, lateness: float, command_age: float) -> None:
        """Note in realtime how late a tick is, and the age of the measurement of its drive [s]; before the tick."""
        self._delays.note(lateness, command_age)

    def doubt_next(self) -> None:
        """Leave the round trip of the next tick out of the summary: it is recorded, but it holds more than that."""
        self._doubtful.append(len(self.round_trips))

    def flush(self) -> None:
        """Hand on all ticks up to now."""
        self._cut()
        while self.do_one():
            pass

    def end_block(self) -> None:
        """Hand on the ticks since the last block, if there are any, at once or in pieces."""
        if not self._in_pieces:
            self.flush()
            return
        self._cut()
        while len(self._waiting) > _MOST_WAITING:
            self.do_one()

    def do_one(self) -> bool:
        """Do a piece of the work on blocks that have ended, some 10 us of it; False without such work."""
        if not self._waiting:
            return False
        self._waiting.popleft()()
        return True

    def _cut(self) -> None:
        """Set aside the ticks since the last block."""
        ticks = self.instrument.recorded_ticks
        if not ticks:
            return
        noted, self.round_trips = np.frombuffer(self.round_trips), array("d")
        if self._on_block is None:
            self.instrument.skip_block()
            return
        round_trips = np.full(ticks, math.nan, np.float32)
        round_trips[: noted.size] = noted[:ticks]
        counted = round_trips
        if self._doubtful:
            counted = round_trips.copy()
            counted[[i for i in self._doubtful if i < ticks]] = math.nan
            self._doubtful = [0] if ticks in self._doubtful else []
        self._waiting += (
            partial(self._delays.count, counted, *self._delays.take()),
            self.instrument.hash_cut,
            partial(self._hand_on, self._on_block, self.instrument.cut_block(), round_trips),
        )

    def _hand_on(self, on_block: BlockListener, cut: Cut, round_trips: NDArray[np.float32]) -> None:
        on_block(self.instrument.block_of(cut), round_trips)

    @property
    def oldest_command(self) -> float:
        """Largest age of a command up to the last block [s]."""
        return self._delays.oldest_command

    def delays(self) -> Delays:
        """Wall times of the ticks handed on up to now."""
        return self._delays.summary()
