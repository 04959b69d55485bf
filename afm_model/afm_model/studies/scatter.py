"""Make many runs over all cores, or a cluster: the engine of `sweep` and `compare`.

The work is handed out by Dask, which is imported only when a study starts, like pandas.
"""

from __future__ import annotations

import itertools
import logging
import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing import resource_tracker
from types import ModuleType
from typing import Any

from ..compiled import cache as kernel_cache
from ..compiled.lanes import LANES
from ..core.errors import ParameterError
from ..core.progress import reporting
from ..instrument import Instrument
from ..instrument.controller import Controller
from ..parameters import ControllerParameters, SimParameters
from ..run.simulated import ticks_to_simulate
from .contender import PATIENCE

Row = dict[str, Any]
"""Results of a run by the names of their columns."""
Set = tuple[Any, ...]
"""What a run is made of; its SimParameters stand first."""

_TASK_STEPS = 1_000_000
"""Integration steps handed to a worker at once, about a second: what Dask needs for it is below a percent."""
_MOST = 4 * LANES
"""Sets handed to a worker at once: it holds all their instruments."""
_AHEAD = 2 * _MOST
"""Sets looked at together, a processor: those that are alike are put into one task."""
_WAITING = 3
"""Tasks that a processor has, or that wait for it: it never waits itself."""
_TIMEOUT = 10.0
"""For the scheduler and its first worker to answer [s]."""
_TOGETHER = 0.2
"""Time in which all failures of one worker are reported [s]."""
_NAMED = 6
"""Laws or sets that a sentence names."""
_UNGUARDED = 'in a script, sweep must be called under if __name__ == "__main__":'


class SweepError(RuntimeError):
    """A sweep cannot run here: a package, the scheduler or its workers are missing; the message is one sentence."""


def require_scattering(scheduler: str | None, workers: int | None) -> ModuleType:
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


def run_sets(
    run_all: Callable[[list[Any]], Iterable[Row]],
    sets: Iterable[Set | str],
    total: int,
    what: str,
    alone: Collection[int] = (),
    *,
    name: Callable[[int], str] = "set {}".format,
    apart: Callable[[int], str] = lambda number: "",
    scheduler: str | None = None,
    workers: int | None = None,
    progress: bool | Callable[[int, int], None] = True,
) -> list[Row]:
    """Run many sets of parameters over processes; a row for each, in order, whatever the number of workers.

    Parameters
    ----------
    run_all : callable
        Called with a list of sets in a worker, where it must be importable; it returns their rows.
    sets : iterable of tuple or str
        A tuple begins with its SimParameters. Text is the sentence why a set was refused: that is its row. They are
        taken when workers need them, so that not all of them are in memory.
    total : int
        Their number.
    what : str
        What the progress bar is headed by.
    alone : collection of int
        Numbers of the sets that run in this process, one at a time, after the others.
    name : callable
        What the set of a number is called in a sentence.
    apart : callable
        Sets whose numbers give different texts are handed out apart: if a worker ends, it is known in which.
    scheduler, workers, progress
        As in `afm_model.sweep`.

    Raises
    ------
    SweepError
        If a worker ends, again and again, in the same sets.
    """
    rows: list[Row] = [{}] * total
    done = 0
    here: list[tuple[int, Set]] = []

    def far() -> Iterator[tuple[int, Set]]:
        for number, each in enumerate(sets):
            if isinstance(each, str):
                put(number, {"error": each})
            elif number in alone:
                here.append((number, each))
            else:
                yield number, each

    def put(number: int, row: Row) -> None:
        nonlocal done
        rows[number] = row
        done += 1
        report(done, total)

    with reporting(progress, what) as report:
        report(0, total)
        for number, row in _scattered(run_all, far(), name, apart, scheduler, workers):
            put(number, row)
        for number, each in here:
            put(number, *run_all([each]))
    return rows


def _scattered(
    run_all: Callable[[list[Any]], Iterable[Row]],
    sets: Iterator[tuple[int, Set]],
    name: Callable[[int], str],
    apart: Callable[[int], str],
    scheduler: str | None,
    workers: int | None,
) -> Iterator[tuple[int, Row]]:
    """Numbers and rows of the sets, as they are done."""
    import dask
    import distributed

    first = list(itertools.islice(sets, 1))
    if not first:
        return
    sources = kernel_cache.fingerprint(__name__, __file__)
    # Of the messages to workers and scheduler Dask would keep the last thousand, each with the sets of a task.
    forget = dask.config.set({"distributed.admin.low-level-log-length": 1})
    with forget, _client(distributed, scheduler, workers) as (client, processors):
        tasks = _tasks(itertools.chain(first, sets), apart, processors)
        under_way: dict[Any, list[str]] = {}  # by future

        def submitted(task: list[tuple[int, Set]]) -> Any:
            future = client.submit(_run_task, task, run_all, sources, pure=False)
            under_way[future] = list(dict.fromkeys(name(number) for number, _ in task))
            return future

        begun = map(submitted, tasks)
        completed: Any = distributed.as_completed
        running = completed(itertools.islice(begun, _WAITING * processors), loop=client.loop)
        for future in running:
            # Another for the one that has ended: parameters and results of all would need memory without end.
            running.update(itertools.islice(begun, 1))
            try:
                yield from future.result()
            except ImportError as error:
                raise SweepError(f"a worker cannot import afm_model: {error}") from None
            except distributed.KilledWorker as killed:
                # With it fail the tasks that waited there; the one that ran was handed out first.
                time.sleep(_TOGETHER)
                told = next(names for each, names in under_way.items() if each.status == "error")
                raise SweepError(_killed(told, killed.allowed_failures + 1)) from None
            del under_way[future]


def _killed(names: list[str], times: int) -> str:
    """That workers have ended in one task."""
    shown = ", ".join(names[:_NAMED]) + (f" and {len(names) - _NAMED} more" if len(names) > _NAMED else "")
    return (
        f"{times} worker processes have ended, one after the other, in the same runs, those of {shown}: something in "
        f"them ends its process (os._exit, a fault in compiled code, a class that gives no answer for {PATIENCE:g} s), "
        f"or needs more memory than there is"
    )


def _alike(sim: SimParameters) -> tuple[Any, ...]:
    """The same for sets that can run together and are as long; see `afm_model.lanes.loop.composition`."""
    clocks = sim.plant.control_period, sim.detector.sample_period, sim.score_tick, ticks_to_simulate(sim)
    return sim.plant.kind, sim.sample.kind, *clocks, sim.plant.dt


def _tasks(
    sets: Iterator[tuple[int, Set]], apart: Callable[[int], str], processors: int
) -> Iterator[list[tuple[int, Set]]]:
    """Sets in portions of similar work: large enough for Dask's share to vanish, small enough to end together; of some
    LANES sets where each processor has as many.
    """
    while ahead := list(itertools.islice(sets, _AHEAD * processors)):
        # Those of one composition come together.
        ahead.sort(key=lambda each: (apart(each[0]), *_alike(each[1][0])))
        steps = [ticks_to_simulate(sim) * sim.plant.substeps for _, (sim, *_) in ahead]
        portion = min(_TASK_STEPS, sum(steps) / (8 * processors))
        portion = max(portion, min(LANES / len(ahead), 1.0 / processors) * sum(steps))
        task: list[tuple[int, Set]] = []
        filled = 0
        for each, work in zip(ahead, steps, strict=True):
            other = bool(task) and apart(task[0][0]) != apart(each[0])
            if filled >= portion or len(task) >= _MOST or other:
                yield task
                task, filled = [], 0
            task.append(each)
            filled += work
        yield task


@contextmanager
def _client(distributed: ModuleType, scheduler: str | None, workers: int | None) -> Iterator[tuple[Any, int]]:
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


def _run_task(
    sets: Sequence[tuple[int, Set]], run_all: Callable[[list[Any]], Iterable[Row]], sources: str
) -> list[tuple[int, Row]]:
    """Task of a worker: run some sets."""
    if sources != kernel_cache.fingerprint(__name__, __file__):
        raise SweepError("a worker has other sources of afm_model, or another numba, than the process that sweeps")
    rows = run_all([each for _, each in sets])
    return [(number, row) for (number, _), row in zip(sets, rows, strict=True)]
