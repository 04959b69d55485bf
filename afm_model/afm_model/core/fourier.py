"""Filter maps in two dimensions by the Fourier transform, in a fixed order of operations (see `elementary`)."""

import math

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import routine
from .elementary import sincos_each


def filtered(values: NDArray[np.float64], gain: NDArray[np.float64]) -> NDArray[np.float64]:
    """A periodic square map (n, n) with each of its waves taken `gain` times.

    Parameters
    ----------
    values : ndarray (n, n)
    gain : ndarray (n, n)
        Of the waves (i, j), the same for (n - i, n - j).
    """
    n = len(values)
    factors = _factors(n)
    s, c = sincos_each(2.0 * math.pi * np.arange(n) / n)
    root = c - 1j * s
    waves = _transform(_transform(values.astype(np.complex128), factors, root).T.copy(), factors, root)
    waves *= gain.T
    found = _transform(_transform(waves, factors, root.conj()).T.copy(), factors, root.conj())
    return np.asarray(found.real / (n * n))


def _factors(n: int) -> NDArray[np.int64]:
    found = []
    p = 2
    while n > 1:
        while n % p == 0:
            found.append(p)
            n //= p
        p += 1
    return np.array(found, dtype=np.int64)


@routine
def _transform(
    values: NDArray[np.complex128], factors: NDArray[np.int64], root: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Of each row, by any prime factors: Stockham's order. `root` holds the powers of exp(-2 pi i / n)."""
    rows, n = values.shape
    for row in range(rows):
        x, y = values[row].copy(), np.empty(n, np.complex128)
        done = 1
        for p in factors:
            left = n // (done * p)
            for j in range(left):
                for k in range(done):
                    for q in range(p):
                        wave = k + done * q
                        total = x[j * done + k]
                        for r in range(1, p):
                            total += x[(j + left * r) * done + k] * root[r * wave % (done * p) * left]
                        y[j * done * p + wave] = total
            x, y = y, x
            done *= p
        values[row] = x
    return values
