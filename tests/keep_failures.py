"""A plugin of pytest: `--keep-failures FILE` writes down how each test failed, whatever a second try makes of it."""

from pathlib import Path

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option."""
    parser.addoption("--keep-failures", metavar="FILE", type=Path, help="append every failure, with its report, here")


def pytest_configure(config: pytest.Config) -> None:
    """Keep failures if asked to; where workers run the tests, their reports come together in the one that has none."""
    path = config.getoption("keep_failures")
    if path and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Keeper(path))


class _Keeper:
    """Appends each failure as it comes: what a run that is interrupted has found is kept too."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            sections = "\n".join(f"--- {name}\n{text}" for name, text in report.sections)
            with self._path.open("a") as file:
                file.write(f"=== {report.nodeid} ({report.when})\n{report.longreprtext}\n{sections}\n\n")
