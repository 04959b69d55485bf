"""Statistics of the signals of a recording, gathered stretch by stretch: a long one is never in memory as a whole."""

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .layout import PlotSignal

_Array = NDArray[np.float64]
_LATE = 1.5
"""Periods between two rows from which on something is missing between them."""


@dataclass(frozen=True)
class Statistics:
    """Of one signal, or of one axis of it, in SI units; NaN where there are no numbers."""

    name: str
    unit: str
    rows: int
    period: float
    """Between two rows [s]."""
    begin: float
    end: float
    """Simulated time of the first and the last row [s]."""
    low: float
    high: float
    mean: float
    rms: float
    unknown: int
    """Rows that are NaN."""
    gaps: list[tuple[float, int]]
    """Simulated time after which rows are missing [s], and how many."""


@dataclass
class Gathered:
    """What is kept of the rows of a signal."""

    rows: int = 0
    _ends: list[tuple[int, int]] = field(default_factory=list)
    _periods: list[tuple[int, float]] = field(default_factory=list)  # of how many rows, each [ns]
    _late: list[tuple[int, float]] = field(default_factory=list)  # after which time, how long [ns]
    _sums: list[_Array] = field(default_factory=list)  # least, largest, sum, sum of squares, number; per axis

    def put(self, times: NDArray[np.int64], values: _Array) -> None:
        """Some rows: times (n,) [ns], values (n, width)."""
        if not len(times):
            return
        self.rows += len(times)
        step, count = int(times[min(1, len(times) - 1)] - times[0]), len(times)
        if count > 1 and times[-1] - times[0] == (count - 1) * step:
            self._periods.append((count - 1, float(step)))  # rows stand on a grid: none is missing
        elif count > 1:
            steps = np.diff(times)
            if steps.min() < 0:
                times = np.sort(times)
                steps = np.diff(times)
            period = float(np.median(steps)) if steps.max() > _LATE * steps.min() else float(steps.mean())
            self._periods.append((len(steps), period))
            late = np.flatnonzero(steps > _LATE * period)
            self._late += [(int(times[i]), float(steps[i])) for i in late]
        self._ends.append((int(times[0]), int(times[-1])))
        v = np.ascontiguousarray(values.T)  # far faster than along narrow rows
        total, number = v.sum(axis=1), np.full(len(v), float(count))
        low, high = v, v
        if np.isnan(total).any():
            known = ~np.isnan(v)
            low, high, v = np.where(known, v, np.inf), np.where(known, v, -np.inf), np.where(known, v, 0.0)
            total, number = v.sum(axis=1), known.sum(axis=1).astype(float)
        self._sums.append(np.array([low.min(axis=1), high.max(axis=1), total, np.einsum("ij,ij->i", v, v), number]))

    def statistics(self, signal: PlotSignal) -> list[Statistics]:
        """Of each axis."""
        period = max(self._periods, default=(0, math.nan))[1]
        ends = sorted(self._ends)
        late = self._late + [
            (last, float(first - last)) for (_, last), (first, _) in pairwise(ends) if first - last > _LATE * period
        ]
        gaps = [(time / 1e9, round(step / period) - 1) for time, step in sorted(late)]
        sums = np.array(self._sums)
        low, high = sums[:, 0].min(axis=0), sums[:, 1].max(axis=0)
        total, squares, count = sums[:, 2:].sum(axis=0)
        made = []
        for i, axis in enumerate(("x", "y", "z") if signal.axes else ("",)):
            n = count[i] or math.nan
            values = (low[i], high[i], total[i] / n, math.sqrt(squares[i] / n))
            least, largest, mean, rms = (float(value) if n > 0 else math.nan for value in values)
            made.append(
                Statistics(
                    name=f"{signal.name}.{axis}" if axis else signal.name,
                    unit=signal.si_unit,
                    rows=self.rows,
                    period=period / 1e9,
                    begin=ends[0][0] / 1e9,
                    end=ends[-1][1] / 1e9,
                    low=least,
                    high=largest,
                    mean=mean,
                    rms=rms,
                    unknown=self.rows - int(count[i]),
                    gaps=gaps,
                )
            )
        return made
