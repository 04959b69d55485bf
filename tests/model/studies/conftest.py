"""What studies run on."""

from collections.abc import Iterator

import distributed
import pytest

from .short import EXAMPLES


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """Address of a running scheduler with a worker, in this process."""
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address="127.0.0.1:0"
    ) as running:
        yield running.scheduler_address


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch) -> None:
    """The classes of the examples can be imported."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
