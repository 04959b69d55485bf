"""What studies run on."""

from collections.abc import Iterator

import pytest
from clusters import cluster_here

from .short import EXAMPLES


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """Address of a running scheduler with a worker, in this process."""
    with cluster_here() as address:
        yield address


@pytest.fixture
def own(monkeypatch: pytest.MonkeyPatch) -> None:
    """The classes of the examples can be imported."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
