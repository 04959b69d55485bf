"""A scenario as a simulator of parameters: rows of any batch, what cannot be simulated, noise."""

import contextlib
import io
import re
import textwrap
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from afm_model import ParameterError, Scenario, changed, load_scenario, simulate
from afm_model.studies.inference import BatchSimulator

ROOT = Path(__file__).resolve().parents[3]
NAMES = ("contact.tau", "detector.noise")


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    """Short, of which each run takes a millisecond."""
    found = load_scenario("open_loop")
    values = {"run.duration": 1e-3, "plant.control_period": 2e-5, "detector.sample_period": 2e-5, "score.start": 0.0}
    return replace(found, sim=changed(found.sim, values))


def spread(runs: Any) -> Any:
    return np.column_stack([runs.position.values[:, :, 0].std(axis=1), runs.deflection.values.std(axis=1)])


def test_a_row_has_the_same_bits_alone_in_another_order_and_in_any_batch(scenario: Scenario) -> None:
    simulator = BatchSimulator(scenario, NAMES, spread)
    theta = np.random.default_rng(1).uniform([0.6e9, 0.01], [1.2e9, 0.04], (40, 2))
    found = simulator(theta)
    assert found.shape == (40, 2) and len(np.unique(found[:, 1])) == 40
    np.testing.assert_array_equal(simulator(theta[::-1])[::-1], found)
    np.testing.assert_array_equal([simulator(row) for row in theta[:3]], found[:3])


def test_its_runs_are_those_of_simulate(scenario: Scenario) -> None:
    found = BatchSimulator(scenario, NAMES, spread)([[0.9e9, 0.02]], seeds=[5])
    alone = simulate(
        changed(scenario.sim, {"contact.tau": 0.9e9, "detector.noise": 0.02, "plant.seed": 5}), scenario.controller
    )
    np.testing.assert_allclose(found[0], [alone.position[:, 0].std(), alone.deflection.std()], rtol=1e-12)


def test_rows_that_cannot_be_simulated_are_nan_and_leave_the_others_as_they_are(scenario: Scenario) -> None:
    simulator = BatchSimulator(scenario, NAMES, spread)
    theta = np.array([[0.9e9, 0.02], [-1.0, 0.02], [np.nan, 0.02], [0.8e9, np.inf], [1e300, 0.02]])
    found = simulator(theta)
    np.testing.assert_array_equal(np.isnan(found).all(axis=1), np.isnan(found).any(axis=1))
    assert np.isfinite(found[0]).all() and np.isnan(found[1:4]).all()
    np.testing.assert_array_equal(found[0], simulator(theta[0]))
    assert np.isnan(simulator(theta[1:3])).all()
    assert simulator(theta[:0]).shape == (0, 2)


def test_a_summary_that_is_not_finite_makes_its_row_nan(scenario: Scenario) -> None:
    simulator = BatchSimulator(scenario, NAMES, lambda runs: [[1.0, np.inf]] * runs.sizes["set"])
    assert np.isnan(simulator([[0.9e9, 0.02]])).all()


def test_noise_is_another_with_other_seeds_and_another_seed(scenario: Scenario) -> None:
    simulator, row = BatchSimulator(scenario, NAMES, spread), [0.9e9, 0.02]
    twice = simulator([row, row], seeds=[1, 2])
    assert (twice[0] != twice[1]).any()
    assert (BatchSimulator(scenario, NAMES, spread, seed=1)(row) != simulator(row)).any()


def test_what_nobody_can_simulate_is_refused_before_a_row_is(scenario: Scenario) -> None:
    with pytest.raises(ParameterError, match=r"unknown parameter .*contact\.tua.*did you mean.*contact\.tau"):
        BatchSimulator(scenario, ["contact.tua"], spread)
    with pytest.raises(ParameterError, match="unknown variable depth"):
        BatchSimulator(scenario, NAMES, spread, variables=["depth"])
    with pytest.raises(ParameterError, match=r"plant\.seed is not allowed among the names"):
        BatchSimulator(scenario, ["plant.seed"], spread)
    with pytest.raises(ValueError, match=r"theta has shape \(3,\): it must be \(n, 2\)"):
        BatchSimulator(scenario, NAMES, spread)([1.0, 2.0, 3.0])
    with pytest.raises(ValueError, match="1 seeds for 2 rows"):
        BatchSimulator(scenario, NAMES, spread)([[0.9e9, 0.02]] * 2, seeds=[1])


def test_example_of_the_docs_prints_what_they_say() -> None:
    text = (ROOT / "docs" / "sweep.md").read_text()
    program = re.search(r"<!-- inference -->\n```python\n(.*?)```", text, re.DOTALL)
    assert program
    with contextlib.redirect_stdout(io.StringIO()) as out:
        exec(program[1], {})
    assert textwrap.indent(out.getvalue(), "    ") in text
