"""Ticks an instrument, keeps what each tick brought, and hands it on in blocks."""

import math
from array import array
from collections import deque
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..core.errors import DriveError
from ..instrument import Block, Cut, Instrument
from ..instrument.controller import Controller
from ..parts.command import Command
from .timing import DelayLog, Delays

_Array = NDArray[np.float64]
BlockListener = Callable[[Block, NDArray[np.float32]], None]
"""Called with a block and the round trips of its ticks [s], (ticks,); NaN where no drive arrived."""

_MOST_WAITING = 30
"""Pieces of work that wait at most: a run that leaves no time for them has to take it."""


class Ticker:
    """The instrument as the pacing sees it.

    Parameters
    ----------
    instrument : Instrument
    block_ticks : int
        Those of the instrument.
    total_ticks : int
        Ticks of the whole run; 0: endless.
    on_block : BlockListener
    on_stop : callable
        on_stop(): an order is done, or a limit has acted.
    in_pieces : bool
        A full block is handed on in pieces by `do_one`; False: at once.
    """

    def __init__(
        self,
        instrument: Instrument,
        block_ticks: int,
        total_ticks: int,
        on_block: BlockListener,
        *,
        in_pieces: bool = False,
        on_stop: Callable[[], None],
    ) -> None:
        self._instrument = instrument
        self._block_ticks = block_ticks
        self._total_ticks = total_ticks
        self._on_block, self._on_stop = on_block, on_stop
        self._delays = DelayLog()
        self._round_trips = array("d")
        self._doubtful: list[int] = []
        self._in_pieces = in_pieces
        self._waiting: deque[Callable[[], None]] = deque()
        self.note_delay = self._delays.note
        """note_delay(lateness, command_age): realtime, before `tick` [s]."""
        self._find_stop()

    def warm_up(self) -> None:
        """Compile or load what counts wall times."""
        self._delays.count(np.zeros(1, np.float32), np.zeros(1), np.zeros(1))

    def reset(self) -> None:
        """Return the instrument to the start. What has not been handed on is lost: see `flush`."""
        self._instrument.reset()
        self._delays.reset()
        self._round_trips = array("d")
        self._doubtful.clear()
        self._waiting.clear()
        self._find_stop()

    def tick(self, drive: _Array | Command | None, round_trip: float, sequence: int | None = None) -> bool:
        """Apply a drive for one tick; False if the run ends with it. For `sequence` see `Instrument.tick`.

        Raises
        ------
        DriveError, DivergenceError, PartError
            As `Instrument.tick` does.
        """
        self._round_trips.append(round_trip)
        try:
            stopped = self._instrument.tick(drive, sequence)
        except DriveError:
            self._round_trips.pop()
            raise
        return self._look(stopped)

    def _look(self, stopped: bool) -> bool:
        # One comparison for the end of a block and that of the run: at this rate each one is felt.
        if self._instrument.ticks == self._stop_at:
            self.end_block()
        if stopped:
            self._on_stop()
        return self._instrument.ticks != self._total_ticks

    def close_loop(self, controller: Controller, ticks: int) -> bool:
        """Close the loop with a law for `ticks` ticks in one piece, or less: to the end of a block at most.

        False if the run ends with them.

        Raises
        ------
        DriveError, DivergenceError, PartError
            As `Instrument.close_loop` does; the ticks made before are kept.
        """
        before = self._instrument.ticks
        try:
            stopped = self._instrument.close_loop(controller, min(ticks, self._stop_at - before))
        finally:
            self._round_trips.extend([math.nan] * (self._instrument.ticks - before))
        return self._look(stopped)

    def doubt_next(self) -> None:
        """Leave the round trip of the next tick out of the summary: it is recorded, but it holds more than that."""
        self._doubtful.append(len(self._round_trips))

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
        """Do a piece of the work on blocks that have ended, some 10 us of it; False if there is none."""
        if not self._waiting:
            return False
        self._waiting.popleft()()
        return True

    def _cut(self) -> None:
        """Set aside the ticks since the last block."""
        if self._round_trips:
            round_trips = np.frombuffer(self._round_trips).astype(np.float32)
            self._round_trips = array("d")
            counted = round_trips
            if self._doubtful:
                counted = round_trips.copy()
                counted[[i for i in self._doubtful if i < round_trips.size]] = math.nan
                self._doubtful = [0] if round_trips.size in self._doubtful else []
            self._waiting += (
                partial(self._delays.count, counted, *self._delays.take()),
                self._instrument.hash_cut,
                partial(self._hand_on, self._instrument.cut_block(), round_trips),
            )
        self._find_stop()

    def _hand_on(self, cut: Cut, round_trips: NDArray[np.float32]) -> None:
        self._on_block(self._instrument.block_of(cut), round_trips)

    def _find_stop(self) -> None:
        end = self._instrument.ticks + self._block_ticks
        self._stop_at = min(end, self._total_ticks) if self._total_ticks else end

    @property
    def oldest_command(self) -> float:
        """Largest age of a command up to the last block [s]."""
        return self._delays.oldest_command

    def delays(self) -> Delays:
        """Wall times of the ticks handed on up to now."""
        return self._delays.summary()
