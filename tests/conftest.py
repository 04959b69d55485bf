"""Settings of all tests. The environment is set here, before anything of ROS is imported."""

import sys
from collections.abc import Iterator

import pytest
from _pytest import approx
from environment import prepare
from hypothesis import settings

prepare()

pytest.register_assert_rewrite("support")

# In SI units 1e-12, which pytest adds by itself, is more than any energy: only what a test says is allowed.
approx.ApproxScalar.DEFAULT_ABSOLUTE_TOLERANCE = 0.0

# Reproducible: the same examples on every machine, no deadline on a shared one. `make test-long` takes the other one.
settings.register_profile("reproducible", derandomize=True, deadline=None, max_examples=100, database=None)
settings.register_profile("random", deadline=None, max_examples=1000, database=None, print_blob=True)
settings.load_profile("reproducible")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long files first, so that no worker waits at the end for another one that has just begun a long file.

    Before them those files that compile what all share: a session that has to compile may miss its time.
    """
    items.sort(key=_turn)


def _turn(item: pytest.Item) -> int:
    return {"model": 0, "system": 1, "nodes": 2}.get(item.path.parent.name, 3)


@pytest.fixture(autouse=True)
def _no_process_outlives_its_test() -> Iterator[None]:
    """What a test leaves running is its failure and is ended, so that the next one finds an empty graph."""
    yield
    if "rclpy" in sys.modules:  # the tests of the model need no ROS
        import support

        assert support.end_all_processes() == {}


@pytest.fixture(scope="session", autouse=True)
def _no_shared_memory_outlives_the_run() -> Iterator[None]:
    """Files of the middleware that nobody uses any more break or stall later runs."""
    yield
    if "rclpy" in sys.modules:
        import support

        support.note_shared_memory()
        assert support.shared_memory_left() == []
