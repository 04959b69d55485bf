"""Force curves: sensitivity of the deflection, contact point, snap-in, adhesion.

z is the way of the scanner towards the tip: it grows on the approach and falls on the retract. The deflection is
positive when the sample pushes the cantilever away.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .curve_parts import FEWEST, CurveParts, curve_parts
from .estimate import Estimate, StraightLine, noise_of, straight_line

_Array = NDArray[np.float64]


class CurveAnalysis(NamedTuple):
    """Results of a force curve. Forces are relative to that of the free cantilever."""

    baseline: Estimate
    """Deflection of the free cantilever at the contact point [m]."""
    contact_point: float
    """z at which the force is zero in contact, on the approach [m]."""
    snap_in_way: float
    """Way of z from the snap-in to the contact point [m]: 3/2 of the distance at which a sphere under van der Waals
    attraction snaps in, and the compression of the contact; 0 if the tip does not snap in."""
    adhesion: Estimate
    """Largest pull [N], positive."""
    snap_off_way: float
    """Way of z from the contact point back to the pull-off [m]."""
    work: float
    """Work of the adhesive forces on the retract [J]: area between curve and baseline."""
    slope: Estimate
    """Of the baseline over z, from the contact point to the turn."""
    told: str
    """What is to be known of the baseline; empty if it is straight."""


def _pressed(signal: _Array, low: float, high: float) -> slice:
    """Samples from the end back, in contact, between two levels."""
    below = np.flatnonzero(signal < low)
    begin = int(below[-1]) + 1 if below.size else 0
    above = np.flatnonzero(signal[begin:] > high)
    end = begin + int(above[0]) if above.size else signal.size
    return slice(begin, end)


def deflection_sensitivity(
    z: ArrayLike, voltage: ArrayLike, low: float = 0.3, high: float = 0.9, compression: float = 0.0
) -> Estimate:
    """Sensitivity of the deflection [m/V] (InvOLS) from a force curve on a stiff sample.

    The cantilever follows z where the sample does not give way. Friction of the tip along a cantilever that turns
    while it bends adds to the signal on the approach and takes from it on the retract, so that the mean of both is
    taken, in which it cancels to first order (a coefficient of 0.3 leaves 1e-3); half of their difference is the
    uncertainty, unless that of the fits is larger. The slope of the baseline is taken off. The contact is compressed,
    which adds the spring constant over the stiffness of the contact to the result (0.2 % for 0.2 N/m on silicon oxide):
    give the largest that this may be as `compression`. With a tilted cantilever it is the sensitivity for vertical
    motion of the tip: times `tilted_stiffness` and the voltage it is the vertical force, times `tilted_deflection` the
    sensitivity across the cantilever.

    Parameters
    ----------
    z : array_like (n,) [m]
        Of one curve: it rises to the turn and falls.
    voltage : array_like (n,) [V]
        Of the photodiode.
    low, high : float
        Part of the largest rise over the free cantilever between which lines are fitted.
    compression : float
        Spring constant over the least stiffness that the contact may have. All from none to this is equally likely: it
        is in the uncertainty, and not corrected.

    Raises
    ------
    ValueError
        If there is no approach and retract, or no contact in it.
    """
    if not 0.0 <= compression < 1.0:
        raise ValueError(f"compression = {compression:g} is not allowed: it must be >= 0 and < 1")
    if not 0.0 < low < high <= 1.0:
        raise ValueError(f"low = {low:g}, high = {high:g} are not allowed: 0 < low < high <= 1")
    parts = curve_parts(z, voltage)
    z_in, v_in, z_out, v_out = parts.z_in, parts.d_in, parts.z_out, parts.d_out
    rise = float(v_in.max())
    if not rise > 6.0 * parts.noise:
        raise ValueError("the voltage does not rise on the approach: the tip does not reach the sample")
    lines: list[StraightLine] = []
    for way, signal in ((z_in, v_in), (z_out[::-1], v_out[::-1])):
        part = _pressed(signal, low * rise, high * rise)
        if part.stop - part.start < FEWEST:
            raise ValueError(f"only {part.stop - part.start} points lie between low and high: sample the curve denser")
        lines.append(straight_line(way[part], signal[part]))
    each = [1.0 / line.slope.value for line in lines]
    of_fit = 0.5 * math.hypot(*(line.slope.uncertainty / line.slope.value**2 for line in lines))
    value = 0.5 * sum(each)
    of_base = parts.baseline.slope(z_in[v_in >= low * rise]).uncertainty * value**2
    of_contact = compression * value / math.sqrt(3.0)
    uncertainty = math.hypot(max(of_fit, 0.5 * abs(each[0] - each[1])), of_base, of_contact)
    return Estimate(value, uncertainty)


def force_curve(z: ArrayLike, deflection: ArrayLike, k: float) -> CurveAnalysis:
    """Contact point, snap-in and adhesion of one force curve.

    Parameters
    ----------
    z : array_like (n,) [m]
        It rises to the turn and falls.
    deflection : array_like (n,) [m]
        Voltage times sensitivity.
    k : float [N/m]
        Spring constant of the cantilever; of a tilted one `tilted_stiffness`.

    Raises
    ------
    ValueError
        If there is no approach and retract, or the tip is not pressed on.
    """
    parts = curve_parts(z, deflection)
    z_in, d_in, z_out, d_out = parts.z_in, parts.d_in, parts.z_out, parts.d_out
    free, noise = parts.baseline.noise, parts.noise
    _check_pressed(parts)
    after = _last_without_force(parts)
    contact = _crossing(z_in, d_in, after)
    # The deepest place before the contact is after the snap-in, whose motion counts from half its depth.
    deepest = int(np.argmin(d_in))
    # Round-off is no snap-in where there is no noise.
    snapped = d_in[deepest] < -max(5.0 * noise, 1e-9 * d_in[-1])
    fall = int(np.flatnonzero(d_in[:deepest] > 0.5 * d_in[deepest])[-1]) if snapped else 0
    lowest = int(np.argmin(d_out))
    at_pull_off = parts.baseline.sum_of(1.0, z_out[lowest]).uncertainty
    return CurveAnalysis(
        baseline=parts.baseline.sum_of(1.0, contact),
        contact_point=contact,
        snap_in_way=contact - float(z_in[fall]) if snapped else 0.0,
        adhesion=_pull_off(z_out, d_out, free, k, at_pull_off),
        snap_off_way=contact - float(z_out[lowest]),
        work=float(-k * np.trapezoid(np.minimum(d_out[: lowest + 1], 0.0), -z_out[: lowest + 1])),
        slope=parts.baseline.slope(z_in[after:]),
        told=parts.told,
    )


def _check_pressed(parts: CurveParts) -> None:
    if parts.d_in[-1] <= 3.0 * parts.noise:
        raise ValueError("the tip is not pressed on at the end of the approach")


def in_contact(parts: CurveParts) -> tuple[slice, slice]:
    """Samples of the approach in contact, and of the retract.

    The approach is taken from where the force is zero, the retract up to the largest pull.

    Raises
    ------
    ValueError
        If the tip is not pressed on, or does not come off.
    """
    d_in, d_out = parts.d_in, parts.d_out
    _check_pressed(parts)
    lowest = int(np.argmin(d_out))
    if d_out[-1] < 0.5 * min(float(d_out[lowest]), -5.0 * parts.noise):
        raise ValueError("the retract ends before the tip comes off: lengthen it")
    after = _last_without_force(parts)
    return slice(after + 1, d_in.size), slice(0, lowest + 1)


def _last_without_force(parts: CurveParts) -> int:
    """Return the last sample of the approach before the force rises above zero for good."""
    below = np.flatnonzero(parts.d_in <= 0.0)
    if not below.size:  # round-off, where there is neither noise nor attraction
        below = np.flatnonzero(parts.d_in <= parts.d_in[: parts.free].max())
    return int(below[-1])


def _crossing(z: _Array, d: _Array, i: int) -> float:
    """z between samples i and i + 1, where d passes zero."""
    return float(z[i] - d[i] * (z[i + 1] - z[i]) / (d[i + 1] - d[i]))


def _pull_off(z: _Array, d: _Array, free: _Array, k: float, of_base: float) -> Estimate:
    """Largest pull, by a cubic through the samples about the lowest one, as far as a cubic describes them.

    The lowest sample alone is too low by the noise, and a fit over too many samples is wrong by the bend of the curve:
    the stretch grows until its result contradicts that of a shorter one (O. Lepski's rule). What a
    parabola differs by, and the step of z in which the tip came off are in the uncertainty.
    """
    depth = float(d.min())
    if depth >= 0.0:
        return Estimate(0.0, k * of_base)
    noise = float(free.std())
    begin = int(np.flatnonzero(d < 0.5 * depth)[0])
    # Behind this the cantilever swings freely, to the same depth nearly.
    back = np.flatnonzero(d[begin:] > 0.25 * depth)
    off = begin + int(back[0]) if back.size else d.size
    lowest = begin + int(np.argmin(d[begin:off]))
    left = np.flatnonzero(d[lowest:off] > d[lowest] + 6.0 * noise)
    last = (lowest + int(left[0]) if left.size else off) - 1
    width, found = max(FEWEST - 1, last - lowest), Estimate(math.nan, math.nan)
    low, high = -math.inf, math.inf
    while width <= lowest - begin:
        part = slice(lowest - width, min(lowest + width, last) + 1)
        (value, weights, by_step), (parabola, _, _) = (_least(z[part], d[part], order) for order in (3, 2))
        of_noise = noise_of([(weights, free)])
        low, high = max(low, value - of_noise), min(high, value + of_noise)
        if low > high:
            break
        found = Estimate(-k * value, k * math.hypot(of_noise, by_step, value - parabola, of_base))
        width = max(width + 1, width * 4 // 3)
    if math.isnan(found.value):
        step = 0.29 * abs(float(d[lowest] - d[lowest - 1]))
        return Estimate(-k * d[lowest], k * math.hypot(max(3.0 * noise, step), of_base))
    return found


def _least(z: _Array, d: _Array, order: int) -> tuple[float, _Array, float]:
    """Return the least value of a polynomial through samples, up to half a step after the last one; the weights of the
    samples in it, and its uncertainty from not knowing where in this step it ends."""
    x = (z - z[-1]) / (z[0] - z[-1])
    step = 1.0 / (z.size - 1)
    places = np.vander(np.append(-0.5 * step, np.linspace(0.0, 1.0, 201)), order + 1)
    inverse = np.linalg.pinv(np.vander(x, order + 1))
    values = places @ (inverse @ d)
    at = int(np.argmin(values))
    by_step = 2.0 * abs(float(values[1] - values[0])) / math.sqrt(12.0) if at == 0 else 0.0
    return float(values[at]), places[at] @ inverse, by_step
