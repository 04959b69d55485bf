"""What drive and lateral signal are off from where nothing moves, docs/predictive.md, Zeros, (8.14).

The drive: at the start a tip that rests is held by spring, friction and load alone. What is left over is what the piezo
is off from the position sensors, or these from it.

The lateral signal, at first: before the tip slips the signal is the friction that the drive leaves. What it is off from
that is its zero.

The lateral signal, later: friction turns with the motion, the zero does not. On a stroke of the reference along x, from
turn to turn, the mean of the signal is r n + F_0, where n is the mean nominal bound times the cosine of the way, and r
the ratio of friction to it. A stroke and the way back tell both. No model of the scanner is needed for that.
"""

import math

from afm_model.parts import Measurement, hypot, kernel, square

from .constants import FIRST_Z, FLOOR, KNOWN, LEARNED, MEAN, POINTS, RATIO, VALUE, Constants
from .continuation import FRICTION
from .map import begin_map
from .nominal_plant import (
    balance,
    drive_in_force,
    held_along_z,
    left_at_rest,
    look,
    look_at_known,
    nominal_bound,
)
from .state import State

_SLOW, _SLOW_LATER = 0.003, 0.01
"""Deviation of a slow force at the start, and later, over the bound of friction."""
_GAIN = 0.1
"""Deviation of the gain of the signal."""
_LOOP, _LOOP_PACKET = 4e-4, 1e-3
"""Deviation of what a loop tells, over friction; in packets, where the tip goes unevenly."""
_WALK = 5e-4
"""Random walk of the zero from turn to turn, over the bound of friction."""
_CERTAIN = 2.0
"""Standard deviations from which on a zero is believed."""
_ANOTHER = 3.0
"""And by which a loop has to be off to be one of another zero."""
_FAR = 5.0
"""And by which a drive has to be, to have another zero."""
_ALIKE = 0.1
"""Part of friction by which signal and drive may tell another one at the start."""
_RESTS = 0.1
"""Way of a tip in a control period up to which it rests at the start [x0]."""
_HOLDS = 0.25
"""Friction, over its bound as told, that holds a tip for certain."""
_STEADY = 0.9
"""Rate of the tip less that of the reference, over the latter, up to which the tip goes as asked."""
_NEAR = 0.3
"""Radians of the shortest wave by which it is off the reference then, at most; in packets that tells nothing."""
_SHORTEST = 1.0
"""Least way of a stroke on which it does, in radians of the shortest wave."""
_MOST = 0.5
"""Least part of the way of a stroke on which it does."""
_BACK = 0.3
"""Radians of it from where a stroke ends to where the one before began, up to which it is the way back."""
_OTHER_MAP = 0.002
"""Change of the zero, over the bound of friction, behind which a map of friction counts no more."""
_SIGNAL, _SQUARE, _NOMINAL, _WAY, _ASKED, _FROM_X, _FROM_Y = range(7)
"""Of a stroke: sums over the way along x of the signal, its square, and of the nominal bound times the cosine; that
way; the way of the reference; where it began."""


@kernel
def forget_zero(s: State) -> None:
    """Nothing is known of it."""
    s.zero = s.zero_found = s.other_zero = s.known_at_rest = s.sense = s.steady = 0.0
    s.variance_of_zero = 1.0
    s.strokes[:] = 0.0


@kernel
def believe_zero(p: Constants, s: State) -> None:
    """Believe in the zero once it is certain.

    What was seen with the one before is put right: slow force, friction in this sense.
    """
    if s.zero == 0.0 and square(s.zero_found) < square(_CERTAIN) * s.variance_of_zero:
        return
    change = s.zero_found * p.f_0 - s.zero
    s.zero += change
    if s.started == 0.0:
        return
    s.learned[0, 1] += s.gain_of[0] * change
    if p.measured == 0:
        s.slow[0] += s.gain_of[0] * change
    if s.slips == 0.0 or s.sense == 0.0 or s.strokes[1, _WAY] == 0.0:
        return
    less = change * s.strokes[1, _WAY] / s.strokes[1, _NOMINAL]
    s.ratio[VALUE] -= less
    s.ratio[MEAN] -= less
    for i in range(POINTS):
        s.found[i, FRICTION] -= less
    s.P[RATIO, RATIO] += square(less)
    if p.surface == LEARNED and abs(change) > _OTHER_MAP * p.f_0:
        begin_map(p, s)


@kernel
def find_zero_at_rest(y: Measurement, p: Constants, s: State) -> None:
    """Learn from a tip that has not slipped yet."""
    signal, held = y.lateral_force / p.lateral_force, balance(0, drive_in_force(0, y, p, s), y.position[0] / p.x0, p, s)
    if s.slips > 0.0 or abs(held) > _HOLDS * p.f_0:
        s.known_at_rest = 0.0
        return
    # Where the tip is held the gain of the signal counts too.
    variance = square(_GAIN * held) + square(FLOOR * p.f_0)
    if p.measured != 0:
        variance += square(p.stiffness[0] * p.position_noise) + square(p.force_noise)
    weight = square(p.f_0) / variance
    s.known_at_rest += weight
    s.zero_found += weight / s.known_at_rest * ((signal - held) / p.f_0 - s.zero_found)
    s.variance_of_zero = square(_SLOW) + 1.0 / s.known_at_rest
    believe_zero(p, s)


@kernel
def find_zeros_at_start(y: Measurement, p: Constants, s: State) -> None:
    """Take what is left over at the start for the zero of drive and signal, if the tip rests.

    Either the tip has been set down, and friction holds nothing; or signal and drive tell the same friction of x, which
    lies along the reference. Along z the load is measured.
    """
    moves = hypot(y.velocity[0], y.velocity[1]) / (p.x0 * p.w0) * p.hold
    if s.fallbacks > 0.0 or (p.measured == 0 and moves > _RESTS):
        return
    least, least_z = _SLOW * p.f_0, FIRST_Z[1]
    if p.measured != 0:
        least += _FAR * hypot(p.stiffness[0] * p.position_noise, p.force_noise)
        least_z += _FAR * p.stiffness[2] * p.z_noise
    signal = y.lateral_force / p.lateral_force
    off_x = left_at_rest(0, drive_in_force(0, y, p, s), y.position[0] / p.x0, p, s)
    off_y = left_at_rest(1, drive_in_force(1, y, p, s), y.position[1] / p.x0, p, s)
    if abs(signal - off_x) < least + _ALIKE * abs(off_x):
        off_y -= off_x * s.v[1] / s.v[0] if s.v[0] != 0.0 else 0.0
        off_x = 0.0
    z, tip = y.position[2] / p.z0, p.a + y.deflection / p.z0
    off_z = left_at_rest(2, drive_in_force(2, y, p, s), z, p, s) - held_along_z(tip - z, p)
    s.zero_of_drive[0] = off_x if abs(off_x) > least else 0.0
    s.zero_of_drive[1] = off_y if abs(off_y) > least else 0.0
    s.zero_of_drive[2] = off_z if abs(off_z) > least_z else 0.0
    for axis in range(3):
        # Along z the cantilever is a part of the spring, and a sensor that is off tells a wrong load as well.
        spring = p.stiffness[axis] - (p.of_both * p.eta_c2 if axis == 2 else 0.0)
        s.unstretched[axis] = -s.zero_of_drive[axis] / spring
    if p.surface == KNOWN:
        # Where the sample lies tells which of the two is off.
        look_at_known(y.position[0] / p.x0, y.position[1] / p.x0, p, s)
        off = tip - z + p.delta + p.delta_curvature * s.curvature - s.height
        s.zero_of_height = -s.unstretched[2] if abs(off + s.unstretched[2]) < abs(off) else 0.0
    if p.finds_zero != 0:
        find_zero_at_rest(y, p, s)


@kernel
def compare_strokes(p: Constants, s: State) -> None:
    """Learn from the stroke that has ended if it is the way back of the one before."""
    there, back = s.strokes[0], s.strokes[1]
    way = p.wave_number * min(abs(there[_WAY]), abs(back[_WAY]))
    apart = p.wave_number * (abs(s.p[0] - there[_FROM_X]) + abs(s.p[1] - there[_FROM_Y]))
    if way < _SHORTEST or way < _MOST * p.wave_number * abs(back[_ASKED]) or apart > _BACK:
        return
    mean_there, n_there = there[_SIGNAL] / there[_WAY], there[_NOMINAL] / there[_WAY]
    mean_back, n_back = back[_SIGNAL] / back[_WAY], back[_NOMINAL] / back[_WAY]
    ratio = (mean_there - mean_back) / (n_there - n_back)
    found = (mean_back - ratio * n_back) / p.f_0
    # Where the tip did not go as asked one of them is on other waves of the surface.
    missed = max(2.0 - there[_WAY] / there[_ASKED] - back[_WAY] / back[_ASKED], 0.0)
    uneven = back[_SQUARE] / back[_WAY] - square(mean_back) + there[_SQUARE] / there[_WAY] - square(mean_there)
    part = missed / math.sqrt(max(missed * way, 1.0))
    variance = square((_LOOP if p.slots == 1 else _LOOP_PACKET) * ratio) + square(part / p.f_0) * max(uneven, 0.0)
    # The balance of forces tells the zero less a slow force: one that needs much of that is an error of the loop.
    off = found - (s.zero - s.learned[0, 1] / s.gain_of[0]) / p.f_0
    if off * off > square(_ANOTHER) * (variance + square(_SLOW_LATER) + s.unsure[0, 1, 1] / square(p.f_0)):
        return
    s.variance_of_zero += square(_WALK)
    change = square(found - s.zero_found)
    if change > square(_ANOTHER) * (s.variance_of_zero + variance):
        # Friction that has changed between two strokes tells another zero too, but not twice the same.
        again = square(found - s.other_zero) < min(square(_ANOTHER) * 2.0 * variance, 0.25 * change)
        s.other_zero = found
        if not again:
            return
        s.variance_of_zero += change
    gain = s.variance_of_zero / (s.variance_of_zero + variance)
    s.zero_found += gain * (found - s.zero_found)
    s.variance_of_zero *= 1.0 - gain
    believe_zero(p, s)


@kernel
def find_zero(y: Measurement, p: Constants, s: State) -> None:
    """Learn from a tip that rests, and on a stroke; at a turn along x compare it with the one before."""
    if s.known_at_rest > 0.0 and s.started != 0.0:
        find_zero_at_rest(y, p, s)
    signal, speed = y.lateral_force / p.lateral_force, hypot(s.v[0], s.v[1])
    # What rests between two measurements holds less than its bound. Positions alone tell no rate of a tip that is lost.
    goes = s.V_X if p.measured == 0 or s.distrust < 1.0 else s.v[0]
    went = (s.X - s.at_x) / p.hold if p.measured == 0 or p.slots > 1 or s.distrust == 1.0 else s.v[0]
    near = p.slots > 1 or p.wave_number * (abs(s.X - s.p[0]) + abs(s.Y - s.p[1])) < _NEAR
    steady = 1.0 if near and max(abs(goes - s.v[0]), abs(went - s.v[0])) < _STEADY * abs(s.v[0]) else 0.0
    sense, now = 0.0 if s.v[0] == 0.0 else math.copysign(1.0, s.v[0]), s.strokes[1]
    if sense != 0.0 and sense == s.sense:
        step = s.p[0] - s.asked_x
        now[_ASKED] += step
        if steady * s.steady > 0.0 and speed > 0.0:
            look(s.X, s.Y, p, s)
            mean = 0.5 * (signal + s.stroke_signal)
            now[_SIGNAL] += mean * step
            now[_SQUARE] += mean * mean * step
            now[_NOMINAL] += nominal_bound(s.load, p, s) * s.v[0] / speed * step
            now[_WAY] += step
    elif sense != 0.0:
        if s.sense != 0.0:
            compare_strokes(p, s)
        for i in range(len(now)):
            s.strokes[0, i], now[i] = now[i], 0.0
        now[_FROM_X], now[_FROM_Y] = s.p[0], s.p[1]
        s.sense = sense
    s.stroke_signal, s.asked_x, s.steady = signal, s.p[0], steady
