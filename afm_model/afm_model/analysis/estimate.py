"""A number with its standard uncertainty, how uncertainties add up, and how many samples count as independent."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

_Array = NDArray[np.float64]


class Estimate(NamedTuple):
    """A value and its standard uncertainty, both in the same unit; NaN where it is not known."""

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


class StraightLine(NamedTuple):
    """A straight line y = slope x + intercept, as found."""

    slope: Estimate
    intercept: Estimate
    rms: float  # of the residuals, in the unit of y


def straight_line(x: ArrayLike, y: ArrayLike) -> StraightLine:
    """Straight line through points by least squares.

    Parameters
    ----------
    x, y : array_like (n,)
        At least two points; with two the uncertainties are NaN.

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
    return StraightLine(
        Estimate(slope, math.sqrt(variance / spread)),
        Estimate(height - slope * middle, math.sqrt(variance * (1.0 / x.size + middle * middle / spread))),
        math.sqrt(variance),
    )


def mean(y: ArrayLike, together: float = 1.0) -> Estimate:
    """Mean of samples, of which so many `together` count as one; a single one has an uncertainty of NaN.

    Raises
    ------
    ValueError
        If there are none.
    """
    y = np.asarray(y, np.float64)
    if y.size == 0:
        raise ValueError("a mean needs at least one sample: there is none")
    if y.size == 1:
        return Estimate(float(y[0]), math.nan)
    return Estimate(float(y.mean()), float(y.std(ddof=1)) / math.sqrt(y.size / together))


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


def correlated_mean(y: ArrayLike) -> Estimate:
    """`mean` of samples that may be correlated, in the order of measurement; raises ValueError as that does."""
    y = np.asarray(y, np.float64)
    return mean(y, correlation_length(y) if y.size else 1.0)


def binned(y: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Means over stretches of so many samples; an incomplete last one is dropped."""
    return np.asarray(y[: y.size // width * width].reshape(-1, width).mean(axis=1))
