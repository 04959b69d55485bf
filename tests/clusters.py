"""A Dask cluster in this process: nothing to start or to leave behind."""

from collections.abc import Iterator
from contextlib import contextmanager

import distributed


@contextmanager
def cluster_here(workers: int = 1) -> Iterator[str]:
    """Address of a running scheduler with so many workers."""
    with distributed.LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address="127.0.0.1:0"
    ) as running:
        yield running.scheduler_address
