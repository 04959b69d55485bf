"""Settings of all tests. The environment is set here, before anything of ROS is imported."""

import gc
import sys
from collections.abc import Iterator
from pathlib import Path

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


def pytest_collection_finish() -> None:
    """What stands now lives to the end, as in a node that has started: Python need not look through it for circles.

    With all tests loaded that takes a third of a second, and nodes look for circles after each verb and recording.
    """
    gc.collect()
    gc.freeze()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the commands of the pages that no test runs here, with their reasons, if their tests have run."""
    reports = terminalreporter.stats.get("passed", [])
    if any("test_every_block_of_every_page" in report.nodeid for report in reports):
        from printed.plan import not_run

        terminalreporter.section("Printed and not run (python tests/printed lists all)")
        terminalreporter.write_line("\n".join(not_run()))


LONGEST = (
    *("test_printed_pages.py", "test_exam.py", "test_own_controller.py", "test_session_interrupted.py", "test_scan.py"),
    *("test_recorder_bad_days.py", "test_check_controller.py", "test_zeros.py"),
    *("test_coverage.py", "test_notebooks.py", "test_wrong_models.py", "test_lattice.py"),
)
"""Files that take 20 s of processor time or more; the last one where its kernels have to be compiled, which other files
then find on disk."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files over topics, which wait, among those of the model, which compute: processors are neither idle nor crowded.

    The longest ones come first, and at the end short ones of the model, so that no worker waits for another one that
    has just begun a long file. Before all of them those files that compile what all share: a session that has to
    compile may miss its time.
    """
    turns = _turns(list(dict.fromkeys(item.path for item in items)))
    items.sort(key=lambda item: turns[item.path])


def _turns(files: list[Path]) -> dict[Path, float]:
    """When each file begins, as a part of all."""
    over_topics = [file for file in files if file.parent.name in ("system", "nodes")]
    shared = [file for file in files if file.parent.name == "model"]
    others = [file for file in files if file not in {*over_topics, *shared}]
    turns = {file: -1.0 for file in shared}
    for group, until in ((over_topics, 0.85), (others, 1.0)):
        group.sort(key=lambda file: file.name not in LONGEST)
        turns |= {file: until * (place + 0.5) / len(group) for place, file in enumerate(group)}
    return turns


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
