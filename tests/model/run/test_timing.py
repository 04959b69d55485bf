"""Histograms, the stopwatch, and that a run has no clock of its own."""

import ast
from pathlib import Path

import numpy as np
import pytest

import afm_model.run
from afm_model.run.timing import Histogram, Stopwatch


def test_percentiles_are_those_of_the_durations_to_a_bin(rng: np.random.Generator) -> None:
    durations = rng.lognormal(np.log(1e-4), 1.0, 20_000)
    histogram = Histogram()
    for part in np.array_split(durations, 7):
        histogram.add(part)
    expected = np.percentile(durations, [50.0, 99.0, 99.9, 100.0], method="inverted_cdf")
    assert histogram.summary == pytest.approx(expected, rel=0.013)  # bins are 1.2 % wide
    assert histogram.summary[3] == durations.max()


def test_duration_that_is_not_known_is_left_out_and_of_none_nothing_is_known() -> None:
    histogram = Histogram()
    histogram.add(np.array([np.nan, np.inf]))
    assert np.isnan(histogram.summary).all()
    histogram.add(np.array([np.nan, 2e-3]))
    assert histogram.summary == [2e-3] * 4


def test_durations_beyond_the_bins_are_counted_in_the_outer_ones() -> None:
    histogram = Histogram()
    histogram.add(np.array([0.0, 0.0, 1e6]))
    assert histogram.percentiles(50.0)[0] < 1.1e-7
    assert histogram.largest == 1e6


def test_stopwatch_counts_only_between_start_and_stop() -> None:
    now = 5.0
    watch = Stopwatch(lambda: now)
    assert watch.elapsed == 0.0
    watch.start()
    now = 7.0
    watch.start()  # it runs already
    assert watch.elapsed == 2.0
    watch.stop()
    now = 100.0
    assert watch.elapsed == 2.0
    watch.stop()
    watch.start()
    now = 101.0
    assert watch.elapsed == 3.0


def test_no_file_of_the_run_knows_the_time_or_a_thread() -> None:
    files = list(Path(afm_model.run.__path__[0]).glob("*.py"))
    assert len(files) > 10
    for file in files:
        for node in ast.walk(ast.parse(file.read_text())):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import | ast.ImportFrom) else []
            module = node.module if isinstance(node, ast.ImportFrom) and not node.level else None
            assert not {module, *names} & {"time", "datetime", "threading", "asyncio"}, file.name
