"""The contact law of `maugis` as a table for kernels: force and contact radius over s = sqrt(d - d_end), cubic.

In s both are smooth up to the end of the branch, where d-derivatives are infinite. Beyond the table the contact is that
of Hertz, joined with equal value and slope. Short of the contact the force is the van der Waals attraction of a sphere,
-H R_e / (6 D^2), with the distance D counted so that the force is continuous where contact begins; docs/lever.md (12),
(13).
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import kernel
from ..compiled.records import Block
from ..compiled.ways import rare, settled
from ..core.splines import slopes
from .maugis import branch

NODES = 1025
REACH = 16.0
"""Largest s in the table: indentations up to 256, forces up to 4000 pi w R_e."""
_HEAD = 6
ROW = _HEAD + 4 * NODES
"""Numbers of a row: indentation and force at the end of the branch; shift and force offset of the Hertz contact beyond
the table, factor and shift for its radius; then force, its slope, radius, its slope at each node."""
STEP = 0.015
"""Largest step of lambda between rows: linear interpolation between them is then exact to 2e-5."""


def transitions(least: float, largest: float) -> NDArray[np.float64]:
    """Transition parameters of the rows of a table for all between two of them; one row if they are equal."""
    if largest <= least * (1.0 + 1e-9):
        return np.array([least])
    return np.linspace(least, largest, 2 + math.floor((largest - least) / (STEP * max(least, 0.1))))


def table(model: str, rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Table (rows, ROW) of the contact model, a row for each transition parameter."""
    return np.stack([_row(model, float(transition)) for transition in rows])


@lru_cache(maxsize=64)
def _row(model: str, transition: float) -> NDArray[np.float64]:
    exact = branch(model, transition)
    s = np.linspace(0.0, REACH, NODES)
    d = exact.least_indentation + s * s
    a, force = exact.solve(d)
    force_slope, a_slope = slopes(force, s[1]), slopes(a, s[1])
    # F = offset + (d + shift)^(3/2); a^2 = d + factor d^(1/4) + shift_a, as adhesion widens a large contact.
    root = force_slope[-1] / (2.0 * REACH) / 1.5
    fourth = math.sqrt(math.sqrt(d[-1]))
    factor = 4.0 * fourth * fourth * fourth * (a[-1] * a_slope[-1] / REACH - 1.0)
    shift_a = a[-1] * a[-1] - d[-1] - factor * fourth
    head = [d[0], force[0], root * root - d[-1], force[-1] - root * root * root, factor, shift_a]
    return np.concatenate([head, np.stack([force, force_slope, a, a_slope], axis=1).ravel()])


@kernel
def look_up(d: float, row: float, t: Block, at: int, rows: int) -> tuple[float, float, float, float]:
    """Force, its slope dF/dd, contact radius and its slope at indentation d, in the units of `maugis`.

    Parameters
    ----------
    d : float
    row : float
        Row of the table, between two of them interpolated linearly; 0 if there is one.
    t, at, rows : ndarray, int, int
        The table begins at `t[at]`.

    Returns
    -------
    (F, dF/dd, a, da/dd) : floats
        Out of contact a = 0 and F the force at the end of the branch.
    """
    if rows == 1:
        return _in_row(d - t[at], d, t, at)
    below = _whole(row, rows - 2, t)
    f = row - below
    g = 1.0 - f
    one, two = at + below * ROW, at + (below + 1) * ROW
    # Both rows at the same distance from their ends: only there they are alike.
    d_end = g * t[one] + f * t[two]
    F1, S1, a1, b1 = _in_row(d - d_end, d - d_end + t[one], t, one)
    F2, S2, a2, b2 = _in_row(d - d_end, d - d_end + t[two], t, two)
    return g * F1 + f * F2, g * S1 + f * S2, g * a1 + f * a2, g * b1 + f * b2


@kernel
def end_of_contact(row: float, t: Block, at: int, rows: int) -> float:
    """Indentation at which contact begins and ends, in the units of `maugis`; arguments as in `look_up`."""
    if rows == 1:
        return t[at]
    below = _whole(row, rows - 2, t)
    f = row - below
    return (1.0 - f) * t[at + below * ROW] + f * t[at + (below + 1) * ROW]


@kernel
def force_at_end(row: float, t: Block, at: int, rows: int) -> float:
    """Return the force at the end of contact, in the units of `maugis`; arguments as in `look_up`."""
    if rows == 1:
        return t[at + 1]
    below = _whole(row, rows - 2, t)
    f = row - below
    return (1.0 - f) * t[at + below * ROW + 1] + f * t[at + (below + 1) * ROW + 1]


@kernel
def _whole(x: float, most: int, t: Block) -> int:
    """Whole part of x, from 0 to `most`, whatever x is. 32 bits: processors convert several at once to these."""
    return settled(min(max(np.int32(x), 0), most), t)  # type: ignore[arg-type]  # of numpy


@kernel
def _in_row(beyond: float, d: float, t: Block, at: int) -> tuple[float, float, float, float]:
    if rare(beyond <= 0.0, t):
        return t[at + 1], 0.0, 0.0, 0.0
    s = math.sqrt(beyond)
    spacing = REACH / (NODES - 1)
    if rare(s >= REACH, t):
        root = math.sqrt(d + t[at + 2])
        fourth = math.sqrt(math.sqrt(d))
        a = math.sqrt(d + t[at + 4] * fourth + t[at + 5])
        return t[at + 3] + root * root * root, 1.5 * root, a, (0.5 + 0.125 * t[at + 4] * fourth / d) / a
    place = s / spacing
    j = _whole(place, NODES - 2, t)
    f = place - j
    k = at + _HEAD + 4 * j
    # Cubic through values and slopes at both nodes.
    F, S = _cubic(f, spacing, t[k], t[k + 1], t[k + 4], t[k + 5])
    a, b = _cubic(f, spacing, t[k + 2], t[k + 3], t[k + 6], t[k + 7])
    per_d = 0.5 / s
    return F, S * per_d, a, b * per_d


@kernel
def _cubic(f: float, width: float, v0: float, s0: float, v1: float, s1: float) -> tuple[float, float]:
    """Value and slope at fraction f of a stretch with the given values and slopes at its ends."""
    rise = v1 - v0
    p = width * s0 - rise
    q = rise - width * s1
    g = 1.0 - f
    value = g * v0 + f * v1 + f * g * (g * p + f * q)
    slope = rise + (1.0 - 2.0 * f) * (g * p + f * q) + f * g * (q - p)
    return value, slope / width


@kernel
def attraction(distance: float, hamaker_radius: float) -> tuple[float, float]:
    """Van der Waals force on a sphere at a distance [m] and its slope over the approach: -H R/(6 D^2), -H R/(3 D^3).

    Parameters
    ----------
    distance : float [m]
        > 0.
    hamaker_radius : float [J m]
        Hamaker constant times radius.
    """
    force = -hamaker_radius / (6.0 * distance * distance)
    return force, 2.0 * force / distance
