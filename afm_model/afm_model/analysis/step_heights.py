"""Steps in a profile or an image: heights as in ISO 5436-1, places and widths of edges."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .estimate import Estimate, correlated_mean, mean
from .regions import two_levels

_Array = NDArray[np.float64]
_THIRD = 1.0 / 3.0
"""Part of the width of a plateau that is left out at each of its edges."""
_FEWEST = 3


class Edge(NamedTuple):
    """Where a profile goes from one level to the other."""

    place: float  # where it passes half the height [m]
    width: float  # way from 10 % to 90 % of the height [m]; NaN if it does not come that far on both sides
    rising: bool  # towards larger x


def edges(x: ArrayLike, profile: ArrayLike) -> list[Edge]:
    """Edges of a profile with two levels, left to right.

    Parameters
    ----------
    x : array_like (n,) [m]
        Increasing.
    profile : array_like (n,)
        Levelled: its slope is taken as that of the edges.

    Raises
    ------
    ValueError
        If the profile has not two levels.
    """
    x, z = _profile(x, profile)
    low_mask, high_mask = two_levels(z[None, :], 0, 0.0)
    low, high = float(np.median(z[low_mask[0]])), float(np.median(z[high_mask[0]]))
    part = (z - low) / (high - low)
    # Between samples on both sides of a band about the middle, so that noise there makes no edges.
    side = np.where(part > 0.7, 1, np.where(part < 0.3, -1, 0))
    outer = np.flatnonzero(side)
    turns = np.flatnonzero(np.diff(side[outer]))
    bounds = [0, *(int(0.5 * (outer[i] + outer[i + 1])) for i in turns), x.size - 1]
    found = []
    for n, i in enumerate(turns):
        a, b = int(outer[i]), int(outer[i + 1])
        rising = bool(side[b] > 0)
        p = part if rising else 1.0 - part
        first, last = bounds[n], bounds[n + 2]
        low_side = np.flatnonzero(p[first : b + 1] <= 0.1)
        high_side = np.flatnonzero(p[a : last + 1] >= 0.9)
        width = math.nan
        if low_side.size and high_side.size:
            begin, end = first + int(low_side[-1]), a + int(high_side[0])
            width = _crossing(x, p, end - 1, 0.9) - _crossing(x, p, begin, 0.1)
        middle = a + int(np.flatnonzero((p[a:b] - 0.5) * (p[a + 1 : b + 1] - 0.5) <= 0.0)[0])
        found.append(Edge(_crossing(x, p, middle, 0.5), width, rising))
    return found


def step_height(x: ArrayLike, heights: ArrayLike) -> Estimate:
    """Height of the steps of a grating or groove, by ISO 5436-1.

    Each plateau with a neighbour on both sides is compared with them: a straight line through what is left of the
    neighbours, and one parallel to it through the plateau. A third of every plateau is left out on each of its sides,
    and of a neighbour nothing counts that is further away than the plateau is wide. So a tilt does not matter, and a
    bow by what it bends within three widths.

    Parameters
    ----------
    x : array_like (pixels,) [m]
    heights : array_like (lines, pixels) or (pixels,) [m]
        Lines with NaN are left out.

    Returns
    -------
    Estimate [m]
        Mean over plateaus and lines; its uncertainty from the scatter over lines, with their correlation, or of a
        single line over its plateaus.

    Raises
    ------
    ValueError
        If there is no plateau with both neighbours.
    """
    image = np.atleast_2d(np.asarray(heights, np.float64))
    of_lines: list[list[float]] = []
    for line in image:
        if np.isfinite(line).all():
            of_line = _heights(*_profile(x, line))
            if of_line:
                of_lines.append(of_line)
    if not of_lines:
        raise ValueError("there is no plateau with a neighbour on both sides: a line needs at least two edges")
    if len(of_lines) == 1:
        return _of_neighbours(mean(of_lines[0]), len(of_lines[0]))
    return correlated_mean([float(np.mean(each)) for each in of_lines])


def _of_neighbours(found: Estimate, count: int) -> Estimate:
    """Heights of neighbours share plateaus: 2/3 of their variance with the next one, 1/6 with the one after it."""
    if count < 2:
        return found
    shared = (2.0 * (count - 1) * 2.0 / 3.0 + 2.0 * (count - 2) / 6.0) / (count * (count - 1))
    return Estimate(found.value, found.uncertainty * math.sqrt((1.0 + (count - 1) * shared) / (1.0 - shared)))


def _heights(x: _Array, z: _Array) -> list[float]:
    """Heights of all plateaus of a line that have neighbours."""
    # The tilt of the whole line must not hide the two levels; it is that between samples on the same level.
    tilt = np.polyfit(x - x.mean(), z, 1)[0]
    places = [each.place for each in edges(x, _flatter(x, z, float(tilt)))]
    bounds = [float(x[0]), *places, float(x[-1])]
    found = []
    for n in range(1, len(bounds) - 2):
        left, begin, end, right = bounds[n - 1 : n + 3]
        width = end - begin
        inside = (x > begin + _THIRD * width) & (x < end - _THIRD * width)
        # The outermost neighbours end with the line, where there is no edge to keep away from.
        before = (x < begin - _THIRD * width) & (x > max(begin - width, left + _away(left, begin, n > 1)))
        after = (x > end + _THIRD * width) & (x < min(end + width, right - _away(end, right, n < len(bounds) - 3)))
        if min(inside.sum(), before.sum(), after.sum()) < _FEWEST:
            continue
        used = inside | before | after
        columns = np.stack([np.ones(used.sum()), x[used] - 0.5 * (begin + end), inside[used]], axis=1)
        solved = np.linalg.lstsq(columns, z[used], rcond=None)[0]
        found.append(abs(float(solved[2])))
    return found


def _flatter(x: _Array, z: _Array, tilt: float) -> _Array:
    """The line as it is where it has two levels, else less its tilt."""
    without: _Array = z - tilt * (x - x.mean())
    try:
        two_levels(z[None, :], 0, 0.0)
    except ValueError:
        return without
    return z


def _away(begin: float, end: float, is_edge: bool) -> float:
    return _THIRD * (end - begin) if is_edge else 0.0


def _crossing(x: _Array, p: _Array, i: int, level: float) -> float:
    """x between samples i and i + 1 where p passes a level."""
    i = min(max(i, 0), x.size - 2)
    rise = p[i + 1] - p[i]
    return float(x[i] + (np.clip((level - p[i]) / rise, 0.0, 1.0) if rise != 0.0 else 0.5) * (x[i + 1] - x[i]))


def _profile(x: ArrayLike, z: ArrayLike) -> tuple[_Array, _Array]:
    x, z = np.asarray(x, np.float64), np.asarray(z, np.float64)
    if x.ndim != 1 or x.shape != z.shape:
        raise ValueError(f"x {x.shape} and a line {z.shape} must be two lists of the same length")
    if not (np.diff(x) > 0.0).all():
        raise ValueError("x must increase from pixel to pixel")
    return x, z
