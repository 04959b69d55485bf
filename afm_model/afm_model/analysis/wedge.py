"""Sensitivity of the lateral signal [N/V] by the wedge: on a slope part of the load pushes sideways.

A tip under the vertical load L slides up (+) and down (-) a slope of angle theta, s and c being its sine and cosine.
With friction F(N) under the force N along the local normal, the lateral force T is

    c T = s L +- F(N),   N = c L + s T                                                                          (1)

For F = m (N + A), A the adhesion, (1) gives with the sensitivity S, half-width W and offset D of the loop

    S W = m (L + A c) / (c^2 - m^2 s^2),   S D = [m^2 s (L c + A) + L s c] / (c^2 - m^2 s^2)                     (2)

which D. F. Ogletree, R. W. Carpick and M. Salmeron, Rev. Sci. Instrum. 67 (1996) 3298, doi:10.1063/1.1147411, use at
several loads, and M. Varenberg, I. Etsion and G. Halperin, Rev. Sci. Instrum. 74 (2003) 3362, at
one load with the adhesion. Friction that follows the area of the contact is no straight line of the load: then take
`wedge_by_flat`, which uses (1) with friction as it was measured next to the slope.

Signals are positive when the sample pushes towards the uphill side, which is what a tip that moves uphill feels.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .estimate import Estimate, propagated, straight_line, student

_Array = NDArray[np.float64]


class WedgeCalibration(NamedTuple):
    """Result of a lateral calibration."""

    sensitivity: Estimate
    """[N/V]"""
    friction: Estimate
    """Growth of friction with the load, dF/dN [1]."""


def wedge_ogletree(
    load_up: ArrayLike, up: ArrayLike, load_down: ArrayLike, down: ArrayLike, angle: float
) -> WedgeCalibration:
    """From how half-width and offset on a slope grow with the load.

    Offsets of load and signal and the adhesion have no say: only slopes over the load count, uphill and downhill each
    over its own. The friction must be a straight line of the load. Friction that follows the area grows less where the
    load is larger, so that uphill and downhill have friction coefficients that differ, by 2 e, say: the result is then
    too large by about 2 e tan(angle), some percent on a steep slope.

    Parameters
    ----------
    load_up, load_down : array_like (n,) [N]
        Vertical load on the way up and down, as the deflection shows: a z loop that lags makes them differ. Two
        loads at least.
    up, down : array_like (n,) [V]
        Mean signal on the way up and down the slope.
    angle : float [rad]
        Of the slope, 0 to pi/2.

    Raises
    ------
    ValueError
        If no friction coefficient fits.
    """
    s, c = _sine_cosine(angle)
    ways = [(np.asarray(load, np.float64), signal) for load, signal in ((load_up, up), (load_down, down))]
    lines = [straight_line(*each) for each in ways]
    # Loads are independent of one another, and so few that both lines together tell the noise.
    counts = np.array([load.size for load, _ in ways])
    freedom = int(counts.sum()) - 4
    rms = math.sqrt(np.nansum([(n - 2) * line.rms**2 for n, line in zip(counts, lines, strict=True)]) / max(freedom, 1))
    of_noise = rms if freedom else math.nan
    slopes = [
        Estimate(line.slope.value, of_noise / math.sqrt(n) / float(load.std()))
        for line, n, (load, _) in zip(lines, counts, ways, strict=True)
    ]

    def m(uphill: float, downhill: float) -> float:
        # D'/W' = (m + 1/m) s c
        return _smaller_root(s * c, -(uphill + downhill) / (uphill - downhill), s * c)

    def S(uphill: float, downhill: float) -> float:
        f = m(uphill, downhill)
        return f / (c * c - f * f * s * s) / (0.5 * (uphill - downhill))

    found = (propagated(each, *slopes) for each in (S, m))
    factor = student(freedom) if freedom else math.nan
    sensitivity, friction = (Estimate(each.value, each.uncertainty * factor) for each in found)
    return WedgeCalibration(sensitivity, friction)


def wedge_varenberg(
    load: Estimate | float,
    half_width: Estimate | float,
    offset: Estimate | float,
    flat_offset: Estimate | float,
    angle: float,
    adhesion: Estimate | float,
) -> WedgeCalibration:
    """From one loop on a slope and one on a flat at the same load, the adhesion being known from a force curve.

    The friction must be F = m (N + A).

    Parameters
    ----------
    load : Estimate or float [N]
        Vertical load L.
    half_width, offset : Estimate or float [V]
        Of the loop on the slope.
    flat_offset : Estimate or float [V]
        Of the loop on the flat: zero of the signal.
    angle : float [rad]
    adhesion : Estimate or float [N]
        Pull-off force A, positive.

    Raises
    ------
    ValueError
        If no friction coefficient fits.
    """
    s, c = _sine_cosine(angle)

    def m(L: float, W: float, D: float, D_flat: float, A: float) -> float:
        return _smaller_root(s * (L * c + A), -(D - D_flat) / W * (L + A * c), L * s * c)

    def S(L: float, W: float, D: float, D_flat: float, A: float) -> float:
        f = m(L, W, D, D_flat, A)
        return f * (L + A * c) / (c * c - f * f * s * s) / W

    given = load, half_width, offset, flat_offset, adhesion
    return WedgeCalibration(propagated(S, *given), propagated(m, *given))


def wedge_by_flat(
    flat_load: ArrayLike,
    flat_half_width: ArrayLike,
    load_up: ArrayLike,
    up: ArrayLike,
    load_down: ArrayLike,
    down: ArrayLike,
    angle: float,
) -> WedgeCalibration:
    """From loops on a slope, with friction of any law as measured on a flat of the same material.

    The sensitivity is the one unknown of (1): F(N) is S times the half-width on the flat under the load N. Between the
    loads its power 3/2 is interpolated, which for a contact without adhesion is a straight line.

    Parameters
    ----------
    flat_load : array_like (n,) [N]
        Rising, three or more. They must reach from the smallest to the largest normal force on the slope, which is
        larger than the load: 2.5 times at 54.74 degrees and dF/dN = 0.2.
    flat_half_width : array_like (n,) [V]
        Positive.
    load_up, load_down : array_like (k,) [N]
        Vertical load on the way up and down the slope.
    up, down : array_like (k,) [V]
        Mean signal there, less the offset on the flat.
    angle : float [rad]

    Raises
    ------
    ValueError
        If normal forces on the slope lie outside of `flat_load`, or the numbers of values do not agree.
    """
    # Here: a third of a second for nothing in a recorder, which calibrates nothing.
    from scipy.interpolate import PchipInterpolator
    from scipy.optimize import least_squares

    s, c = _sine_cosine(angle)
    grid, widths = np.asarray(flat_load, np.float64), np.asarray(flat_half_width, np.float64)
    L_u, u, L_d, d = (np.atleast_1d(np.asarray(each, np.float64)) for each in (load_up, up, load_down, down))
    if grid.shape != widths.shape or grid.size < 2 or not L_u.shape == u.shape == L_d.shape == d.shape:
        raise ValueError(
            f"loads and signals must go together: on the flat {grid.size} and {widths.size} (at least 2), on the slope "
            f"{L_u.size} and {u.size} up, {L_d.size} and {d.size} down"
        )
    if not ((widths > 0.0).all() and (np.diff(grid) > 0.0).all()):
        raise ValueError(
            f"half-widths on the flat must be positive and its loads rising: half-widths are {widths.min():.3g} V to "
            f"{widths.max():.3g} V, loads {', '.join(f'{each:.3g}' for each in grid[:6])} N"
        )

    # Without friction the mean signal is L tan(angle); friction makes it larger.
    first = float(np.mean((L_u + L_d) / (u + d))) * s / c

    def solved(volts: _Array) -> tuple[float, float, _Array, _Array]:
        """Sensitivity, growth of friction, what is left of (1), normal forces, from widths on the flat and signals."""
        widths, u, d = np.split(volts, [grid.size, grid.size + L_u.size])
        power: Callable[[_Array], _Array] = PchipInterpolator(grid, np.maximum(widths, 0.0) ** 1.5, extrapolate=True)

        def friction(S: float, N: _Array) -> _Array:
            return S * np.asarray(np.maximum(power(N), 0.0) ** (2.0 / 3.0))

        def left(x: _Array) -> _Array:
            S = x[0] * first
            uphill = c * S * u - s * L_u - friction(S, c * L_u + s * S * u)
            downhill = c * S * d - s * L_d + friction(S, c * L_d + s * S * d)
            return np.concatenate([uphill / L_u, downhill / L_d])

        found = least_squares(left, [1.0], xtol=1e-12, ftol=1e-12, gtol=1e-12)
        S = float(found.x[0]) * first
        normal = np.concatenate([c * L_u + s * S * u, c * L_d + s * S * d])
        middle, step = 0.5 * float(normal.min() + normal.max()), 1e-3 * float(grid[-1] - grid[0])
        ends = friction(S, np.array([middle - step, middle + step]))
        return S, float(ends[1] - ends[0]) / (2.0 * step), np.asarray(found.fun), normal

    volts = np.concatenate([widths, u, d])
    S, growth, left, normal = solved(volts)
    if normal.min() < grid[0] or normal.max() > grid[-1]:
        raise ValueError(
            f"the normal force on the slope goes from {normal.min():.3g} N to {normal.max():.3g} N, loads on the flat "
            f"only from {grid[0]:.3g} N to {grid[-1]:.3g} N: measure the flat there, too"
        )
    # All signals are taken as equally uncertain, by as much as leaves what is left.
    step = 1e-4 * float(np.mean(u))
    changed = [solved(volts + each) for each in step * np.eye(volts.size)]
    by_signal = np.array([each[2] - left for each in changed])
    # Weighed so that what is left counts for as many independent numbers as there are beyond the one found.
    freedom = 2 * u.size - 1
    square = float(left @ np.linalg.pinv(by_signal.T @ by_signal, rcond=1e-5, hermitian=True) @ left) / freedom
    noise = math.sqrt(max(square, 0.0)) * student(freedom)
    of_S, of_growth = (math.sqrt(sum((each[i] - at) ** 2 for each in changed)) for i, at in ((0, S), (1, growth)))
    return WedgeCalibration(Estimate(S, noise * of_S), Estimate(growth, noise * of_growth))


def _sine_cosine(angle: float) -> tuple[float, float]:
    if not 0.0 < angle < 0.5 * math.pi:
        raise ValueError(f"angle = {angle:g} rad is not allowed: it must be > 0 and < pi/2, that of the slope")
    return math.sin(angle), math.cos(angle)


def _smaller_root(a: float, b: float, c: float) -> float:
    """Smaller positive root of a m^2 + b m + c = 0: friction coefficients above 1 are not met."""
    square = b * b - 4.0 * a * c
    if square < 0.0 or b >= 0.0:
        raise ValueError(
            "no friction coefficient fits: the offset on the slope is too small compared with the half-width, or has "
            "the other sign (it must be positive where uphill is)"
        )
    return 2.0 * c / (-b + math.sqrt(square))
