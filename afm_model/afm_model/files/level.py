"""Levelling of a picture for the eye: a plane, or line by line. NaN stays NaN and is never fitted.

`exclude` is True where the surface is not to be fitted (a particle, a step); it is levelled with the rest.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
_ENOUGH = 65536
"""Pixels that a plane of the background is fitted to at most."""
_NEAR = 4.0
"""Distance of what belongs to the background, over the median of all distances."""
_ROUNDS = 40
"""Of the fit, which each time counts what lies far off less."""
_Mask = NDArray[np.bool_]


def _fitted(values: _Array, exclude: _Mask | None) -> _Mask:
    if values.ndim != 2:
        raise ValueError(f"a picture has 2 dimensions, this one {values.ndim}")
    if exclude is None:
        return np.isfinite(values)
    if exclude.shape != values.shape:
        raise ValueError(f"exclude is {exclude.shape}: it must be as the picture, {values.shape}")
    return np.isfinite(values) & ~exclude.astype(bool)


def plane(values: _Array, exclude: _Mask | None = None) -> _Array:
    """The picture without the plane of least squares through it.

    Parameters
    ----------
    values : ndarray (lines, pixels)
    exclude : ndarray (lines, pixels) of bool, optional

    Returns
    -------
    ndarray (lines, pixels)
        Mean 0 over what was fitted. With a single line or column fitted: without its line of least squares. With
        nothing to fit: as it was.

    Raises
    ------
    ValueError
        If the arrays are not pictures of one size.
    """
    return _level(values, exclude, 1)


def background(values: _Array, exclude: _Mask | None = None) -> _Array:
    """The picture without the plane that most of it lies on: hills and holes on less than half of it do not tilt it.

    As `plane`, but by least absolute distances, then by what is near that plane. 0 is the height of the background.
    """
    return _level(values, exclude, _ROUNDS)


def _level(values: _Array, exclude: _Mask | None, rounds: int) -> _Array:
    fitted = _fitted(values, exclude)
    if not fitted.any():
        return values.copy()
    rows, columns = (np.linspace(-1.0, 1.0, count) if count > 1 else np.zeros(1) for count in values.shape)
    y, x = np.meshgrid(rows, columns, indexing="ij")
    terms = np.stack([np.ones_like(x), x, y])
    # By the mean first: heights of nanometres may stand on micrometres.
    flat = values - values[fitted].mean()
    matrix, heights = terms[:, fitted].T, flat[fitted]
    if rounds > 1:
        every = -(-len(heights) // _ENOUGH)
        matrix, heights = matrix[::every], heights[::every]
    weights = np.ones(len(heights))
    least = 1e-9 * float(np.abs(heights).max()) or 1.0
    for _ in range(rounds):
        found, *_ = np.linalg.lstsq(matrix * weights[:, None], heights * weights, rcond=None)
        left = np.abs(heights - matrix @ found)
        weights = 1.0 / np.sqrt(np.maximum(left, least))
    if rounds > 1:
        # What is about on the plane, by least squares: distances alone are pulled aside by what is not.
        near = left <= max(_NEAR * float(np.median(left)), least)
        found, *_ = np.linalg.lstsq(matrix[near], heights[near], rcond=None)
    return np.asarray(flat - np.tensordot(found, terms, axes=1))


def lines(
    values: _Array,
    by: Literal["mean", "median", "polynomial"] = "median",
    degree: int = 1,
    exclude: _Mask | None = None,
) -> _Array:
    """The picture with every line levelled by itself, which removes drift and jumps between lines.

    Parameters
    ----------
    values : ndarray (lines, pixels)
    by : str
        What is taken off a line: its mean, its median, or its polynomial of least squares.
    degree : int
        Of the polynomial, 0 to 10.
    exclude : ndarray (lines, pixels) of bool, optional

    Returns
    -------
    ndarray (lines, pixels)
        A line with too little to fit stays as it was.

    Raises
    ------
    ValueError
        If the arrays are not pictures of one size, for another `by`, or another `degree`.
    """
    if by not in ("mean", "median", "polynomial"):
        raise ValueError(f"lines are levelled by mean, median or polynomial, not by {by!r}")
    if by == "polynomial" and not 0 <= degree <= 10:
        raise ValueError(f"a polynomial of degree {degree} is not allowed: 0 to 10")
    fitted = _fitted(values, exclude)
    levelled = values.copy()
    x = np.linspace(-1.0, 1.0, values.shape[1])
    for row, use in zip(levelled, fitted, strict=True):
        if by == "polynomial":
            if use.sum() > degree:
                row -= np.polynomial.Polynomial.fit(x[use], row[use], degree, domain=(-1.0, 1.0))(x)
        elif use.any():
            row -= np.mean(row[use]) if by == "mean" else np.median(row[use])
    return levelled
