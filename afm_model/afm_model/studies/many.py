"""Many instruments whose motion is wanted, not the score alone: labelled arrays over parameter set and time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..core.errors import ParameterError
from ..instrument import Block, Instrument
from ..lanes.together import run_together
from ..law import timing_disagreements, warn_of_timing
from ..parameters import Value
from ..parameters.scenario import Scenario
from ..parts.signals import Measurement, Truth
from .sweep import columns_of, sets_of

if TYPE_CHECKING:
    import pandas as pd
    import xarray

_RECORDS = {"": Measurement, "true_": Truth}
_AXES = {"axis": ["x", "y", "z"]}


def simulate_many(
    scenario: Scenario,
    parameters: Mapping[str, Sequence[Value]] | pd.DataFrame,
    *,
    grid: bool = True,
    variables: Sequence[str] = ("position", "deflection", "lateral_force", "reference_position"),
    lanes: bool = True,
) -> xarray.Dataset:
    """Simulate a scenario once for each parameter set, and keep what was measured at every control tick.

    All in this process and on one processor: up to 32 instruments of one composition in one compiled loop
    (`docs/numerics.md`). `sweep` uses all processors and keeps scores.

    Parameters
    ----------
    scenario, parameters, grid
        As in `sweep`.
    variables : sequence of str
        Fields of `Measurement`; those of `Truth` with `true_` in front, such as `true_friction`.
    lanes : bool
        False: one instrument after the other; the same numbers.

    Returns
    -------
    xarray.Dataset
        Each variable over `set` and `time` [s], vectors also over `axis`, SI units; NaN after the end of a run that
        was refused or diverged. Over `set`: `trajectory_sha256`, `error` (empty where all went well), and the
        parameters as coordinates.

    Warns
    -----
    TimingWarning
        As of `sweep`.

    Raises
    ------
    ParameterError
        If a name is unknown, the sequences do not fit, or the sets differ in control period or duration.
    ImportError
        If xarray is not installed.
    """
    import xarray

    columns = columns_of(scenario, parameters, grid)
    sets = list(sets_of(scenario, columns))
    run = {number: each for number, each in enumerate(sets) if not isinstance(each, str)}
    others = (sentence for sim, law in run.values() for sentence in timing_disagreements(law.law, sim)[:1])
    warn_of_timing(list(others), f"{len(sets)} sets")
    clocks = {(sim.total_ticks, sim.plant.control_period) for sim, _ in run.values()} or {(0, 0.0)}
    if len(clocks) > 1:
        raise ParameterError("sets with different control periods or durations have no common time: use sweep")
    ((ticks, period),) = clocks
    kept: dict[str, Any] = {}
    for name in variables:
        front = "true_" if name.startswith("true_") else ""
        record, field = _RECORDS[front], name.removeprefix(front)
        if field not in record.names:
            raise ParameterError(f"unknown variable {name}: {record.__name__} has {', '.join(record.names)}")
        _, shape, unit = record.fields[field]
        dims = ("set", "time", *_AXES)[: 2 + len(shape)]
        kept[name] = dims, np.full((len(sets), ticks, *shape), np.nan), {"units": unit or "1"}
    blocks: dict[int, list[Block]] = {number: [] for number in run}
    numbers = list(run)
    found = run_together(list(run.values()), lambda i, block: blocks[numbers[i]].append(block), lanes=lanes)
    hashes, errors = [""] * len(sets), [each if isinstance(each, str) else "" for each in sets]
    for number, end in zip(numbers, found, strict=True):
        if not isinstance(end, Instrument):
            errors[number] = str(end)
        else:
            hashes[number] = end.trajectory_sha256()
        for block in blocks[number]:
            span = slice(block.first_tick, block.first_tick + len(block.measurements))
            told = end.truth_of(block.states) if isinstance(end, Instrument) else None
            for name, (_, values, _) in kept.items():
                if not name.startswith("true_"):
                    values[number, span] = block.measurements[name]
                elif told is not None:
                    values[number, span] = told[name.removeprefix("true_")]
    return xarray.Dataset(
        {**kept, "trajectory_sha256": ("set", hashes), "error": ("set", errors)},
        {"time": ("time", period * np.arange(ticks), {"units": "s"}), **_AXES}
        | {name: ("set", values) for name, values in columns.items()},
    )
