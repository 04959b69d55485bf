"""Many instruments: what a run costs in a sweep, against the compiled loop alone in the same processes."""

import os
import time
from collections.abc import Callable
from typing import Any

import distributed

from afm_model import Controller, Instrument, Scenario, load_scenario, sweep

SCENARIO = "closed_loop_tanh"
RUNS = 16
"""Sets of the smaller sweep, for each worker; the larger one has twice as many."""
REPEATS = 3
BLOCK_TICKS = 512


def bare(scenario: Scenario, runs: int) -> float:
    """Processor time of `runs` runs spent in the compiled loop [s]."""
    law = Controller(scenario.controller)
    seconds = 0.0
    for _ in range(runs):
        instrument = Instrument(scenario.sim, BLOCK_TICKS, hashed=False)
        while instrument.ticks < scenario.sim.total_ticks:
            begin = time.thread_time()
            instrument.close_loop(law, scenario.sim.total_ticks - instrument.ticks)
            seconds += time.thread_time() - begin
            instrument.skip_block()
    return seconds


def timed(run: Callable[[], object]) -> float:
    """Wall time [s]."""
    begin = time.perf_counter()
    run()
    return time.perf_counter() - begin


def measure_workers(scenario: Scenario, workers: int) -> dict[str, float]:
    """Sweeps over `workers` processes that are already there, best of REPEATS [s].

    Wall time, and processor time of the workers with all that Dask does in them: what else runs on the machine
    stretches the first most, but a busy neighbour on the same core stretches both.
    """

    runs = RUNS * workers
    best: dict[str, float] = {}

    def note(name: str, seconds: float) -> None:
        best[name] = min(best.get(name, seconds), seconds)

    with (
        distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, dashboard_address="127.0.0.1:0", memory_limit=0
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):

        def processor() -> float:
            return sum(client.run(time.process_time).values())

        def swept(count: int, fingerprint: bool) -> tuple[float, float]:
            seeds = {"afm_sim_node.plant.seed": range(count)}
            options = {"scheduler": cluster.scheduler_address, "fingerprint": fingerprint, "progress": False}
            begin = processor()
            wall = timed(lambda: sweep(scenario, seeds, **options))
            return wall, processor() - begin

        swept(workers, True)
        for _ in range(REPEATS):
            # All workers at the same time, as in the sweep: cores share caches and their clock.
            alone = client.gather(client.map(bare, [scenario] * workers, runs=RUNS, pure=False))
            note("kernel", sum(alone) / runs)
            for name, fingerprint in (("with the hash", True), ("without", False)):
                for times in (1, 2):
                    wall, cost = swept(times * runs, fingerprint)
                    note(f"{name}, wall, {times} n", wall)
                    note(f"{name}, a run, {times} n", cost / (times * runs))
    return best


def measure() -> dict[str, Any]:
    """Processor time of a run in a sweep, wall time against the number of sets; `rows` for the table."""
    scenario = load_scenario(SCENARIO)
    one_run = {"afm_sim_node.run.duration": [scenario.sim.plant.control_period]}
    figures: dict[str, Any] = {
        "runs_per_worker": RUNS,
        "start_s": min(timed(lambda: sweep(scenario, one_run, progress=False)) for _ in range(2)),
    }
    rows: dict[str, Any] = {}
    for workers in sorted({1, len(os.sched_getaffinity(0))}):
        best = figures[f"workers_{workers}"] = measure_workers(scenario, workers)
        name = f"{workers} worker{'s' * (workers > 1)}"
        for kind in ("with the hash", "without"):
            few, many = best[f"{kind}, wall, 1 n"], best[f"{kind}, wall, 2 n"]
            rows[f"{name}, ms a run {kind}"] = row(best[f"{kind}, a run, 2 n"], best["kernel"])
            rows[f"{name}, {kind}: twice the sets, times as long"] = {
                "measured": f"{many / few:.2f}",
                "floor": "2",
                "ratio": many / few / 2.0,
            }
    return figures | {"rows": rows}


def row(measured: float, floor: float) -> dict[str, Any]:
    """One row of the table, from seconds."""
    return {"measured": f"{1e3 * measured:.1f}", "floor": f"{1e3 * floor:.1f}", "ratio": measured / floor}
