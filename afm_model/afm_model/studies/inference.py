"""A scenario as a simulator for inference: parameters in, numbers of what was measured out."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import ParameterError
from ..parameters.scenario import Scenario, load_scenario
from .many import simulate_many

if TYPE_CHECKING:
    import xarray

_TOGETHER = 512
"""Sets whose signals are in memory at once."""
_SEED = "afm_sim_node.plant.seed"


class BatchSimulator:
    """Simulate a scenario for each row of parameters, and summarise each run in some numbers.

    `simulator(theta)` is what packages of simulation-based inference and of approximate Bayesian computation call. A
    row whose parameters are refused, whose motion diverges or whose summary is not finite is NaN; no row raises.

    Parameters
    ----------
    scenario : Scenario or str
        Or its name.
    names : sequence of str
        Parameters in the columns of theta, such as "afm_sim_node.contact.tau"; "afm_sim_node" may be left out.
    summarise : callable
        summarise(runs): numbers (n, q) of the Dataset of `simulate_many` with n runs, each from its own run alone.
    variables : sequence of str
        Of `simulate_many`, which the Dataset holds.
    seed : int
        Of the noise. A row has the noise of its parameters and of this: the same numbers in any batch.

    Raises
    ------
    ParameterError
        If a name is unknown, or the scenario itself cannot be run or summarised.
    ImportError
        If xarray is not installed.
    """

    def __init__(
        self,
        scenario: Scenario | str,
        names: Sequence[str],
        summarise: Callable[[xarray.Dataset], ArrayLike],
        *,
        variables: Sequence[str] = ("position", "deflection", "lateral_force"),
        seed: int = 0,
    ) -> None:
        self._scenario = load_scenario(scenario) if isinstance(scenario, str) else scenario
        self._names = [name if name.startswith("afm_") else f"afm_sim_node.{name}" for name in names]
        if _SEED in self._names:
            raise ParameterError("plant.seed is not allowed among the names: the call takes seeds")
        self._summarise, self._variables, self._seed = summarise, tuple(variables), seed
        # Once as it is: whoever has misspelt a name or a variable is to learn it here, and not of rows of NaN.
        simulate_many(self._scenario, {name: [] for name in self._names}, grid=False)
        run = simulate_many(self._scenario, {_SEED: [seed]}, variables=self._variables)
        if error := str(run.error.values[0]):
            raise ParameterError(f"the scenario cannot be run as it is: {error}")
        self.count = np.asarray(summarise(run), np.float64).reshape(1, -1).shape[1]
        """Numbers of a summary."""

    def __call__(self, theta: ArrayLike, seeds: ArrayLike | None = None) -> NDArray[np.float64]:
        """Summaries (n, count) of parameters (n, p), or (count,) of (p,).

        Parameters
        ----------
        theta : array_like
            In SI units.
        seeds : array_like of int, optional
            Of the noise of each row, 0 to 2^31 - 1, where the same parameters are to be measured several times.

        Raises
        ------
        ValueError
            If the shape is not that of the names, or of the seeds.
        """
        given = np.asarray(theta, np.float64)
        rows = np.atleast_2d(given)
        if rows.ndim != 2 or rows.shape[1] != len(self._names):
            raise ValueError(
                f"theta has shape {given.shape}: it must be (n, {len(self._names)}), a column for each name"
            )
        numbers = [self._seed_of(row) for row in rows] if seeds is None else np.atleast_1d(np.asarray(seeds)).tolist()
        if len(numbers) != len(rows):
            raise ValueError(f"{len(numbers)} seeds for {len(rows)} rows of theta: it must be one for each")
        found = np.full((len(rows), self.count), np.nan)
        for first in range(0, len(rows), _TOGETHER):
            part = slice(first, first + _TOGETHER)
            found[part] = self._summaries(rows[part], numbers[part])
        found[~np.isfinite(found).all(axis=1)] = np.nan
        return found if given.ndim == 2 else found[0]

    def _summaries(self, rows: NDArray[np.float64], seeds: list[int]) -> NDArray[np.float64]:
        found = np.full((len(rows), self.count), np.nan)
        columns: dict[str, Any] = {**dict(zip(self._names, rows.T, strict=True)), _SEED: seeds}
        runs = simulate_many(self._scenario, columns, grid=False, variables=self._variables)
        whole = np.flatnonzero(runs.error.values == "")
        if len(whole):
            summaries = np.asarray(self._summarise(runs.isel(set=whole)), np.float64)
            found[whole] = summaries.reshape(len(whole), self.count)
        return found

    def _seed_of(self, row: NDArray[np.float64]) -> int:
        # -0.0 is 0.0.
        digest = hashlib.sha256(f"{self._seed} {(row + 0.0).tolist()}".encode()).digest()
        return int.from_bytes(digest[:4], "little") >> 1
