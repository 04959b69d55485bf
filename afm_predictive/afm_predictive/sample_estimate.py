"""What the law learns of the sample: its height under the tip and the strength of friction, with their slopes."""

import math
from typing import TYPE_CHECKING, Any

from afm_model.parts import hypot, kernel, routine, square

from .constants import (
    AT_X,
    AT_Y,
    FOLLOWED,
    GONE,
    JUMPED,
    MEAN,
    OF_BOTH,
    OF_SLOPE,
    OF_VALUE,
    SLOPE_X,
    SLOPE_Y,
    UNEXPLAINED,
    VALUE,
    WAY_X,
    WAY_Y,
    Constants,
)
from .map import JUMP, raise_map
from .nominal_plant import (
    balance,
    beyond,
    left_over,
    look,
    look_at_known,
    nominal_bound,
    steps,
    stretched,
)

if TYPE_CHECKING:
    from .state import State

ROUGH = 0.35
"""Rms second derivative along a line of a surface of unit height and wave number: that of half a wave, 1/(2 sqrt 2)."""
_ANOTHER, _ANOTHER_FULL = 0.0225, 5e-4
"""Mean square over a wave by which a known surface is off the measured height, over its own, from which on it is
another; the same of single drives and full feedback, where one that is seen under the tip is as good as a true one."""
_THE_SAME = 0.25
"""Part of that below which it is the given one again."""
_ONE_ALONE = 4.0
"""The most that one measurement counts, over that."""
_LONGER = 6.0
"""Waves in place of one, in packets with positions alone."""
_HELD = 0.5
"""Radians of the shortest wave by which a tip that rests is off the reference, from which on friction holds it, however
little is known of y."""
TELLS = 0.005
"""Smallest cosine between the motion and x at which the force along x shows friction, rates being measured."""
_TELLS_IN_PACKETS = 0.05
"""The same in packets, where the motion between two measurements is not steady."""
TOUCHES = 0.1
"""Ratio of friction above which the tip is on the sample for certain: in the air there is no friction."""
APPROACH = 0.005
"""By so much nearer to the sample than it is the tip is asked for, where it is not [z0]: 5 um/s at 50 us."""
_AWAY = 2.0
"""How far the sample is at most from where it was touched last, over its largest height."""
REST = 0.02
"""Speed over the largest one of the reference up to which the tip counts as resting."""
SLIDES = 0.2
"""Speed over the largest one of the reference from which on the tip counts as sliding."""
_LEAST_RATIO = 0.1
"""Of friction, of which what is uneven about it is a part."""
_INDEX = 10.0
"""Largest tracking index, change in a step over noise: a surface that is sampled coarsely is not trusted beyond it."""


@kernel
def begin(f: Any, value: float, size: float, floor: float, p: Constants) -> None:
    """Begin to follow a quantity of amplitude `size`."""
    for i in range(FOLLOWED):
        f[i] = 0.0
    f[VALUE] = f[MEAN] = value
    f[OF_VALUE] = floor * floor
    f[OF_SLOPE] = square(size * p.wave_number)


@kernel
def bend_of(way: float, t_x: float, t_y: float, size: float, p: Constants) -> float:
    """Rms change of the slope of a quantity of amplitude `size`, on a way along t."""
    q = p.wave_number * (abs(t_x) + abs(t_y))
    return ROUGH * size * q * q * way


@kernel
def believed(f: Any, innovation: float, variance: float, seen: float) -> bool:
    """Return whether a measurement counts: an outlier, one that jumps by itself, does not.

    A second one in succession does, and one of which another signal has seen the larger part, `seen`; nan: every one.
    """
    before = f[JUMPED]
    f[JUMPED] = 1.0 if innovation * innovation > JUMP * JUMP * variance else 0.0
    alone = 2.0 * seen * innovation <= innovation * innovation  # false of nan
    return f[JUMPED] == 0.0 or before != 0.0 or not alone


@routine
def follow(
    f: Any, measured: float, d_x: float, d_y: float, size: float, floor: float, p: Constants, seen: float
) -> bool:
    """Kalman filter of value and slope along the way, a step d further on.

    The second derivative is taken as constant in a step and independent from step to step, as in the tracking filters
    of P. R. Kalata, IEEE Trans. Aerosp. Electron. Syst. 20 (1984) 174, doi:10.1109/TAES.1984.310438.

    Parameters
    ----------
    f : vector
    measured : float
    d_x, d_y : float [x0]
    size, floor : float
        Amplitude of the quantity; noise of the measurement.
    """
    way = math.sqrt(d_x * d_x + d_y * d_y)
    both, of_slope = f[OF_BOTH], f[OF_SLOPE]
    slope, q, t_x, t_y = 0.0, 0.0, 0.0, 0.0
    if way > 0.0:
        t_x, t_y = d_x / way, d_y / way
        q = p.wave_number * (abs(t_x) + abs(t_y))
        slope = f[SLOPE_X] * t_x + f[SLOPE_Y] * t_y
        if t_x * f[WAY_X] + t_y * f[WAY_Y] < 0.0:
            both = -both
    steepest = size * q
    bend = ROUGH * size * q * q * way
    of_value = f[OF_VALUE] + way * (2.0 * both + way * of_slope) + 0.25 * bend * bend * way * way
    both += way * of_slope + 0.5 * bend * bend * way
    of_slope += bend * bend
    # Neither is less certain than for any place.
    if way > 0.0 and of_slope > steepest * steepest:
        both *= steepest * steepest / of_slope
        of_slope = steepest * steepest
    if of_value > size * size:
        both *= size * size / of_value
        of_value = size * size
    expected = beyond(f, d_x, d_y, p)
    noise = max(floor, min(bend * way / _INDEX, size))
    innovation = measured - expected
    counts = believed(f, innovation, of_value + noise * noise, seen)
    if f[JUMPED] != 0.0 and counts:
        # Not the surface that was assumed: what came before does not count.
        of_value, both = innovation * innovation, 0.0
    gain, gain_slope = of_value / (of_value + noise * noise), both / (of_value + noise * noise)
    if not counts:
        innovation = gain = gain_slope = 0.0
    # The mean is that of the way gone, at most over a few waves.
    f[GONE] = min(f[GONE] + q * way, 8.0 * math.pi)
    if way > 0.0:
        f[MEAN] += min(q * way / f[GONE], 1.0) * (expected + innovation - f[MEAN])
    f[VALUE] = expected + gain * innovation
    if way > 0.0:
        slope = min(max(slope + gain_slope * innovation, -steepest), steepest)
        f[SLOPE_X], f[SLOPE_Y], f[WAY_X], f[WAY_Y] = slope * t_x, slope * t_y, t_x, t_y
    f[OF_SLOPE] = of_slope - gain_slope * both
    f[OF_VALUE] = (1.0 - gain) * of_value
    f[OF_BOTH] = (1.0 - gain) * both
    return counts


@kernel
def measured_height(z: float, p: Constants, s: "State") -> float:
    """Of the sample under the tip [z0], H = Q - Z + delta, the scanner at z and the contact at rest."""
    return s.Q - z + p.delta + p.delta_load * (s.load - p.load_0)


@kernel
def take_height(p: Constants, s: "State") -> None:
    """Follow the height of the sample under the tip, and its slope along the way."""
    H = measured_height(s.Z, p, s)
    if s.started == 0.0:
        begin(s.H, H, p.height, p.height_noise, p)
    else:
        follow(s.H, H, s.X - s.at_x, s.Y - s.at_y, p.height, p.height_noise, p, math.nan)


@kernel
def approach(ratio: float, p: Constants, s: "State") -> None:
    """Bring the sample nearer where there is no friction: the tip may be in the air, where it measures no height.

    There z would follow how the tip swings, and swing more and more. So the sample is looked for near the place where
    friction was measured last; farther away only as fast as it is brought nearer.
    """
    # Positions alone do not measure friction where it is not seen: while the model is not trusted that is not believed.
    certain = s.ratio[VALUE] >= TOUCHES and (p.measured == 0 or s.distrust == 0.0)
    if ratio > TOUCHES or s.started == 0.0 or certain:
        s.touched = s.H[VALUE]
    s.approach = 0.0
    if s.unknown == 0 or certain:
        return
    s.approach = APPROACH
    lowest, highest = s.touched - _AWAY * p.height, s.touched + _AWAY * p.height
    if s.H[VALUE] < lowest:
        s.touched -= APPROACH
    elif s.H[VALUE] > highest:
        s.touched += APPROACH
    for i in (VALUE, MEAN):
        s.H[i] = min(max(s.H[i], lowest), highest)


@kernel
def mean_ratio(s: "State") -> float:
    """Mean bound of friction over the nominal one, of which what is uneven about it is a part."""
    return max(s.ratio[MEAN], _LEAST_RATIO)


@kernel
def strength(s: "State") -> float:
    """Of friction over the nominal one, of which what is uneven about it is a part.

    Where friction is strong and the surface not known the tip is thrown, and throws itself: no more is believed there.
    """
    return mean_ratio(s) if s.unknown == 0 else min(mean_ratio(s), 1.0)


@kernel
def bumps(p: Constants, s: "State") -> float:
    """Ripple of the ratio over the surface as it is known."""
    return p.bumps[s.unknown] * min(p.bumps_left * mean_ratio(s), 1.0)


@kernel
def place_variance(s: "State") -> float:
    """Of a position that is estimated, of x and y together."""
    return s.P[AT_X, AT_X] + s.P[AT_Y, AT_Y]


@kernel
def doubt_surface(p: Constants, s: "State") -> None:
    """Compare the given surface with the height that is measured; as long as they differ the surface is unknown.

    To be called where the tip slips on the sample.
    """
    look_at_known(s.X, s.Y, p, s)
    H = measured_height(s.Z, p, s)
    higher = H + p.delta_curvature * s.curvature - s.height
    off = square(higher / p.height)
    noise = square(p.height_noise / p.height)
    if p.measured != 0:
        noise += square(p.wave_number) * place_variance(s)
    most = (_ANOTHER_FULL if p.measured == 0 and p.slots == 1 else _ANOTHER) + 4.0 * noise
    phase = p.wave_number * (abs(s.X - s.at_x) + abs(s.Y - s.at_y))
    # In packets of positions alone a tip that is thrown is estimated at a wrong place for some measurements.
    waves = _LONGER if p.measured != 0 and p.slots > 1 else 1.0
    part = min(phase / (2.0 * math.pi * waves), 1.0) if s.started != 0.0 else 0.0
    if s.unknown == 0 and s.zero_of_height != 0.0:
        # It comes from one measurement, with its noise.
        s.zero_of_height += part * higher
    s.contradicts += part * (min(off, _ONE_ALONE * most) - s.contradicts)
    before = s.unknown
    if s.unknown == 0 and s.contradicts > most:
        s.unknown, s.touched = 1, H
        begin(s.H, H, p.height, p.height_noise, p)
    elif s.unknown != 0 and s.contradicts < _THE_SAME * most:
        s.unknown = 0
    if s.unknown != before and p.measured == 0:
        s.slips = 0.0


@kernel
def write_row(friction: float, q: float, s: "State") -> None:
    """Write the row of a force left over, by gamma, b and c, into the state."""
    s.tells[0], s.tells[1], s.tells[2] = friction, 1.0, q


@kernel
def variance(axis: int, friction: float, q: float, s: "State") -> float:
    """Of the force that unexplained.py expects to be left over."""
    write_row(friction, q, s)
    P, h, total = s.unsure, s.tells, 0.0
    for i in range(UNEXPLAINED):
        for j in range(UNEXPLAINED):
            total += h[i] * P[axis, i, j] * h[j]
    return max(total, 0.0)


@routine
def take_ratio(force: float, u_x: float, u_y: float, p: Constants, s: "State") -> float:
    """Follow the bound of friction over the nominal one.

    It comes from the lateral force while the tip slips, and from the balance of forces at rest.

    Parameters
    ----------
    force : float [m_p w0^2 x0]
        Friction along x.
    u_x, u_y : float [w0^2 x0]
        Drive in force until now.

    Returns
    -------
    float
        What was measured; zero if nothing was.
    """
    look(s.X, s.Y, p, s)
    nominal = nominal_bound(s.load, p, s)
    speed = hypot(s.V_X, s.V_Y)
    seen = left_over(0, s.X, s.V_X, u_x, p, s) / (s.gain_of[0] * nominal)
    if speed <= REST * s.fastest:
        b_x, b_y = balance(0, u_x, s.X, p, s), balance(1, u_y, s.Y, p, s)
        size = math.sqrt(b_x * b_x + b_y * b_y)
        lean = size / b_x if b_x != 0.0 else 0.0
        # Along x the signal tells friction; along y what the drive leaves, as well as that is known.
        if abs(b_x) > 0.3 * size:
            doubt = 0.0
            if s.slips > 0.0 and p.wave_number * hypot(s.X - s.p[0], s.Y - s.p[1]) < _HELD:
                doubt = 3.0 * math.sqrt(variance(1, b_y, stretched(1, s.Y, s), s)) * abs(b_y) / size
            size = max(abs(force) * size / abs(b_x) - doubt, abs(force))
        held = size / nominal
        off = max(held - s.ratio[VALUE], 0.0)
        if not believed(s.ratio, off, s.ratio[OF_VALUE] + square(p.ratio_noise), seen * lean):
            return 0.0
        s.ratio[VALUE] = max(s.ratio[VALUE], held)
        s.ratio[MEAN] = max(s.ratio[MEAN], held)
        # What a slope does not explain holds everywhere.
        if held > s.here + p.ripple:
            raise_map(held - s.here, s)
        return 0.0
    v_x = s.V_X
    if steps(p, s) and speed <= SLIDES * s.fastest:
        # A tip that comes to rest has no direction that tells friction.
        return 0.0
    if abs(v_x) <= (TELLS if p.slots == 1 else _TELLS_IN_PACKETS) * speed:
        return 0.0
    measured = force * speed / (v_x * nominal)
    noise = p.ratio_noise * max(1.0, 0.3 * speed / abs(v_x))
    d_x, d_y = s.X - s.at_x, s.Y - s.at_y
    s.slips += 1.0
    if s.unknown == 0:
        # Nothing of it is left to follow but what changes slowly: the mean over a wave of the surface.
        phase = p.wave_number * (abs(d_x) + abs(d_y))
        if not believed(s.ratio, measured - s.ratio[VALUE], square(p.ratio_noise), seen * speed / v_x):
            return 0.0
        if s.ratio[JUMPED] != 0.0:
            s.slips = 1.0
        s.ratio[VALUE] += max(1.0 / s.slips, min(phase / (2.0 * math.pi), 1.0)) * (measured - s.ratio[VALUE])
        s.ratio[MEAN] = s.ratio[VALUE]
    elif s.slips == 1.0:
        begin(s.ratio, measured, p.ripple, p.ratio_noise, p)
    else:
        # Without friction the tip is in the air: that is believed at once.
        seen = seen * speed / v_x if abs(measured) > TOUCHES else math.nan
        if not follow(s.ratio, measured, d_x, d_y, p.ripple, noise, p, seen):
            return 0.0
    return measured
