"""Many instruments: thousands of parameter sets of a scenario, their scores as a table."""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ..core.errors import ParameterError
from ..core.schema import python_value, with_parts
from ..instrument import score
from ..lanes.together import run_together
from ..law import timing_disagreements, warn_of_timing
from ..parameters import ControllerParameters, Group, SimParameters, Value, changed, specifications
from ..parameters.scenario import SECTIONS, Scenario, changed_instrument, following
from ..run.simulated import ticks_to_simulate
from ..run.verdict import limited
from .scatter import Row, Set, require_scattering, run_sets

if TYPE_CHECKING:
    import pandas as pd

_TEXTS = ("trajectory_sha256", "error")
_BLOCK_TICKS = 512
"""Small blocks of unused rows stay in the processor's cache."""
_CHECKED = 256
"""Checked parameters of a node that are kept."""
_SIM, _LAW = "afm_sim_node", "afm_controller_node"


def sweep(
    scenario: Scenario,
    parameters: Mapping[str, Sequence[Value]] | pd.DataFrame,
    *,
    grid: bool = True,
    scheduler: str | None = None,
    workers: int | None = None,
    fingerprint: bool = False,
    lanes: bool = True,
    progress: bool | Callable[[int, int], None] = True,
) -> pd.DataFrame:
    """Simulate a scenario once for each parameter set. The table is the same for any number of workers.

    In a script, call it under `if __name__ == "__main__":`, as everything that starts processes of Python.

    Parameters
    ----------
    scenario : Scenario
        From `load_scenario`; what is not swept stays as it is there.
    parameters : mapping or DataFrame
        Values by full name, such as `afm_controller_node.law.alpha` or `afm_sim_node.plant.delay_ticks`. A DataFrame
        holds one set a row.
    grid : bool
        True: a mapping stands for every combination, the last name changing fastest. False: its sequences have one
        length, and the n-th values of all are the n-th set.
    scheduler : str, optional
        Address of a running Dask scheduler, such as `tcp://host:8786`, whose workers have this same afm_model. Without
        one, processes are started on this machine and ended with the sweep.
    workers : int, optional
        Processes to start; as many as this process may use processors if not given. Not allowed with `scheduler`.
    fingerprint : bool
        True: also `trajectory_sha256`, which costs a tenth of a run with two steps a tick, and less with more.
    lanes : bool
        True: instruments of one composition are computed together (`docs/numerics.md`); False: one after the other. The
        table is the same.
    progress : bool or callable
        True: show a bar on the terminal. A callable is called now and then with runs done and runs in all.

    Returns
    -------
    DataFrame
        A row a set, in order, with the index of `parameters` if that is a DataFrame. Columns: the parameters; then the
        fields of `ScoreSummary` in SI units, vectors as `rms_x`, ranges as `friction_low`; and
        `error`, missing where all went well, else the message that says why the set was refused or
        diverged, or that a limit (`safety.*`) withdrew the sample in scored ticks.

    Warns
    -----
    TimingWarning
        If a law is made for another control period or delay than those of the plant. One that is made for those of the
        scenario is made for those of each set, unless its own are swept.

    Raises
    ------
    ParameterError
        If a name is unknown or the sequences do not fit; before anything runs.
    SweepError
        If a package is missing, or the scheduler or its workers do not answer or have other sources.
    """
    pandas = require_scattering(scheduler, workers)
    index = None if isinstance(parameters, Mapping) else parameters.index
    columns = columns_of(scenario, parameters, grid)
    total = count_of(columns)
    others: list[str] = []

    def sets() -> Iterator[Set | str]:
        for each in sets_of(scenario, columns):
            others.extend([] if isinstance(each, str) else timing_disagreements(each[1].law, each[0])[:1])
            yield each

    run_all = partial(_run_all, fingerprint=fingerprint, lanes=lanes)
    rows = run_sets(run_all, sets(), total, "sweeping", scheduler=scheduler, workers=workers, progress=progress)
    warn_of_timing(others, f"{total} sets")
    return _table(pandas, columns, rows, index, fingerprint)


def columns_of(
    scenario: Scenario, parameters: Mapping[str, Sequence[Value]] | pd.DataFrame, grid: bool
) -> dict[str, list[Value]]:
    """Names and their values, one a set."""
    given: dict[str, list[Value]] = {}
    for name in parameters:
        values = parameters[name]
        if isinstance(values, str | bytes) or not hasattr(values, "__len__"):
            raise ParameterError(f"{name} = {values} is not allowed in a sweep: it must be a list of values")
        # Plain Python numbers: those of numpy are not what the parameters are declared as.
        given[name] = [python_value(value) for value in values]
        for value in given[name]:
            if not isinstance(value, int | float | str):
                raise ParameterError(
                    f"{name} = {value} is not allowed in a sweep: a value is a number, a truth or a word"
                )
    _require_known(scenario, given)
    if not isinstance(parameters, Mapping):
        return given
    if grid:
        combinations = list(itertools.product(*given.values()))
        return {name: [values[i] for values in combinations] for i, name in enumerate(given)}
    if len({len(values) for values in given.values()}) > 1:
        lengths = ", ".join(f"{name}: {len(values)}" for name, values in given.items())
        raise ParameterError(f"with grid=False all parameters must have the same number of values ({lengths})")
    return given


def _require_known(scenario: Scenario, given: Mapping[str, Sequence[Value]]) -> None:
    models: dict[str, type[Group]] = {node: type(group) for node, group in _groups(scenario).items()}
    known = [f"{node}.{each.name}" for node, model in models.items() for each in specifications(model)]
    # Where the kind of a part is swept, the parameters of each of the kinds are known.
    for name, values in given.items():
        node, _, parameter = name.partition(".")
        if name in known and parameter.endswith(".kind"):
            for value in values:
                with suppress(ParameterError):
                    model = with_parts(models[node], {parameter: value})
                    known += [f"{node}.{each.name}" for each in specifications(model)]
    names = list(given)
    for name in names:
        if name in known:
            continue
        # What is forgotten or mistaken most easily is the node.
        tails = {each.split(".", 1)[1]: each for each in known}
        tail = str(name).split(".", 1)[-1]
        ends = [each for each in known if each.endswith(f".{name}") or each.endswith(f".{tail}")]
        near = ends or difflib.get_close_matches(str(name), known, n=1)
        near = near or [tails[each] for each in difflib.get_close_matches(str(name), list(tails), n=1)]
        hint = (
            f"did you mean {near[0]}?" if near else f"it must start with {' or '.join(f'{node}.' for node in models)}"
        )
        raise ParameterError(f"unknown parameter {name}: {hint}")


def _groups(scenario: Scenario) -> dict[str, Group]:
    """What the scenario says for each node."""
    return {node: getattr(scenario, SECTIONS[node][0]) for node in (_SIM, _LAW)}


def count_of(columns: Mapping[str, Sequence[Value]]) -> int:
    """How many sets they are; without a column the scenario alone."""
    return len(next(iter(columns.values()))) if columns else 1


def sets_of(
    scenario: Scenario, columns: Mapping[str, Sequence[Value]]
) -> Iterator[tuple[SimParameters, ControllerParameters] | str]:
    """The parameters of every set, or the sentence why it is refused."""
    base = _groups(scenario)
    # The same values again and again in a grid are checked once, as long as there are not many of them.
    made: dict[tuple[Any, ...], Group | str] = {}

    def group(node: str, news: Mapping[str, Value]) -> Group | str:
        key = (node, *((name, type(value), value) for name, value in news.items()))
        if key not in made:
            if len(made) >= _CHECKED:
                made.clear()
            try:
                made[key] = each = changed_instrument(scenario, news) if node == _SIM else changed(base[node], news)
                if isinstance(each, SimParameters):
                    ticks_to_simulate(each)
            except ParameterError as error:
                made[key] = str(error)
        return made[key]

    for i in range(count_of(columns)):
        news: dict[str, dict[str, Value]] = {node: {} for node in base}
        for name, values in columns.items():
            node, _, parameter = name.partition(".")
            news[node][parameter] = values[i]
        sim = group(_SIM, news[_SIM])
        timing: dict[str, Value] = {}
        if isinstance(sim, SimParameters):
            with suppress(ParameterError):
                timing = following(scenario, sim, news[_LAW])
        law = group(_LAW, timing | news[_LAW])
        refused = [each for each in (sim, law) if isinstance(each, str)]
        yield "; ".join(refused) if refused else (sim, law)  # type: ignore[misc]


def _run_all(
    sets: Sequence[tuple[SimParameters, ControllerParameters]], fingerprint: bool, lanes: bool
) -> Iterator[Row]:
    """Score of each run; the same bytes as `simulate`, nothing recorded."""
    for end in run_together(sets, lanes=lanes, block_ticks=_BLOCK_TICKS, hashed=fingerprint):
        if isinstance(end, Exception):
            yield {"error": str(end)}
            continue
        result: Row = score.row(end.score())
        if sentence := limited(end):
            result["error"] = sentence
        if fingerprint:
            result["trajectory_sha256"] = end.trajectory_sha256()
        yield result


def _table(
    pandas: ModuleType, columns: Mapping[str, Sequence[Value]], rows: Sequence[Row], index: Any, fingerprint: bool
) -> pd.DataFrame:
    """Parameters and results side by side; every column has the same type in every sweep."""
    names = [*score.columns(), *(_TEXTS if fingerprint else _TEXTS[1:])]
    types = dict.fromkeys(names, "float64") | dict.fromkeys(score.COUNTS, "Int64") | dict.fromkeys(_TEXTS, "str")
    if index is None:
        index = pandas.RangeIndex(len(rows))
    results = {name: pandas.Series([row.get(name) for row in rows], index=index, dtype=types[name]) for name in names}
    return pandas.DataFrame(
        {name: pandas.Series(values, index=index) for name, values in columns.items()} | results, index=index
    )
