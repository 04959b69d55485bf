"""A number with its standard uncertainty, how uncertainties add up, and how many samples count as independent."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Array = NDArray[np.float64]


class Estimate(NamedTuple):
    """A value and its standard uncertainty, both in the same unit; NaN where it is not known.

    The truth is within two uncertainties in 95 % of all records (`tools/examine.py`). If the scatter is estimated
    from few independent numbers, Student's distribution is in it, so that 68 % are within less than one.
    """

    value: float
    uncertainty: float = 0.0

    def __str__(self) -> str:
        return f"{self.value:.6g} +- {self.uncertainty:.2g}"


def same_length(**lists: ArrayLike) -> tuple[_Array, ...]:
    """Two lists of numbers, given by their names, as arrays; ValueError if they have not the same length."""
    (one, x), (other, y) = ((name, np.asarray(each, np.float64)) for name, each in lists.items())
    if x.ndim != 1 or x.shape != y.shape:
        raise ValueError(f"{one} {x.shape} and {other} {y.shape} must be two lists of the same length")
    return x, y


def positive(**numbers: float) -> None:
    """ValueError for one of these, given by their names, that is not a positive number."""
    for name, value in numbers.items():
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} = {value:g} is not allowed: it must be a positive number")


class StraightLine(NamedTuple):
    """A straight line y = slope x + intercept, as found."""

    slope: Estimate
    intercept: Estimate
    rms: float  # of the residuals, in the unit of y


def straight_line(x: ArrayLike, y: ArrayLike) -> StraightLine:
    """Straight line through points by least squares; uncertainties count the correlation of what it leaves.

    Parameters
    ----------
    x, y : array_like (n,)
        At least two points, in the order of measurement; with two the uncertainties are NaN.

    Raises
    ------
    ValueError
        If there are less than two points, or all at one x.
    """
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if x.size < 2 or x.min() == x.max():
        raise ValueError(f"a straight line needs points at two places: there are {x.size}, at {np.unique(x).size}")
    middle = float(x.mean())
    spread = float(np.sum((x - middle) ** 2))
    slope = float(np.sum((x - middle) * y)) / spread
    height = float(y.mean())
    left = y - height - slope * (x - middle)
    variance = float(left @ left) / (x.size - 2) if x.size > 2 else math.nan
    counted = variance * together(left, 2)
    return StraightLine(
        Estimate(slope, math.sqrt(counted / spread)),
        Estimate(height - slope * middle, math.sqrt(counted * (1.0 / x.size + middle * middle / spread))),
        math.sqrt(variance),
    )


def mean(y: ArrayLike) -> Estimate:
    """Mean of independent values; a single one has an uncertainty of NaN.

    Raises
    ------
    ValueError
        If no value is given.
    """
    y = np.asarray(y, np.float64)
    if y.size == 0:
        raise ValueError("a mean needs at least one sample: no sample is given")
    if y.size == 1:
        return Estimate(float(y[0]), math.nan)
    return Estimate(float(y.mean()), float(y.std(ddof=1)) / math.sqrt(y.size) * student(y.size - 1))


def propagated(function: Callable[..., float], *inputs: Estimate | float) -> Estimate:
    """Value of a function and its standard uncertainty, by central differences over those of independent inputs.

    An input without uncertainty, or of unknown one, adds none.
    """
    given: list[Any] = [each if isinstance(each, Estimate) else Estimate(float(each)) for each in inputs]
    values = [each.value for each in given]
    square = 0.0
    for i, each in enumerate(given):
        if each.uncertainty > 0.0:
            ends = [
                function(*values[:i], each.value + sign * each.uncertainty, *values[i + 1 :]) for sign in (1.0, -1.0)
            ]
            square += (0.5 * (ends[0] - ends[1])) ** 2
    return Estimate(float(function(*values)), math.sqrt(square))


_WINDOW = 5.0
"""The sum of correlations ends at this many correlation times (Sokal)."""


def correlation_length(left: ArrayLike) -> float:
    """Samples of a record that count as one: 1 + 2 times the sum of its correlations, at least 1.

    The sum is taken up to five times of itself, as A. Sokal proposed for Monte Carlo records. A record that is wrong
    in a slow way, as what a wrong model leaves, has a long one.

    Parameters
    ----------
    left : array_like (n,)
        Noise, or what a fit leaves; its mean is taken off.
    """
    y = np.asarray(left, np.float64)
    y = y - y.mean()
    power = float(y @ y)
    if y.size < 3 or power == 0.0:
        return 1.0
    spectrum = np.abs(np.fft.rfft(y, 2 * y.size)) ** 2
    correlation = np.fft.irfft(spectrum)[: y.size] / power
    sums = 2.0 * np.cumsum(correlation) - 1.0
    enough = np.flatnonzero(np.arange(y.size) >= _WINDOW * sums)
    length = float(sums[enough[0]]) if enough.size else float(sums.max())
    return min(max(length, 1.0), float(y.size))


_STRETCHES = 4.0
"""Correlation lengths to a period of the fastest cosine in which noise is still taken as slow, half of them."""
_SLOWEST = 10
"""Cosines at most."""


def student(freedom: float) -> float:
    """Return the factor of a standard deviation that is estimated from so many independent numbers.

    With it 95 % are within two standard deviations (Student).
    """
    from scipy.special import stdtrit  # here: a recorder needs none

    return 0.5 * float(stdtrit(freedom, 0.5 + 0.5 * math.erf(math.sqrt(2.0))))


def together(left: ArrayLike, fitted: int = 1) -> float:
    """Samples that count as one in the uncertainty of what was fitted to a record, for 95 % within two of it.

    Only the slow part of noise matters to a mean or a slope. It is the mean square of the record's slowest cosines, of
    which what was fitted has taken as many as it has parameters (after Lazarus, Lewis, Stock and Watson,
    J. Bus. Econ. Stat. 36 (2018) 541). Each weighs as its period, so that 1/f noise counts: drift slower than the
    record leaves no trace in it, and 95 % become 75 to 90 %. Student's factor is in it.

    Parameters
    ----------
    left : array_like (n,)
        What the fit leaves, in the order of measurement.
    fitted : int
        Number of parameters of the fit.

    Returns
    -------
    float
        Variance of a sample, of n - `fitted`, times this over n is that of a mean; NaN unless n > `fitted`.
    """
    y = np.asarray(left, np.float64)
    power = float(y @ y)
    if y.size <= fitted:
        return math.nan
    if power == 0.0:
        return 1.0
    count = int(min(max(y.size / (_STRETCHES * correlation_length(y)), 2.0), _SLOWEST, y.size - fitted))
    at = (np.arange(y.size) + 0.5) * math.pi / y.size
    waves = np.arange(fitted, fitted + count)
    weights = fitted / waves
    slow = np.array([float(np.cos(k * at) @ y) ** 2 for k in waves]) @ weights / weights.sum() * 2.0 / y.size
    # Welch and Satterthwaite: what the weighted sum knows as well as so many equal ones.
    freedom = float(weights.sum() ** 2 / (weights @ weights))
    return float(slow) * (y.size - fitted) / power * student(freedom) ** 2


def noise_of(sums: list[tuple[_Array, _Array]]) -> float:
    """Uncertainty of a weighted sum of samples, for 95 % within two of it: its scatter along stretches of noise alone.

    So it is right for samples fewer than those that count as one, too.

    Parameters
    ----------
    sums : list of (ndarray (m,), ndarray (n,))
        Weights, and noise as it is in the samples; of several sums the uncertainty of one of them. Where all noise is
        shorter than the weights, it counts by `together`.
    """
    slid = [(weights.size, noise - noise.mean(), weights) for weights, noise in sums if noise.size >= weights.size]
    if not slid:
        weights, noise = max(sums, key=lambda each: each[1].size)
        return float(np.linalg.norm(weights)) * math.sqrt(float(noise.var()) * together(noise - noise.mean()))
    each = np.concatenate([np.correlate(noise, weights, "valid") for _, noise, weights in slid])
    return math.sqrt(float(np.mean(each**2))) * student(sum(noise.size / size for size, noise, _ in slid))


def correlated_mean(y: ArrayLike) -> Estimate:
    """Mean of samples that may be correlated, in the order of measurement; a single one has an uncertainty of NaN.

    Raises
    ------
    ValueError
        If no value is given.
    """
    y = np.asarray(y, np.float64)
    if y.size < 2:
        return mean(y)
    middle = float(y.mean())
    return Estimate(middle, float(y.std(ddof=1)) * math.sqrt(together(y - middle) / y.size))


def binned(y: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Means over stretches of so many samples; an incomplete last one is dropped."""
    return np.asarray(y[: y.size // width * width].reshape(-1, width).mean(axis=1))
