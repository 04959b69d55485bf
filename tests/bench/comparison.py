"""A comparison of laws: processor time of 576 runs with all that belongs to them, and of it the linear models."""

import time
from typing import Any
from unittest.mock import patch

import distributed

from afm_model import compare
from afm_model.studies import trial

LAWS = (
    *("tanh", "sgn", "pid slowness=0.15", "implicit", "super_twisting"),
    *("observer", "observer friction=learned", "predictive"),
)
CONDITIONS: dict[str, Any] = {
    "periods": (1e-5, 2e-5, 5e-5, 2e-4),
    "delay_ticks": (0, 1, 2),
    "noise": (0.0, 1.0),
    "references": ("sine 50", "triangle 50", "sine 250"),
    "cycles": 0.6,
}


def measure(repeats: int = 3) -> dict[str, float]:
    """Processor time of a comparison in this process [s], best of `repeats`: `runs`, `cpu_s`, of it `linear_s`."""
    margin, linear = trial.margin, 0.0

    def timed(*arguments: Any) -> float:
        nonlocal linear
        begin = time.thread_time()
        try:
            return margin(*arguments)
        finally:
            linear += time.thread_time() - begin

    found: dict[str, float] = {}
    with (
        patch.object(trial, "margin", timed),
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, memory_limit=0
        ) as cluster,
    ):
        for repeat in range(repeats + 1):  # The first compiles.
            linear, begin = 0.0, time.process_time()
            table = compare(LAWS, **CONDITIONS, scheduler=cluster.scheduler_address, progress=False).table
            each = {"runs": len(table), "cpu_s": time.process_time() - begin, "linear_s": linear}
            if repeat > 0 and each["cpu_s"] < found.get("cpu_s", each["cpu_s"] + 1.0):
                found = each
    return found
