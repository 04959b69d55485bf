"""Friction loops: lateral signal against position, forth (trace) and back (retrace).

    friction = half the difference of trace and retrace, offset = half their sum

The stick slope is that of the signal after a turn: stiffness of cantilever, tip and contact in series.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .estimate import Estimate, correlated_mean, noise_of, same_length

_Array = NDArray[np.float64]
_PASSES = 3


class LoopForces(NamedTuple):
    """In the unit of the signal: newton, or volts that are not calibrated."""

    half_width: Estimate
    offset: Estimate
    stick_slope: Estimate  # signal per metre; NaN: nothing moved while the tip stuck


def means(position: ArrayLike, signal: ArrayLike, low: float, high: float) -> tuple[Estimate, Estimate]:
    """Mean of the signal between two positions, of trace (position grows) and retrace.

    Parameters
    ----------
    position : array_like (n,) [m]
        As asked for, or with less noise than a step.
    signal : array_like (n,)
    low, high : float [m]

    Raises
    ------
    ValueError
        If nothing lies between, in either direction.
    """
    position, signal = same_length(position=position, signal=signal)
    change = np.gradient(position)
    inside = (position >= low) & (position <= high)
    return correlated_mean(signal[inside & (change > 0.0)]), correlated_mean(signal[inside & (change < 0.0)])


def friction_loop(position: ArrayLike, signal: ArrayLike, sliding: float = 0.5, stick: float = 0.6) -> LoopForces:
    """Half-width, offset and stick slope of a friction loop, over all whole travels from turn to turn.

    Parameters
    ----------
    position : array_like (n,) [m]
        Of the scanner: three turns at least, so that there are a trace and a retrace from turn to turn.
    signal : array_like (n,)
        Lateral signal.
    sliding : float
        Part of a travel, up to its end, over which the tip is taken as sliding.
    stick : float
        Part of the half-width on either side of the offset within which the stick slope is fitted.

    Raises
    ------
    ValueError
        If there are fewer than three turns, or the loop is not open: trace and retrace are equal.
    """
    position, signal = same_length(position=position, signal=signal)
    turns = _turns(position)
    if len(turns) < 3:
        raise ValueError(
            f"a friction loop needs a trace and a retrace from turn to turn, three turns of the position: there are "
            f"{len(turns)}"
        )
    travels = [slice(a, b + 1) for a, b in pairwise(turns)]
    slid: dict[bool, list[_Array]] = {True: [], False: []}
    for travel in travels:
        x, y = position[travel], signal[travel]
        way = np.abs(x - x[0])
        slid[bool(x[-1] > x[0])].append(y[way >= (1.0 - sliding) * way[-1]])
    trace, retrace = (correlated_mean(np.concatenate(slid[forth])) for forth in (True, False))
    half, offset = _half_and_offset(trace, retrace)
    reach = stick * half.value
    ways = [(position[travel], signal[travel]) for travel in travels]
    return LoopForces(half, offset, _stick_slope(ways, offset.value, reach, sliding))


def dissipated(position: ArrayLike, signal: ArrayLike) -> tuple[float, float]:
    """Energy that a friction loop dissipates in a cycle: the area that the signal encloses.

    Parameters
    ----------
    position : array_like (n,) [m]
    signal : array_like (n,)

    Returns
    -------
    (float, float)
        Energy of a cycle, as a mean [joule for a signal in newton], and number of the cycles that it is the mean of.

    Raises
    ------
    ValueError
        If there are fewer than three turns: not one whole cycle.
    """
    position, signal = same_length(position=position, signal=signal)
    turns = _turns(position)
    if len(turns) < 3:
        raise ValueError(f"a whole cycle needs three turns of the position: there are {len(turns)}")
    cycles = (len(turns) - 1) // 2
    whole = slice(turns[0], turns[2 * cycles] + 1)
    x, y = position[whole], signal[whole]
    # Closed by a straight line: the two ends lie on the same side.
    x, y = np.append(x, x[0]), np.append(y, y[0])
    return float(np.trapezoid(y, x)) / cycles, float(cycles)


def line_loop(x: ArrayLike, trace: ArrayLike, retrace: ArrayLike, sliding: float = 0.5) -> LoopForces:
    """Friction loop of one line of an image.

    Parameters
    ----------
    x : array_like (pixels,) [m]
        Increasing.
    trace, retrace : array_like (pixels,)
        Lateral signal; pixel 0 is the leftmost in both.
    sliding : float
        Part of the line, up to the end of each way, over which the tip is taken as sliding.

    Returns
    -------
    FrictionLoop
        The stick slope is NaN where the turns lie outside of the image, as with an overscan.

    Raises
    ------
    ValueError
        If the arrays do not fit together, or the loop is not open.
    """
    x, trace, retrace = (np.asarray(each, np.float64) for each in (x, trace, retrace))
    if x.ndim != 1 or not x.shape == trace.shape == retrace.shape or x.size < 2 or not (np.diff(x) > 0.0).all():
        raise ValueError(
            f"x {x.shape}, trace {trace.shape} and retrace {retrace.shape} must be lists of the same length, and x "
            f"must increase"
        )
    if not 0.0 < sliding <= 1.0:
        raise ValueError(f"sliding = {sliding:g} is not allowed: it must be > 0 and <= 1")
    reach = sliding * (x[-1] - x[0])
    forth, back = correlated_mean(trace[x >= x[-1] - reach]), correlated_mean(retrace[x <= x[0] + reach])
    half, offset = _half_and_offset(forth, back)
    ways = [
        (way, signal)
        for way, signal in ((x, trace), (x[::-1], retrace[::-1]))
        if _sticks(signal, offset.value, half.value, way)
    ]
    return LoopForces(half, offset, _stick_slope(ways, offset.value, 0.6 * half.value, sliding))


def _half_and_offset(trace: Estimate, retrace: Estimate) -> tuple[Estimate, Estimate]:
    """Half the difference and half the sum; ValueError if the loop is not open."""
    half, both = 0.5 * (trace.value - retrace.value), 0.5 * math.hypot(trace.uncertainty, retrace.uncertainty)
    if not half > 0.0:
        raise ValueError("the loop is not open: the signal of the trace is not above that of the retrace")
    return Estimate(half, both), Estimate(0.5 * (trace.value + retrace.value), both)


def _sticks(signal: _Array, offset: float, half: float, way: _Array) -> bool:
    """Whether a way begins on the other side of the loop: the tip has not begun to slide."""
    forth = 1.0 if way[-1] > way[0] else -1.0
    return bool(forth * (signal[0] - offset) < -0.6 * half)


def _stick_slope(ways: list[tuple[_Array, _Array]], offset: float, reach: float, sliding: float) -> Estimate:
    """Mean slope after the turn at the start of each way, while the signal crosses from one side to the other.

    Its uncertainty is the slope that noise has over as many samples where the tip slides.
    """
    slopes, sums = list[float](), list[tuple[_Array, _Array]]()
    for x, signal in ways:
        forth = 1.0 if x[-1] > x[0] else -1.0
        way, y = forth * (x - x[0]), forth * (signal - offset)
        chosen, counted = _sticking(way, y, reach)
        # A scanner that rests while the tip sticks gives no slope.
        if chosen.size >= 3 and np.ptp(way[chosen]) > 0.0:
            part = way[chosen] - np.average(way[chosen], weights=counted)
            weights = counted * part / float(counted @ part**2)
            slopes.append(float(weights @ y[chosen]))
            sums.append((weights, y[way >= (1.0 - sliding) * way[-1]]))
    if not slopes:
        return Estimate(math.nan, math.nan)
    return Estimate(float(np.mean(slopes)), noise_of(sums) / math.sqrt(len(slopes)))


def _sticking(way: _Array, y: _Array, reach: float) -> tuple[NDArray[np.intp], _Array]:
    """Return the samples after a turn while a straight line through them is within reach, and how much each counts.

    Noise must not choose them one by one, which would make the slope too small; one more at an end must not change it.
    """
    crossed = np.flatnonzero(y > reach)
    end = int(crossed[0]) if crossed.size else y.size
    chosen = np.flatnonzero(y[:end] >= -reach)
    counted = np.ones(chosen.size)
    for _ in range(_PASSES):
        if chosen.size < 3 or not np.ptp(way[chosen]) > 0.0:
            break
        slope, height = np.polyfit(way[chosen], y[chosen], 1, w=np.sqrt(counted))
        weights = 1.0 - ((slope * way[: 2 * end] + height) / reach) ** 2
        chosen = np.flatnonzero(weights > 0.0)
        counted = weights[chosen]
    return chosen, counted


def _turns(position: _Array) -> list[int]:
    """Samples at which the position turns back: its extremes in the outer quarters of its range."""
    low, high = (float(position.min()) + part * float(np.ptp(position)) for part in (0.25, 0.75))
    side = np.where(position > high, 1, np.where(position < low, -1, 0))
    outer = np.flatnonzero(side)
    # Stretches on one side: they end where the position is next seen on the other.
    begins = np.concatenate([[0], np.flatnonzero(np.diff(side[outer])) + 1, [outer.size]])
    turns = []
    for a, b in pairwise(begins.tolist()):
        stretch = outer[a:b]
        turn = int(stretch[np.argmax(side[stretch[0]] * position[stretch])])
        if 0 < turn < position.size - 1:
            turns.append(turn)
    return turns
