"""Many instruments: thousands of parameter sets of a scenario over all cores, or a cluster; their scores as a table.

The work is handed out by Dask, which is imported only when a sweep starts, like pandas.
"""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any

from ..core import kernel_cache
from ..core.errors import DivergenceError, DriveError, ParameterError, PartError
from ..core.progress import reporting
from ..instrument import Instrument, score
from ..instrument.controller import Controller
from ..parameters import ControllerParameters, SimParameters, Value
from ..parameters.scenario import Scenario
from ..run.simulated import ticks_to_simulate
from ..run.simulation import run
from .sweep_sets import build_sets, sweep_columns, warn_of_timing

if TYPE_CHECKING:
    import pandas as pd

_TEXTS = ("trajectory_sha256", "error")

_BLOCK_TICKS = 512
"""Recorded rows that nobody takes stay in the processor's cache."""
_TASK_STEPS = 1_000_000
"""Integration steps handed to a worker at once, about a second: what Dask needs for it is below a percent."""
_TIMEOUT = 10.0
"""For the scheduler and its first worker to answer [s]."""

_UNGUARDED = 'in a script, sweep must be called under if __name__ == "__main__":'

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
    columns = sweep_columns(scenario, parameters, grid)
    sets = build_sets(scenario, columns)
    warn_of_timing(sets)
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
        sources = kernel_cache.fingerprint(__name__, __file__)
        futures = client.map(_run_sets, sets, run_one=run_one, sources=sources, pure=False)
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
    if sources != kernel_cache.fingerprint(__name__, __file__):
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
