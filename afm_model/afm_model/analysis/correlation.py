"""How many samples of a noisy record count as independent."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .estimate import Estimate

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
    """Mean of samples that may be correlated, in the order of measurement; NaN as uncertainty of a single one.

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
    independent = y.size / correlation_length(y)
    return Estimate(float(y.mean()), float(y.std(ddof=1)) / math.sqrt(independent))


def binned(y: NDArray[np.float64], width: int) -> NDArray[np.float64]:
    """Means over stretches of so many samples; what does not fill the last one is left out."""
    return np.asarray(y[: y.size // width * width].reshape(-1, width).mean(axis=1))
