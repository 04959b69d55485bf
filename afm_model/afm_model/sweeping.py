"""Many instruments: thousands of parameter sets of a scenario over all cores, or a cluster; their scores as a table.

The work is handed out by Dask, which is imported only when a sweep starts, like pandas.
"""

from __future__ import annotations

import difflib
import itertools
import logging
import multiprocessing
import os
import signal
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any

import numpy as np

from . import jit
from .controller import Controller
from .errors import DivergenceError, DriveError, ParameterError, PartError
from .instrument import Instrument, score
from .law import TimingWarning, disagreements
from .parameters import ControllerParameters, Group, SimParameters, Value, build, flatten, specifications
from .progress import reporting
from .run.simulated import ticks_to_simulate
from .scenario import SECTIONS, Scenario, law_timing
from .schema import with_parts
from .simulation import run

if TYPE_CHECKING:
    import pandas as pd

_SIM, _LAW = "afm_sim_node", "afm_controller_node"
_NODES: dict[str, type[Group]] = {node: group for node, (part, group) in SECTIONS.items() if part != "header"}
_TEXTS = ("trajectory_sha256", "error")

_BLOCK_TICKS = 512
"""Recorded rows that nobody takes stay in the processor's cache."""
_TASK_STEPS = 1_000_000
"""Integration steps handed to a worker at once, about a second: what Dask needs for it is below a percent."""
_TIMEOUT = 10.0
"""For the scheduler and its first worker to answer [s]."""

_UNGUARDED = 'in a script, sweep must be called under if __name__ == "__main__":'

_Set = tuple[SimParameters, ControllerParameters]
_Row = dict[str, Any]


class SweepError(RuntimeError):
    """A sweep cannot run here: a package, the scheduler or its workers are missing; the message is one sentence."""


def sweep(
    scenario: Scenario,
    parameters: Mapping[str, Sequence[Value]] | pd.DataFrame,
    *,
    grid: bool = True,
    scheduler: str | None = None,
    workers: int | None = None,
    fingerprint: bool = False,
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
    progress : bool or callable
        True: show a bar on the terminal. A callable is called now and then with runs done and runs in all.

    Returns
    -------
    DataFrame
        A row a set, in order, with the index of `parameters` if that is a DataFrame. Columns: the parameters; then the
        fields of `ScoreSummary` in SI units, vectors as `rms_x`, ranges as `friction_low`; and
        `error`, missing where all went well, else the sentence that tells why the set was refused or diverged.

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
    columns = _columns(scenario, parameters, grid)
    sets = _build_sets(scenario, columns)
    _warn_of_timing(sets)
    rows: list[_Row] = [{"error": each} if isinstance(each, str) else {} for each in sets]
    runnable = [(number, each) for number, each in enumerate(sets) if not isinstance(each, str)]
    with reporting(progress, "sweeping") as report:
        done = len(sets) - len(runnable)
        report(done, len(sets))
        for number, row in scattered(partial(_run_set, fingerprint=fingerprint), runnable, scheduler, workers):
            rows[number] = row
            done += 1
            report(done, len(sets))
    return _table(pandas, columns, rows, index, fingerprint)


def require_scattering(scheduler: str | None, workers: int | None) -> Any:
    """The package pandas, if many instruments can be run here.

    Raises
    ------
    SweepError, ParameterError
        As `sweep`.
    """
    try:
        import distributed  # noqa: F401
        import pandas
    except ImportError as error:
        raise SweepError(
            f"a sweep needs dask, distributed and pandas ({error}): pip install dask distributed pandas"
        ) from None
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        # A worker reads the script that started it; this call is not its business.
        raise SweepError(_UNGUARDED)
    if workers is not None and (workers < 1 or scheduler is not None):
        raise ParameterError(f"workers = {workers} is not allowed: it must be >= 1, and not given with a scheduler")
    return pandas


def scattered(
    run_one: Callable[..., _Row], sets: Sequence[tuple[int, Any]], scheduler: str | None, workers: int | None
) -> Iterator[tuple[int, _Row]]:
    """Run numbered sets over processes; the number and the row of each, as they are done.

    Parameters
    ----------
    run_one : callable
        Called with the items of a set in a worker; importable there.
    sets : sequence of (number, set)
        A set is a tuple that begins with its SimParameters.
    scheduler, workers
        As in `sweep`.
    """
    import distributed

    if not sets:
        return
    with _client(distributed, scheduler, workers) as (client, processors):
        for numbers, rows in _results(distributed, client, _tasks(sets, processors), run_one):
            yield from zip(numbers, rows, strict=True)


def _columns(
    scenario: Scenario, parameters: Mapping[str, Sequence[Value]] | pd.DataFrame, grid: bool
) -> dict[str, list[Value]]:
    """Names and their values, one a set."""
    given: dict[str, list[Value]] = {}
    for name in parameters:
        values = parameters[name]
        if isinstance(values, str | bytes) or not hasattr(values, "__len__"):
            raise ParameterError(f"{name} = {values} is not allowed in a sweep: it must be a list of values")
        # Plain Python numbers: those of numpy are not what the parameters are declared as.
        given[name] = [value.item() if isinstance(value, np.generic) else value for value in values]
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
            f"did you mean {near[0]}?" if near else f"it must start with {' or '.join(f'{node}.' for node in _NODES)}"
        )
        raise ParameterError(f"unknown parameter {name}: {hint}")


def _groups(scenario: Scenario) -> dict[str, Group]:
    """What the scenario says for each node."""
    return {node: getattr(scenario, SECTIONS[node][0]) for node in _NODES}


def _build_sets(scenario: Scenario, columns: Mapping[str, Sequence[Value]]) -> list[_Set | str]:
    """The parameters of every set, or the sentence why it is refused."""
    base = _groups(scenario)
    flat = {node: flatten(group) for node, group in base.items()}
    # The same values again and again in a grid: each is checked once.
    built: dict[tuple[Any, ...], Group | str] = {}

    def group(node: str, changed: Mapping[str, Value], kept: Mapping[str, Value]) -> Group | str:
        key = (node, *((name, type(value), value) for name, value in [*changed.items(), *kept.items()]))
        if key not in built:
            try:
                made = build(_NODES[node], _of_the_parts(_NODES[node], {**flat[node], **kept}, changed))
                if isinstance(made, SimParameters):
                    ticks_to_simulate(made)
                built[key] = made
            except ParameterError as error:
                built[key] = str(error)
        return built[key]

    names = {node: [name for name in columns if name.startswith(f"{node}.")] for node in base}
    total = len(next(iter(columns.values()))) if columns else 1
    sets: list[_Set | str] = []
    follows = not disagreements(scenario.controller.law, scenario.sim.plant)
    for i in range(total):
        changed = {node: {name[len(node) + 1 :]: columns[name][i] for name in names[node]} for node in base}
        sim = group(_SIM, changed[_SIM], {})
        timing: dict[str, Value] = {}
        # A law that is made for the plant of the scenario is made for that of each set.
        if follows and isinstance(sim, SimParameters):
            with suppress(ParameterError):
                timing = law_timing({"law.kind": flat[_LAW]["law.kind"], **changed[_LAW]}, sim)
        law = group(_LAW, changed[_LAW], timing)
        refused = [each for each in (sim, law) if isinstance(each, str)]
        sets.append("; ".join(refused) if refused else (sim, law))  # type: ignore[arg-type]
    return sets


def _warn_of_timing(sets: Sequence[_Set | str]) -> None:
    """Warn of the sets whose law is made for another period or delay than those of the plant."""
    told = [disagreements(each[1].law, each[0].plant) for each in sets if not isinstance(each, str)]
    if others := [sentences[0] for sentences in told if sentences]:
        warnings.warn(f"in {len(others)} of {len(sets)} sets {others[0]}", TimingWarning, stacklevel=3)


def _of_the_parts(model: type[Group], base: Mapping[str, Value], changed: Mapping[str, Value]) -> dict[str, Value]:
    """`base` with what is changed; where another part is chosen, without the parameters that the new one does not have.

    Raises
    ------
    ParameterError
        If there is no such part.
    """
    if not any(name.endswith(".kind") for name in changed):
        return {**base, **changed}
    known = {each.name for each in specifications(with_parts(model, {**base, **changed}))}
    return {name: value for name, value in base.items() if name in known} | dict(changed)


def _tasks(sets: Sequence[tuple[int, Any]], processors: int) -> list[list[tuple[int, Any]]]:
    """Sets in portions of similar work: large enough for Dask's share to vanish, small enough to end together."""
    steps = [ticks_to_simulate(sim) * sim.plant.substeps for _, (sim, *_) in sets]
    portion = min(_TASK_STEPS, sum(steps) / (8 * processors))
    tasks: list[list[tuple[int, Any]]] = []
    filled = portion
    for each, work in zip(sets, steps, strict=True):
        if filled >= portion:
            tasks.append([])
            filled = 0
        tasks[-1].append(each)
        filled += work
    return tasks


def _results(
    distributed: Any, client: Any, tasks: Sequence[Sequence[tuple[int, Any]]], run_one: Callable[..., _Row]
) -> Iterator[tuple[list[int], list[_Row]]]:
    """Numbers and results of the sets of each task, as they are done."""
    sets = [[each for _, each in task] for task in tasks]
    import dask

    # A set is a kilobyte; that many of them are large is no surprise.
    with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1GB"}):
        futures = client.map(_run_sets, sets, run_one=run_one, sources=jit.FINGERPRINT, pure=False)
    numbers = {future.key: [number for number, _ in task] for future, task in zip(futures, tasks, strict=True)}
    for future in distributed.as_completed(futures, loop=client.loop):
        try:
            yield numbers[future.key], future.result()
        except ImportError as error:
            raise SweepError(f"a worker cannot import afm_model: {error}") from None


@contextmanager
def _client(distributed: Any, scheduler: str | None, workers: int | None) -> Iterator[tuple[Any, int]]:
    """A client of the scheduler at an address, or of a cluster of our own that ends with it; its processors."""
    if scheduler is not None:
        try:
            client = distributed.Client(scheduler, timeout=_TIMEOUT, set_as_default=False)
        except (OSError, ValueError) as error:
            raise SweepError(f"no Dask scheduler answers at {scheduler}: {error}") from None
        # Futures are released with the client: an interrupted sweep leaves no work behind.
        with client:
            try:
                client.wait_for_workers(1, timeout=_TIMEOUT)
            except TimeoutError:
                raise SweepError(f"the Dask scheduler at {scheduler} has no worker") from None
            yield client, sum(client.nthreads().values())
        return
    processors = workers or len(os.sched_getaffinity(0))
    # Compiled once, here; the workers find it in the cache.
    Instrument(SimParameters(), 1).close_loop(Controller(ControllerParameters()), 1)
    with _interrupt_held():
        try:
            cluster = distributed.LocalCluster(
                n_workers=processors,
                threads_per_worker=1,
                processes=True,
                # Without an address it would still serve at 8787, and complain where that is taken.
                dashboard_address="127.0.0.1:0",
                scheduler_kwargs={"dashboard": False},
                memory_limit=0,
                silence_logs=logging.CRITICAL,
            )
        except RuntimeError as error:
            raise SweepError(f"no worker process could be started ({error}): {_UNGUARDED}") from None
    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        yield client, processors


@contextmanager
def _interrupt_held() -> Iterator[None]:
    """Processes started here do not see Ctrl-C, which a terminal sends to all: the sweep ends them itself."""
    # The tracker would let the signal through again in the thread that starts the processes.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _run_sets(sets: Sequence[Any], run_one: Callable[..., _Row], sources: str) -> list[_Row]:
    """Task of a worker: run some sets, one after the other."""
    if sources != jit.FINGERPRINT:
        raise SweepError("a worker has other sources of afm_model, or another numba, than the process that sweeps")
    return [run_one(*each) for each in sets]


def _run_set(parameters: SimParameters, law: ControllerParameters, fingerprint: bool = True) -> _Row:
    """Score of one run; the same bytes as `simulate`, nothing recorded."""
    try:
        instrument = run(parameters, law, block_ticks=_BLOCK_TICKS, hashed=fingerprint)
    except (ParameterError, PartError, DriveError, DivergenceError) as error:
        return {"error": str(error)}
    result: _Row = score.row(instrument.score())
    if fingerprint:
        result["trajectory_sha256"] = instrument.trajectory_sha256()
    return result


def _table(
    pandas: Any, columns: Mapping[str, Sequence[Value]], rows: Sequence[_Row], index: Any, fingerprint: bool
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
