"""The path of the apex of a spherical tip that rolls over a map of heights: a dilation by a ball, and nothing rounded.

Only the places that are asked for are computed, tile by tile: a tile fits into the processor's cache, and the far
offsets of a tile are left out where no height around it can reach what is found already.
"""

import math

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]
_TILE = 96
"""Side of a tile [places]."""
_BETWEEN = 32
"""Offsets from one look at what the rest can still change to the next."""


def offsets_under(R: float, relief: float, step_x: float, step_y: float) -> tuple[NDArray[np.intp], _Array]:
    """Return the pixels under a ball that can touch a relief, from the middle outwards.

    Parameters
    ----------
    R : float
        Radius of the ball [m].
    relief : float
        Largest height less least height of the map [m]. Where the ball is higher than that, nothing touches it.
    step_x, step_y : float
        Size of a pixel [m].

    Returns
    -------
    (ndarray (n, 2) of int, ndarray (n,))
        Rows and columns from the middle, and heights of the ball over its lowest point, as negative numbers [m],
        largest first.
    """
    reach = min(R, math.sqrt(2.0 * R * relief) * (1.0 + 1e-6) + max(step_x, step_y))
    half_x, half_y = int(reach / step_x), int(reach / step_y)
    columns, rows = np.meshgrid(np.arange(-half_x, half_x + 1), np.arange(-half_y, half_y + 1))
    x, y = step_x * columns, step_y * rows
    under = R * R - x * x - y * y
    inside = under >= 0.0
    ball = np.sqrt(under[inside]) - R
    order = np.argsort(-ball, kind="stable")
    return np.stack([rows[inside], columns[inside]], axis=1)[order], ball[order]


def dilated(fine: _Array, every: int, offsets: NDArray[np.intp], ball: _Array, wrap: bool) -> _Array:
    """Return the largest height of surface and ball over all offsets, at the middle of every few pixels.

    Parameters
    ----------
    fine : ndarray (rows, columns)
        Heights [m].
    every : int
        Only the middle of so many pixels along x and y is computed.
    offsets, ball
        As `offsets_under` returns them.
    wrap : bool
        Repeat the map at its borders; else mirror it there.

    Returns
    -------
    ndarray (rows / every, columns / every)
    """
    half_y, half_x = (int(half) for half in np.abs(offsets).max(axis=0))
    padded = np.pad(fine, ((half_y, half_y), (half_x, half_x)), mode="wrap" if wrap else "symmetric")
    # One array for each place within `every` pixels, so that neighbours in it are neighbours in the result.
    parts = [[np.ascontiguousarray(padded[i::every, j::every]) for j in range(every)] for i in range(every)]
    begin = offsets + np.array([half_y, half_x]) + every // 2
    found = np.empty((fine.shape[0] // every, fine.shape[1] // every))
    for top in range(0, found.shape[0], _TILE):
        for left in range(0, found.shape[1], _TILE):
            tile = found[top : top + _TILE, left : left + _TILE]
            rows, columns = tile.shape
            around = padded[
                every * top : every * (top + rows) + 2 * half_y, every * left : every * (left + columns) + 2 * half_x
            ]
            highest = float(around.max())
            tile[:] = -np.inf
            for number, ((y, x), height) in enumerate(zip(begin.tolist(), ball.tolist(), strict=True)):
                # Rounding keeps the order: what is left out here is at most what is found.
                if number % _BETWEEN == 0 and highest + height <= float(tile.min()):
                    break
                part = parts[y % every][x % every]
                down, right = y // every + top, x // every + left
                np.maximum(tile, part[down : down + rows, right : right + columns] + height, out=tile)
    return found
