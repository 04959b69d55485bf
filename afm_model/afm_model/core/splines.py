"""Make cubic splines at even spacing from + - * / alone, in a fixed order of operations (see `elementary`)."""

import math

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import routine

_Array = NDArray[np.float64]
_POLE = math.sqrt(3.0) - 2.0
_TERMS = 32
"""Powers of the pole that count."""


def slopes(values: _Array, spacing: float) -> _Array:
    """Slope at each of five or more samples (n,), exact for polynomials of degree 4."""
    v = values
    found = np.empty_like(v)
    found[2:-2] = 8.0 * (v[3:-1] - v[1:-3]) - (v[4:] - v[:-4])
    for ends, sign in ((v[:5], 1.0), (v[:-6:-1], -1.0)):
        a, b, c, d, e = ends
        first = sign * (-25.0 * a + 48.0 * b - 36.0 * c + 16.0 * d - 3.0 * e)
        second = sign * (-3.0 * a - 10.0 * b + 18.0 * c - 6.0 * d + e)
        found[[0, 1] if sign > 0.0 else [-1, -2]] = first, second
    return found / (12.0 * spacing)


@routine
def clamped_spline(values: _Array) -> _Array:
    """Spline with slope 0 at both ends through samples (n,) at 0, 1, 2 ...: of each piece c with x = sum c[i] s^i,
    (n - 1, 4).
    """
    n = values.size
    slope, upper = np.zeros(n), np.zeros(n)
    # slope[i-1] + 4 slope[i] + slope[i+1] = 3 (values[i+1] - values[i-1]), by elimination.
    for i in range(1, n - 1):
        upper[i] = 1.0 / (4.0 - upper[i - 1])
        slope[i] = (3.0 * (values[i + 1] - values[i - 1]) - slope[i - 1]) * upper[i]
    for i in range(n - 2, 0, -1):
        slope[i] -= upper[i] * slope[i + 1]
    found = np.empty((n - 1, 4))
    for i in range(n - 1):
        rise = values[i + 1] - values[i]
        found[i, 0], found[i, 1] = values[i], slope[i]
        found[i, 2], found[i, 3] = 3.0 * rise - 2.0 * slope[i] - slope[i + 1], slope[i] + slope[i + 1] - 2.0 * rise
    return found


def b_spline_coefficients(values: _Array, wrap: bool) -> _Array:
    """Coefficients of the cubic B-spline through a map (rows, columns), repeated (`wrap`) or mirrored at its borders.

    M. Unser, A. Aldroubi, M. Eden, IEEE Trans. Signal Process. 41 (1993) 834, doi:10.1109/78.193221.
    """
    along = _coefficients(np.ascontiguousarray(values, dtype=np.float64), wrap)
    return np.ascontiguousarray(_coefficients(np.ascontiguousarray(along.T), wrap).T)


@routine
def _coefficients(values: _Array, wrap: bool) -> _Array:
    """Along each row: a recursive filter forwards, then one backwards."""
    rows, n = values.shape
    found = 6.0 * values
    if n == 1:
        return values.copy()
    period = n if wrap else 2 * n - 2
    whole = 1.0  # 1 - pole^period
    for _ in range(period):
        whole *= _POLE
    whole = 1.0 - whole
    for row in range(rows):
        c = found[row]
        first, weight = 0.0, 1.0
        for k in range(min(_TERMS, period)):
            at = (-k) % period
            first += weight * c[at if at < n else period - at]
            weight *= _POLE
        c[0] = first / whole
        for i in range(1, n):
            c[i] += _POLE * c[i - 1]
        if wrap:
            last, weight = 0.0, 1.0
            for k in range(min(_TERMS, period)):
                last += weight * c[(n - 1 + k) % n]
                weight *= _POLE
            c[n - 1] = -_POLE * last / whole
        else:
            c[n - 1] = _POLE / (_POLE * _POLE - 1.0) * (c[n - 1] + _POLE * c[n - 2])
        for i in range(n - 2, -1, -1):
            c[i] = _POLE * (c[i + 1] - c[i])
    return found


def weighted(values: _Array, along_y: tuple[float, ...], along_x: tuple[float, ...], wrap: bool) -> _Array:
    """Sum of the neighbours of each place of a map (rows, columns), with weights; both are odd in number."""
    rows, columns = values.shape
    half_y, half_x = len(along_y) // 2, len(along_x) // 2
    padded = np.pad(values, ((half_y, half_y), (half_x, half_x)), mode="wrap" if wrap else "reflect")
    found = np.zeros((rows, columns))
    for i, of_row in enumerate(along_y):
        for j, of_column in enumerate(along_x):
            if of_row * of_column != 0.0:
                found += of_row * of_column * padded[i : rows + i, j : columns + j]
    return found
