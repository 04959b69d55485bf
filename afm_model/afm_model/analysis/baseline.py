"""The baseline of a force curve: what the photodiode shows of a free cantilever, as a function of z.

Light that misses the cantilever interferes with the reflected beam and adds a wave over z; a beam that moves over the
photodiode adds a slope. Both go on in contact, where they cannot be seen. The model is a straight line and a wave of
any period, whose amplitude and phase change within `_COHERENCE` periods (a Gaussian process). The free part gives a
weight to each period and amplitude; the prediction in contact is the mean over all of them, and its uncertainty
contains their spread. Over a small part of a period a wave cannot be distinguished from a parabola: the uncertainty in
contact is then large.

C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006, sections 2.7 and 5.2.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .estimate import Estimate, binned, correlation_length

_Array = NDArray[np.float64]
_BINS = 48
"""Means of the free part that are fitted, at most."""
_FEWEST = 16
"""Of them, for a wave to be looked for."""
_COHERENCE = 1.0
"""Periods over which a wave keeps amplitude and phase."""
_LONGEST, _SHORTEST = 15.0, 8.0
"""Periods go from so many lengths of the free part down to so many bins."""
_PERIODS, _AMPLITUDES = 32, 8
_LEAST = 3e-4
"""Least noise of a mean, of the range of the whole curve: attraction far from the sample bends by less."""
_KEPT = 1e-2
"""Weight, of the largest one, below which a period does not count."""
_NODES = 33
_ODDS = 10.0
"""Of a wave to a straight line, before the curve is seen: some light interferes always."""
SURE = 0.99
"""Probability from which on the free part is taken as wavy."""


class _Wave(NamedTuple):
    """A straight line and a wave, as the free part determines them; variances in units of that of a bin."""

    weight: float
    period: float  # of the length of the free part
    power: float  # variance of the wave
    variance: float  # of a bin, in squared units of the signal


class Baseline:
    """The signal of the free cantilever over z, from the part of a curve in which it is free.

    Parameters
    ----------
    z : ndarray (n,) [m]
        Where the cantilever is free, at least 2 samples; it rises.
    signal : ndarray (n,)
        In any unit.
    top : float [m]
        Largest z at which it is asked for.
    scale : float
        Range of the whole curve, in the unit of the signal.
    """

    def __init__(self, z: _Array, signal: _Array, top: float, scale: float) -> None:
        self.width = max(z.size // _BINS, 1)
        """Samples in a mean."""
        places, means = binned(z, self.width), binned(signal, self.width)
        self._end, self._length = float(z[-1]), float(z[-1] - z[0])
        self._origin = float(means.mean())
        self._x, self._y = (places - self._end) / self._length, means - self._origin
        self._line = np.stack([np.ones_like(self._x), self._x], axis=1)
        found = self._weighed(self._x.size * (_LEAST * scale) ** 2)
        weights = np.array([each.weight for each in found])
        self.wavy = 1.0 - float(weights[0] / weights.sum())
        """Probability that the free part is not straight."""
        kept = weights > _KEPT * weights.max()
        total = float(weights[kept].sum())
        self._parts = [
            each._replace(weight=each.weight / total) for each, in_it in zip(found, kept, strict=True) if in_it
        ]
        self._counted = 1.0
        self._nodes = np.linspace(z[0], top, 8 * _NODES)
        self._means = self._predict(self._nodes, False)[0]
        # Noise over more than a bin, and what the model does not describe.
        self._counted = correlation_length(means - self.mean(places))
        self.noise = signal - self.mean(z)
        """What is left of the samples: noise."""
        self.bent = math.sqrt(float(np.mean((self._y - self._line @ (np.linalg.pinv(self._line) @ self._y)) ** 2)))
        """Rms by which the free part deviates from a straight line, in the unit of the signal."""

    @staticmethod
    def _wave(one: _Array, two: _Array, period: float) -> _Array:
        """Correlation of a wave between places, in lengths of the free part."""
        turns = np.subtract.outer(one, two) / period
        return np.asarray(np.cos(2.0 * math.pi * turns) * np.exp(-0.5 * (turns / _COHERENCE) ** 2))

    def _weighed(self, least: float) -> list[_Wave]:
        """The straight line, and waves of all periods and amplitudes, with their weights; `least`: of squared noise."""
        x, y, count = self._x, self._y, self._x.size
        rest = np.linalg.qr(self._line, mode="complete")[0][:, 2:]
        bent = rest.T @ y
        freedom = max(count - 2, 1)
        power = float(bent @ bent) + least
        if count < _FEWEST:
            return [_Wave(1.0, 1.0, 0.0, power / freedom)]
        finest = (float(np.mean(np.diff(y, 2) ** 2)) + least / count) / 6.0
        powers = np.geomspace(1.0, 10.0 + 10.0 * float(np.ptp(y)) ** 2 / finest, _AMPLITUDES)
        periods = np.geomspace(_LONGEST, _SHORTEST / count, _PERIODS)
        logs, left = np.empty((2, periods.size, powers.size))
        for i, period in enumerate(periods):
            sizes, shapes = np.linalg.eigh(rest.T @ self._wave(x, x, period) @ rest)
            gains = 1.0 + np.multiply.outer(powers, np.maximum(sizes, 0.0))
            left[i] = (shapes.T @ bent) ** 2 @ (1.0 / gains).T + least
            logs[i] = -0.5 * np.log(gains).sum(axis=1) - 0.5 * freedom * (np.log(left[i]) - math.log(power))
        # Even chances over the logarithms of period and amplitude, and as many for all as for the straight line.
        most = max(float(logs.max()), 0.0)
        weights = _ODDS * np.exp(logs - most) / logs.size
        waves = [
            _Wave(float(weights[i, j]), float(periods[i]), float(powers[j]), float(left[i, j]) / freedom)
            for i, j in np.ndindex(*logs.shape)
        ]
        return [_Wave(math.exp(-most), 1.0, 0.0, power / freedom), *waves]

    def _predict(self, z: _Array, spread: bool = True) -> tuple[_Array, _Array]:
        """Mean (n,) and covariance (n, n) of the signal at places z [m]; without `spread` an empty covariance."""
        at = (z - self._end) / self._length
        line = np.stack([np.ones_like(at), at], axis=1)
        means, covariance = [], np.zeros((z.size, z.size) if spread else (0, 0))
        for part in self._parts:
            across = part.power * self._wave(self._x, at, part.period)
            of_data = np.eye(self._x.size) + part.power * self._wave(self._x, self._x, part.period)
            both = np.linalg.solve(
                of_data, np.column_stack([self._line, self._y, across] if spread else [self._line, self._y])
            )
            of_line = np.linalg.inv(self._line.T @ both[:, :2])
            straight = of_line @ (self._line.T @ both[:, 2])
            means.append(line @ straight + across.T @ (both[:, 2] - both[:, :2] @ straight))
            if spread:
                free = line - across.T @ both[:, :2]
                own = part.power * self._wave(at, at, part.period) - across.T @ both[:, 3:] + free @ of_line @ free.T
                covariance += part.weight * part.variance * self._counted * own
        weights, each = np.array([part.weight for part in self._parts]), np.stack(means)
        if spread:
            off = each - weights @ each
            covariance += np.einsum("p,pi,pj->ij", weights, off, off)
        return self._origin + weights @ each, covariance

    def mean(self, z: ArrayLike) -> _Array:
        """The signal of the free cantilever at places z (n,) [m]."""
        from scipy.interpolate import CubicSpline  # here: a recorder needs none

        return np.asarray(CubicSpline(self._nodes, self._means)(z))

    def sum_of(self, weights: ArrayLike, z: ArrayLike) -> Estimate:
        """A weighted sum of the signal at places z [m], with its uncertainty."""
        w = np.atleast_1d(np.asarray(weights, np.float64))
        mean, covariance = self._predict(np.atleast_1d(np.asarray(z, np.float64)))
        return Estimate(float(w @ mean), math.sqrt(max(float(w @ covariance @ w), 0.0)))

    def slope(self, z: ArrayLike) -> Estimate:
        """Slope of a straight line through the signal at places z (n,) [m], as by least squares."""
        nodes = np.linspace(np.min(z), np.max(z), _NODES)
        away = nodes - nodes.mean()
        return self.sum_of(away / (away @ away), nodes)

    def modes(self, z: _Array) -> _Array:
        """How the baseline may vary between the places z [m]: rows (modes, n), independent, one uncertainty each."""
        nodes = np.linspace(z.min(), z.max(), _NODES)
        variances, shapes = np.linalg.eigh(self._predict(nodes)[1])
        kept = variances > 1e-6 * variances[-1]
        rows = (math.sqrt(size) * shape for size, shape in zip(variances[kept], shapes.T[kept], strict=True))
        return np.stack([np.interp(z, nodes, row) for row in rows])
