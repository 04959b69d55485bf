"""Many instruments in one compiled loop: the integration steps of all as vectors, whatever else a tick needs lane by
lane, with the very functions of an instrument alone (instrument/tick.py). Each lane has the bits of its run alone.
"""

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.cache import fingerprint
from ..compiled.jit import config, kernel, routine
from ..compiled.lanes import LANES, Lanes, Own, for_lanes
from ..compiled.records import Block, Record, numbers_at, place, pointer_at, record_at, size
from ..instrument.block import LoopState
from ..instrument.controller import Controller
from ..instrument.instrument import Instrument
from ..instrument.score import ScoreSums, count_step
from ..instrument.tick import DRAW_TICKS, MOVED, REFUSED, after_tick, begin_tick, command_tick, end_tick, sample
from ..parts.dispatch import step
from ..parts.header import BlockHeader
from ..parts.part import Plant, Sample
from ..parts.signals import Actuation, Setpoint, Surface, Truth

_PARTS = {"state": "plant_state", "ledger": "plant_ledger", "plant": "plant_constants", "sample": "sample_constants"}
"""Records of a lane, and where their numbers stand in an instrument."""
LEAST = 6
"""Fewer instruments are sooner done one by one."""


class Drawn(Record):
    """Random number of the plant in this tick."""

    value: float


class Tick(Record):
    """What else a lane's steps are made with."""

    begin: float  # of the tick [s]
    h: float  # integration step [s]
    period: float  # control period [s]


_FIXED: dict[str, type[Record]] = {
    "own": Own,
    "drive": Actuation,
    "asked": Setpoint,
    "asked_next": Setpoint,
    "truth": Truth,
    "drawn": Drawn,
    "tick": Tick,
    "score": ScoreSums,
    "surface": Surface,
}
"""In every block of lanes, in front; state and constants of plant and sample follow."""
_ENDS = np.cumsum([size(each) for each in _FIXED.values()])
_DRIVE, _ASKED, _NEXT, _TRUTH, _DRAWN, _TICK = (int(end) for end in _ENDS[:6])
_MARKED = place(Own, "marked")
_STATE = int(_ENDS[-1])
_DRIVES, _ASKS, _TRUTHS = size(Actuation), size(Setpoint), size(Truth)
_STEPS, _VARIATION, _EXTENT = (place(ScoreSums, name) for name in ("steps", "variation", "extent"))


@kernel
def _move(t: float, m: Any) -> None:
    """Make the plant's step of a lane, from time t [s] on."""
    m.plant_step(t, m.drive, m.drawn, m.plant, m.state, m)


@kernel
def _look(m: Any) -> None:
    """Write what is true in a lane."""
    m.plant_observe(m.plant, m.state, m.truth)


@kernel
def _take(m: Block, first: int, count: int, a: Block, at: int, lane: int) -> None:
    """Copy numbers of a block into a lane."""
    for i in range(count):
        a[(at + i) * LANES + lane] = m[first + i]


@kernel
def _give(m: Block, first: int, count: int, a: Block, at: int, lane: int) -> None:
    """Copy numbers of a lane into a block."""
    for i in range(count):
        m[first + i] = a[(at + i) * LANES + lane]


@routine
def _begin_all(a: Block, blocks: Block, laws: Block, outcomes: Block) -> bool:
    """Begin a tick in all lanes that run; whether it is scored."""
    scored = False
    for lane in range(len(blocks)):
        if outcomes[lane] != MOVED:
            continue
        m = numbers_at(blocks[lane], 1)
        if not command_tick(numbers_at(laws[lane], 1), m):
            outcomes[lane] = REFUSED
            continue
        if not begin_tick(m):
            outcomes[lane] = after_tick(REFUSED, m)
            continue
        g = record_at(m, 0, BlockHeader)
        c = record_at(m, g.loop, LoopState)
        scored = c.k >= c.score_tick
        _take(m, g.asked, _ASKS, a, _ASKED, lane)
        _take(m, g.asked_next, _ASKS, a, _NEXT, lane)
        a[_TICK * LANES + lane] = c.k * c.control_period
        _take(numbers_at(c.random, DRAW_TICKS * g.draws), c.draw * g.draws + g.disturbance, 1, a, _DRAWN, lane)
    return scored


@routine
def _sample_all(a: Block, blocks: Block, outcomes: Block, i: int) -> None:
    """See `sample`."""
    for lane in range(len(blocks)):
        if outcomes[lane] == MOVED:
            m = numbers_at(blocks[lane], 1)
            sample(m, i)
            _take(m, record_at(m, 0, BlockHeader).effective, _DRIVES, a, _DRIVE, lane)


@routine
def _store_all(a: Block, blocks: Block, outcomes: Block, state_size: int, ledger_size: int) -> None:
    """Copy what has moved into the blocks of the instruments."""
    for lane in range(len(blocks)):
        if outcomes[lane] == MOVED:
            m = numbers_at(blocks[lane], 1)
            g = record_at(m, 0, BlockHeader)
            _give(m, g.truth, _TRUTHS, a, _TRUTH, lane)
            _give(m, g.plant_state, state_size, a, _STATE, lane)
            _give(m, g.plant_ledger, ledger_size, a, _STATE + state_size, lane)


@routine
def _end_all(blocks: Block, outcomes: Block) -> bool:
    """End a tick in all lanes; whether all go on."""
    go_on = True
    for lane in range(len(blocks)):
        if outcomes[lane] == MOVED:
            m = numbers_at(blocks[lane], 1)
            outcomes[lane] = after_tick(end_tick(m), m)
        go_on = go_on and outcomes[lane] == MOVED
    return go_on


@kernel
def _step(m: Any, i: int, f: float) -> None:
    """Take integration step i of a tick, and evaluate what is true after it."""
    _move(m.tick.begin + i * m.tick.h, m)
    _look(m)


@kernel
def _scored_step(m: Any, i: int, f: float) -> None:
    """The same, counted; f: part of the control period that has passed at its end."""
    _move(m.tick.begin + i * m.tick.h, m)
    _look(m)
    count_step(m.score, m.truth, m.asked, m.asked_next, f, m.tick.period)


@kernel
def _try_step(m: Any, i: int, f: float) -> None:
    """Integration step i of a tick, in a lane that is not marked then."""
    m.own.marked = 0.0
    _move(m.tick.begin + i * m.tick.h, m)


@kernel
def _observe(m: Any, i: int, f: float) -> None:
    _look(m)


@kernel
def _scored_observe(m: Any, i: int, f: float) -> None:
    _look(m)
    count_step(m.score, m.truth, m.asked, m.asked_next, f, m.tick.period)


_step_all, _score_all = for_lanes(_step), for_lanes(_scored_step)
_try_all, _observe_all, _count_all = for_lanes(_try_step), for_lanes(_observe), for_lanes(_scored_observe)


@routine
def _step_marked(a: Block, blocks: Block, outcomes: Block, i: int, state_size: int, ledger_size: int) -> None:
    """The same by the routine of an instrument alone, in the lanes that are marked."""
    for lane in range(len(blocks)):
        if a[_MARKED * LANES + lane] == 0.0 or outcomes[lane] != MOVED:
            continue
        m = numbers_at(blocks[lane], 1)
        g = record_at(m, 0, BlockHeader)
        c = record_at(m, g.loop, LoopState)
        _give(m, g.plant_state, state_size, a, _STATE, lane)
        _give(m, g.plant_ledger, ledger_size, a, _STATE + state_size, lane)
        disturbance = pointer_at(numbers_at(c.random, DRAW_TICKS * g.draws), c.draw * g.draws + g.disturbance)
        h = c.control_period / c.substeps
        step(c.k * c.control_period + i * h, record_at(m, g.effective, Actuation), disturbance, m)
        _take(m, g.plant_state, state_size, a, _STATE, lane)
        _take(m, g.plant_ledger, ledger_size, a, _STATE + state_size, lane)


@routine
def _steps(
    lanes: Any,
    a: Block,
    blocks: Block,
    outcomes: Block,
    first: int,
    count: int,
    substeps: int,
    scored: bool,
    sizes: Any,
) -> None:
    """Integration steps of all lanes, from number `first` of the tick on; of those that do not run as well."""
    for i in range(first, first + count):
        if lanes.marks:
            _try_all(lanes, a, i, 0.0)
            _step_marked(a, blocks, outcomes, i, sizes[0], sizes[1])
            if scored:
                _count_all(lanes, a, i, (i + 1) / substeps)
            else:
                _observe_all(lanes, a, i, 0.0)
        elif scored:
            _score_all(lanes, a, i, (i + 1) / substeps)
        else:
            _step_all(lanes, a, i, 0.0)


@routine
def _advance(
    lanes: Any,
    a: Block,
    blocks: Block,
    laws: Block,
    outcomes: Block,
    ticks: int,
    substeps: int,
    stride: int,
    sizes: Any,
) -> None:
    """Up to `ticks` control ticks of all lanes, fewer if one of them does not go on; sizes of state and ledger."""
    for _ in range(ticks):
        scored = _begin_all(a, blocks, laws, outcomes)
        for first in range(0, substeps, stride):
            _sample_all(a, blocks, outcomes, first)
            _steps(lanes, a, blocks, outcomes, first, stride, substeps, scored, sizes)
            _store_all(a, blocks, outcomes, sizes[0], sizes[1])
        if not _end_all(blocks, outcomes):
            return


def composition(instrument: Instrument) -> Hashable | None:
    """Instruments of one composition run in lanes; None: this one cannot."""
    plant, sample = instrument.part("plant"), instrument.part("sample")
    if config.DISABLE_JIT or not (plant.lanes and sample.lanes) or instrument.has_faults:
        return None
    loop, common = instrument.record("loop"), plant.common(instrument.record("plant_constants"))
    if common is None or instrument.part("onboard").excites:
        return None
    choices = tuple((name, float(value)) for name, value in common.items())
    stride = loop.substeps if loop.quiet else loop.stride
    return plant, sample, choices, int(loop.substeps), int(stride), int(loop.score_tick)


_KNOWN: dict[Any, Lanes] = {}


def _lanes_of(plant: Plant, sample: Sample, choices: tuple[tuple[str, float], ...]) -> Lanes:
    """What is compiled once for all instruments with these parts."""
    key = plant, sample, choices
    if key not in _KNOWN:
        functions: dict[str, Any] = {
            "plant_step": plant.step,
            "plant_observe": plant.observe,
            "sample_surface": sample.surface,
        }
        # By name and sources: what has been compiled is found again by them.
        made = [
            f"{each.__module__}.{each.__name__} {fingerprint(each.__module__, each.__code__.co_filename)[:16]}"
            for each in (function.py_func for function in functions.values())
        ]
        fixed = {f"plant.{name}": value for name, value in choices}
        fixed |= {"drive.amplitude": 0.0, "drive.second_amplitude": 0.0}
        records = _FIXED | {"state": plant.state, "ledger": plant.ledger}
        records |= {"plant": plant.constants, "sample": sample.constants}
        _KNOWN[key] = Lanes(f"{', '.join(made)}, {fixed}", records, functions, fixed, plant.marks)
    return _KNOWN[key]


class Together:
    """Up to LANES instruments of one composition, each with its law.

    Parameters
    ----------
    instruments : sequence of Instrument
    controllers : sequence of Controller
    """

    def __init__(self, instruments: Sequence[Instrument], controllers: Sequence[Controller]) -> None:
        self.instruments, self.controllers = list(instruments), controllers
        kind: Any = composition(instruments[0])
        self._lanes = _lanes_of(*kind[:3])
        self._substeps, self._stride = kind[3:5]
        self._block = np.zeros(self._lanes.size * LANES)
        self._numbers = self._block.reshape(-1, LANES)
        self._filled: list[int] = []  # whose numbers are in the block

    def _copied(self, name: str, lane: int) -> NDArray[np.float64]:
        at = self._lanes.places[name]
        return self._numbers[at : at + size(self._lanes.records[name]), lane]

    def exchange(self, lane: int, instrument: Instrument) -> None:
        """Put another instrument, or one that was ticked elsewhere, in the place of one."""
        self.instruments[lane] = instrument
        self._filled = []

    def _fill(self, lanes: Sequence[int]) -> None:
        """Copy the numbers of some instruments into the block."""
        chosen = [self.instruments[lane] for lane in lanes]
        for i in range(LANES):
            # Lanes without an instrument have the numbers of another.
            instrument = chosen[i if i < len(chosen) else 0]
            for name, there in _PARTS.items():
                self._copied(name, i)[:] = instrument.numbers(there)
            header = record_at(numbers_at(instrument.address, size(BlockHeader)), 0, BlockHeader)
            self._copied("own", i)[:2].view(np.int64)[:] = instrument.address, header.plant_map
            for name in ("truth", "score"):
                self._copied(name, i)[:] = instrument.numbers(name)
            loop = instrument.record("loop")
            self._copied("tick", i)[:] = 0.0, loop.control_period / loop.substeps, loop.control_period
        self._addresses = np.array([instrument.address for instrument in chosen])
        self._laws = np.array([self.controllers[lane].block.ctypes.data for lane in lanes])
        # Ticks and variation of the drive are counted in the block of the instrument.
        pairs = [(instrument.numbers("score"), self._copied("score", i)) for i, instrument in enumerate(chosen)]
        self._sums = [
            (sums[part], counted[part])
            for sums, counted in pairs
            for part in (slice(_STEPS, _VARIATION), slice(_EXTENT, None))
        ]

    def close_loop(self, lanes: Sequence[int], ticks: Sequence[int]) -> list[int]:
        """Close the loop of some of the instruments, given by their numbers, for so many ticks each or fewer.

        The outcome of each, as `advance` returns it: to be given to `Instrument.ended` of that instrument, and of each.
        """
        if self._filled != list(lanes):
            self._fill(lanes)
            self._filled = list(lanes)
        least = min(self.instruments[lane].due(each) for lane, each in zip(lanes, ticks, strict=True))
        outcomes = np.full(len(lanes), MOVED)
        _advance(
            *(self._lanes, self._block, self._addresses, self._laws, outcomes, least),
            *(self._substeps, self._stride, (size(self._lanes.records["state"]), size(self._lanes.records["ledger"]))),
        )
        for sums, counted in self._sums:
            sums[:] = counted
        return outcomes.tolist()
