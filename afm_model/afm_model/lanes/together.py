"""Many runs in one process: those of one composition in lanes, the others one by one, each with the bits of `run`."""

import itertools
from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from functools import partial
from typing import Any

from ..compiled.lanes import LANES
from ..core.errors import DivergenceError, DriveError, ParameterError, PartError
from ..instrument import Block, Instrument
from ..instrument.block import Layouts
from ..parameters import ControllerParameters, SimParameters
from ..run.engine import Engine
from ..run.simulation import RunEvent, engine_of
from ..run.state import OVER
from .loop import LEAST, Together, composition

REFUSALS = (ParameterError, PartError, DriveError, DivergenceError)
"""What ends one run among many and not the others."""


def run_together(
    sets: Sequence[tuple[SimParameters, ControllerParameters]],
    take: Callable[[int, Block], object] | None = None,
    on_event: Callable[[int, RunEvent], object] | None = None,
    *,
    lanes: bool = True,
    block_ticks: int | None = None,
    hashed: bool = True,
    sampled: bool = False,
) -> list[Instrument | Exception]:
    """Run many sets of parameters; of each the instrument at its end, or the error that has ended it.

    Parameters
    ----------
    sets : sequence of (SimParameters, ControllerParameters)
        In memory at once: some megabytes each, without faults hardly any of it touched.
    take, on_event : callable, optional
        As of `run`, with the number of the set.
    lanes : bool
        False: one by one.
    block_ticks, hashed
        As of `run`.
    sampled : bool
        False: the samples of the blocks are not looked at, see `Instrument`.
    """
    found: list[Engine | Exception] = []
    groups: dict[Hashable, list[Engine]] = {}
    # Of instruments that are needed more than once, with one law after the other.
    times = Counter(id(parameters) for parameters, _ in sets)
    layouts: Layouts = {}
    for number, (parameters, law) in enumerate(sets):
        try:
            engine = engine_of(
                parameters,
                law,
                None if take is None else partial(take, number),
                on_event=None if on_event is None else partial(on_event, number),
                block_ticks=block_ticks,
                hashed=hashed,
                sampled=sampled,
                layouts=layouts if times[id(parameters)] > 1 else None,
            )
        except REFUSALS as error:
            found.append(error)
            continue
        found.append(engine)
        kind = composition(engine.instrument) if lanes else None
        groups.setdefault(number if kind is None else kind, []).append(engine)
    for engines in groups.values():
        for first in range(0, len(engines), LANES):
            _run_group(engines[first : first + LANES])
    ends = [each if isinstance(each, Exception) else each.error or each.instrument for each in found]
    for engine in itertools.chain(*groups.values()):
        # It and its parts know one another, and would stay, each with its instrument, until Python looks for cycles.
        vars(engine).clear()
    return ends


def _run_group(engines: Sequence[Engine]) -> None:
    """Run engines of one composition to their ends: together as long as they are enough."""
    for engine in engines:
        engine.step()  # Starts.
    laws: list[Any] = [engine.pacing.law for engine in engines]
    together = Together([engine.instrument for engine in engines], laws) if len(engines) >= LEAST else None
    while together is not None:
        running = [i for i, engine in enumerate(engines) if engine.state not in OVER]
        if len(running) < LEAST:
            break
        outcomes = together.close_loop(running, [engines[i].wanted for i in running])
        for i, outcome in zip(running, outcomes, strict=True):
            engines[i].step(partial(engines[i].instrument.ended, laws[i], outcome))
    for engine in engines:
        while engine.state not in OVER:
            engine.step()
