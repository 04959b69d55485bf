"""Every law under every combination of conditions: in process over all cores, or where it runs."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

from ..core.errors import ParameterError
from ..law import timing_disagreements, warn_of_timing
from ..parameters import ControllerParameters, SimParameters, changed
from ..parameters.scenario import Scenario
from .comparison import Comparison
from .contender import CONDITIONS, Common, Contender, contenders, instrument_under, law_under
from .scatter import Row, require_scattering, run_sets
from .trial import NUMBERS, Trial, run_trials


def compare(
    laws: Sequence[str | Contender],
    scenario: Scenario | None = None,
    *,
    periods: Sequence[float] = (5e-5,),
    delay_ticks: Sequence[int] = (0,),
    noise: Sequence[float] = (0.0,),
    friction: Sequence[float] = (1.0,),
    references: Sequence[str] = ("sine 50",),
    cycles: float = 1.5,
    lanes: bool = True,
    scheduler: str | None = None,
    workers: int | None = None,
    progress: bool | Callable[[int, int], None] = True,
) -> Comparison:
    """Run every law under every combination of conditions, in process, over all cores.

    A law that runs somewhere else (`Contender.start`) runs after those, one run at a time, against the same loop in
    this process.

    A law is given what it declares of scanner, cantilever, scales, piezo, control period and delay, all of it right.
    It is not given the sample, or a friction that is not nominal. A loop that diverges is a result.

    Parameters
    ----------
    laws : sequence of str or Contender
        Text: see `contender`. With several values of a parameter, `pid slowness=0.1,0.15,1`, it is tuned: every
        combination runs, and the table has the one that ranks best over all conditions.
    scenario : Scenario, optional
        What is common to all runs; the instrument's defaults without.
    periods : sequence of float [s]
        Control periods.
    delay_ticks : sequence of int
        Delays in control periods.
    noise : sequence of float
        Levels: 1 is 1 mV on the photodetector, 0.05 nm on the positions and an ADC of 16 bits; 0 is no noise.
    friction : sequence of float
        Shear strength of the contact over its nominal one.
    references : sequence of str
        `sine 50`, `triangle 250`: shape and angular frequency [rad/s] of x and y.
    cycles : float
        Length of a run in periods of the reference; the first half period is not scored.
    lanes, scheduler, workers, progress
        As in `afm_model.sweep`.

    Warns
    -----
    TimingWarning
        If a law is given a period or a delay that is not that of the plant.

    Raises
    ------
    ParameterError
        If a law or a condition is not allowed; before anything runs.
    SweepError
        As in `afm_model.sweep`.
    """
    pandas = require_scattering(scheduler, workers)
    scenario = scenario or Scenario("default", Path("default.yaml"))
    common = Common(scenario, cycles)
    groups = [[law] if isinstance(law, Contender) else contenders(law) for law in laws]
    every = tuple(itertools.chain.from_iterable(groups))
    if len({each.label for each in every}) < len(every):
        raise ParameterError(f"laws = {', '.join(each.label for each in every)} is not allowed: a law is given twice")
    if not cycles > 0.5:
        raise ParameterError(
            f"cycles = {cycles:g} is not allowed: it must be > 0.5, the first half period is not scored"
        )

    @cache
    def instrument(*values: Any) -> SimParameters:
        return instrument_under(common, dict(zip(CONDITIONS, values, strict=True)))

    grid = list(itertools.product(periods, delay_ticks, noise, friction, references))
    rows: list[Row] = []
    sets: list[Trial | str] = []
    alone: list[int] = []
    # A law is told period, delay and whether there is noise.
    controllers: dict[Any, ControllerParameters] = {}
    for law in every:
        linearised = set()
        for values in grid:
            conditions = dict(zip(CONDITIONS, values, strict=True))
            rows.append({"law": law.label, **conditions})
            # The instrument must allow what is asked of it; a law may refuse its rate, which is a result.
            sim = instrument(*values)
            # The margin is that of the nominal instrument, without noise. It is computed once.
            told = instrument(*values[:2], 0.0, 1.0, values[4])
            if not law.is_part:
                if law.start is not None:
                    alone.append(len(sets))
                # With the seed it could draw the noise that is to come.
                unseeded = changed(told, {"plant.seed": SimParameters().plant.seed})
                sets.append(Trial(sim, None, law.kind, None, partial(law.begin, unseeded)))
                continue
            key = law.label, *values[:2], float(values[2]) != 0.0
            try:
                if key not in controllers:
                    controllers[key] = law_under(common, law, conditions, sim)
            except ParameterError as error:
                sets.append(str(error))
                continue
            sets.append(Trial(sim, controllers[key], law.kind, None if values[:2] in linearised else told))
            linearised.add(values[:2])
    others: list[str] = []
    for each in sets:
        if isinstance(each, Trial) and each.controller is not None:
            others += timing_disagreements(each.controller.law, each.sim)[:1]
    warn_of_timing(others, f"{len(sets)} runs")
    # A law that is no part may end its process.
    parts = {law.label for law in every if law.is_part}
    run_all = partial(run_trials, lanes=lanes)
    results = run_sets(
        run_all,
        sets,
        len(sets),
        "comparing",
        alone,
        name=lambda number: f"law {rows[number]['law']}",
        apart=lambda number: "" if rows[number]["law"] in parts else rows[number]["law"],
        scheduler=scheduler,
        workers=workers,
        progress=progress,
    )
    rows = [row | result for row, result in zip(rows, results, strict=True)]
    margins = {(row["law"], *_timing(row)): row["margin"] for row in rows if "margin" in row}
    for row in rows:
        row["margin"] = margins.get((row["law"], *_timing(row)), math.nan)
    table = pandas.DataFrame(rows, columns=["law", *CONDITIONS, *NUMBERS, "trajectory_sha256", "error"])
    return Comparison(table.astype(dict.fromkeys(NUMBERS, "float64")), every, common).best_of(groups)


def _timing(row: Mapping[str, Any]) -> tuple[Any, Any]:
    return row["period"], row["delay_ticks"]
