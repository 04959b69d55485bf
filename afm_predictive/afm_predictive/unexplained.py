"""What the model does not explain: gain of the lateral signal, slow force, stiffness.

A Kalman filter for each axis, docs/predictive.md (8.6). The force that the last drive has left over moves no free
scanner: it is friction, a slow force b (drift, creep, hysteresis), and what a spring that is c stiffer holds,

    F = gamma f + b + c q,

where f is friction as measured by the lateral signal. Friction turns with the motion, b and c q do
not: that separates them.

At the start a tip that rests is held by spring, friction and load alone: what the drive leaves over then is what the
piezo differs by from the position sensors, or these from it.
"""

import math
from typing import Any

from afm_model.parts import Measurement, hypot, kernel, square

from .constants import AT_X, FIRST_Z, FLOOR, KNOWN, UNEXPLAINED, Constants
from .nominal_plant import (
    balance,
    drive_in_force,
    held_along_z,
    left_at_rest,
    left_over,
    look_at_known,
    stretched,
)
from .sample_estimate import REST, SLIDES, TELLS, variance, write_row
from .state import State

GAIN_LIMITS = (0.1, 10.0)
_SLIDING = 3e-3
"""Noise of friction over a period of one time unit while the tip slides, over the bound: its load is not static."""
_NO_NOISE = 0.0075
"""Of positions alone: deviation of a force in addition to the noise of the sensors, over friction. What no
number of the model explains is no noise, and would be explained by all of them."""
_SLOW = 2.0
"""Speed over the largest one of the reference beyond which positions alone show no balance of forces."""
SEEMS = 5.0
"""Standard deviations of a position by which a tip may seem to have moved."""
NOTHING = (1.0, 0.0, 0.0)
"""Gamma, b, c of a model that explains all."""
SAME = 0.005
"""Difference of a drive from the planned one that a converter makes, over friction."""
_STEADY = 10.0
"""Periods for which answers must have been equally late, for another delay than the configured one to be believed."""
COUNTS = 0.003
"""Of positions alone: rms force over that of friction that contradicts the model, later half of it; twice as much does
so at once. In packets half of all that."""
_OF_Y = 0.05
"""Deviation of the gain of y from that of x, which no force shows with positions alone."""
_SPAN = 100.0
"""Time of that mean [1/w0]."""
_COUNTS_ACROSS = 0.003
"""In packets: force across the motion over that of friction that contradicts the model."""
_UNEVEN_Z = 0.02
"""Noise of the force along z, over that of a change of the load by the largest height of the sample."""
_UNSEEN = 0.3
"""And over a surface that is seen under the tip only, a radian on."""
_SURE = 3.0
"""Standard deviations."""
_TELLS = 0.3
"""Smallest cosine between the motion and x at which the force along x shows friction along y, in packets."""
_SLOW_AT_START = 0.003
"""Deviation of a slow force at the start, over the bound of friction."""
_ANOTHER_ZERO = 5.0
"""And by which a drive has to be, to have another zero."""
_ALIKE = 0.1
"""Part of friction by which signal and drive may disagree about it at the start."""
_RESTS_AT_START = 0.1
"""Way of a tip in a control period up to which it rests at the start [x0]."""


@kernel
def believe(axis: int, numbers: Any, s: State) -> None:
    """Believe in these gamma, b, c of an axis."""
    s.gain_of[axis], s.slow[axis], s.softer[axis] = numbers[0], numbers[1], numbers[2]


@kernel
def update(axis: int, innovation: float, friction: float, q: float, noise: float, p: Constants, s: State) -> None:
    """Kalman update of an axis by a force that what is believed does not explain, with this friction and place."""
    write_row(friction, q, s)
    P, h, x = s.unsure, s.tells, s.learned
    innovation -= h[0] * (x[axis, 0] - s.gain_of[axis]) + h[1] * (x[axis, 1] - s.slow[axis])
    innovation -= h[2] * (x[axis, 2] - s.softer[axis])
    total = noise * noise
    # Along z there are b and c alone.
    begin, end = (1, 3) if axis == 2 else (0, UNEXPLAINED)
    for i in range(begin, end):
        s.weight[i] = 0.0
        for j in range(begin, end):
            s.weight[i] += P[axis, i, j] * h[j]
        total += h[i] * s.weight[i]
    # What is off by more than noise is another force for a moment, of which the filter knows nothing.
    most = _SURE * math.sqrt(total)
    change = min(max(innovation, -most), most) / total
    for i in range(begin, end):
        x[axis, i] += s.weight[i] * change
    for i in range(begin, end):
        first, gain = p.first[axis, i], s.weight[i] / total
        for j in range(begin, end):
            P[axis, i, j] -= gain * s.weight[j]
        P[axis, i, i] = max(P[axis, i, i], 0.0) + p.walk[axis, i]
        # None is less certain than at the start: what is believed then stays so.
        if P[axis, i, i] > first * first:
            part = first / math.sqrt(P[axis, i, i])
            for j in range(begin, end):
                P[axis, i, j] *= part
                P[axis, j, i] *= part
    if axis < 2:
        x[axis, 0] = min(max(x[axis, 0], GAIN_LIMITS[0]), GAIN_LIMITS[1])
        believe(axis, x[axis], s)


@kernel
def expect(slot: int, p: Constants, s: State) -> None:
    """Keep the scanner predicted to the end of a slot, the drive in it, and the mean friction so far."""
    s.expected[2, 0], s.expected[2, 1], s.expected[2, 2] = s.Z, s.V_Z, s.plan[slot, 2]
    for axis in range(2):
        s.expected[axis, 0], s.expected[axis, 1] = (s.X, s.V_X) if axis == 0 else (s.Y, s.V_Y)
        s.expected[axis, 2] = s.plan[slot, axis]
        before = s.expected[axis, 3] if slot > 0 else 0.0
        s.expected[axis, 3] = before + s.gain_of[axis] * s.impulse[axis] / p.hold


@kernel
def explain_measured(y: Measurement, p: Constants, s: State) -> None:
    """Learn from positions alone: what a drive holds in place but for friction, the motion being slow.

    The force left over is that at the measured position, not at the one that is estimated with these numbers. They are
    used only while they explain a force that counts: their noise would move the copy of the plant, which is trusted
    more than a position.
    """
    signal = y.lateral_force / p.lateral_force
    q = y.position[0] / p.x0
    believe(0, s.learned[0], s)
    u = drive_in_force(0, y, p, s)
    left = s.gain_of[0] * (balance(0, u, q, p, s) - signal)
    # Place and friction that explain it are free of its noise, which would pass for a spring that holds nothing.
    moves = abs(s.V_X) > REST * s.fastest
    if moves:
        s.place_x, friction = s.X - s.change[AT_X], signal
    else:
        if s.started == 0.0 or abs(q - s.place_x) > SEEMS * p.position_noise:
            s.place_x = q
        friction = balance(0, u, s.place_x, p, s)
    noise = p.stiffness[0] * p.position_noise + p.force_noise + p.f_0 * _NO_NOISE
    # Where the motion is not steady the drive does not hold it.
    noise += abs(s.V_X - s.seen[0, 1]) / p.hold
    s.seen[0, 1] = s.V_X
    went = hypot(q - s.at_x, y.position[1] / p.x0 - s.at_y)
    if went < _SLOW * s.fastest * p.hold + SEEMS * p.position_noise:
        update(0, left, friction, stretched(0, s.place_x, s), noise, p, s)
    force = (s.gain_of[0] - 1.0) * signal + s.slow[0] + s.softer[0] * stretched(0, q, s)
    of_force = variance(0, signal, stretched(0, q, s), s)
    # What counts while x moves does so behind a pause, too.
    if moves:
        s.counts += min(p.hold / _SPAN, 1.0) * (square(force) - of_force - s.counts)
    # In packets the motion magnifies what is left.
    counts = COUNTS * p.f_0 * (0.5 if p.slots > 1 else 1.0)
    if abs(force) > 2.0 * counts + _SURE * math.sqrt(of_force):
        s.counts = max(s.counts, square(force) - of_force)
    least = counts * (0.5 if s.contradicted != 0.0 else 1.0)
    s.contradicted = 1.0 if s.counts > least * least else 0.0
    if s.contradicted == 0.0:
        believe(0, NOTHING, s)
    # Spring and gain are taken to be as wrong as along x, since no force tells them. With a
    # gain of x alone friction would seem to lie in another direction, and to be of another strength. As long as the tip
    # has not slipped along x nothing is known of it.
    if s.slips > 0.0:
        s.gain_of[1], s.softer[1] = s.gain_of[0], s.softer[0] * p.stiffness[1] / p.stiffness[0]
    else:
        believe(1, NOTHING, s)
    s.unsure[1, 0, 0] = s.unsure[0, 0, 0] + square(_OF_Y)


@kernel
def learn_across(signal: float, u_x: float, u_y: float, p: Constants, s: State) -> None:
    """Learn of y from the direction in which the tip slides under the drive in force.

    Friction turns a tip of speed v within v / f until nothing pushes across its way, whatever drives it along. So
    y follows from x, also where the tip stops and starts between two measurements. Used from the first time on that it
    contradicts what is believed.
    """
    v_x, v_y = s.V_X, s.V_Y
    speed = hypot(v_x, v_y)
    if speed <= SLIDES * s.fastest or abs(v_x) < _TELLS * speed:
        return
    t_x, t_y = v_x / speed, v_y / speed
    f_y = signal * t_y / t_x
    left_x = s.gain_of[0] * (balance(0, u_x, s.X, p, s) - signal) - p.damping[0] * s.V_X
    left_y = s.gain_of[1] * (balance(1, u_y, s.Y, p, s) - f_y) - p.damping[1] * s.V_Y
    across = t_x * left_y - t_y * left_x
    # The faster the tip the later it turns.
    turning = p.f_0 * (1.0 + square(speed / s.fastest))
    if abs(across) > _COUNTS_ACROSS * turning:
        s.knows_y = 2.0
    if s.knows_y == 2.0:
        noise = (
            hypot(FLOOR * turning + p.force_noise, t_y * math.sqrt(variance(0, signal, stretched(0, s.X, s), s))) / t_x
        )
        update(1, across / t_x, f_y, stretched(1, s.Y, s), noise, p, s)


@kernel
def update_of_z(innovation: float, of_c: float, noise: float, p: Constants, s: State) -> None:
    """Kalman update of z by a force, or a position, in which c is seen so strongly."""
    update(2, innovation, 0.0, of_c, noise, p, s)
    # More than what is likely at the start is another mistake, such as of the delay.
    for i in range(1, 3):
        s.learned[2, i] = min(max(s.learned[2, i], -p.first[2, i]), p.first[2, i])
    believe(2, s.learned[2], s)


@kernel
def learn_of_z(u: float, p: Constants, s: State) -> None:
    """Learn of z from what the drive u of the last period has left over; the scanner is in the state as it is now.

    There the load is the only other force. It is not the one predicted where the tip is at another place than
    predicted, or the surface another one.
    """
    if abs(u - s.expected[2, 2]) >= SAME * p.stiffness[2] * p.height:
        return
    phase = p.wave_number * hypot(s.X - s.expected[0, 0], s.Y - s.expected[1, 0])
    if s.unknown != 0:
        phase += _UNSEEN * min(p.wave_number * s.fastest * p.hold, 1.0)
    noise = p.of_both * p.eta_c2 * p.height * (_UNEVEN_Z + phase)
    update_of_z(left_over(2, s.Z, s.V_Z, u, p, s), stretched(2, s.Z, s), noise, p, s)


@kernel
def learn_stiffness_of_z(missed: float, p: Constants, s: State) -> None:
    """Learn the stiffness of z from what its measured position is off the copy, of positions alone.

    By recursive prediction errors: the sensitivity of the copy to that number follows the equations of the copy and of
    its corrections. L. Ljung, *System Identification*, Prentice Hall (1999), 11.4.
    """
    moved, before = s.moved_by_c, s.learned[2, 2]
    v, v_rate = moved[0], moved[1]
    moved[0] = p.Phi_hold[2, 0, 0] * v + p.Phi_hold[2, 0, 1] * v_rate - p.Gamma_hold[2, 0] * stretched(2, s.Z, s)
    moved[1] = p.Phi_hold[2, 1, 0] * v + p.Phi_hold[2, 1, 1] * v_rate - p.Gamma_hold[2, 1] * stretched(2, s.Z, s)
    L_0, L_1 = p.L[s.unknown, 0], p.L[s.unknown, 1]
    # A Kalman filter that corrects by L_0 has innovations of this variance.
    update_of_z(missed, moved[0], p.z_noise / math.sqrt(1.0 - L_0), p, s)
    change = s.learned[2, 2] - before
    s.Z += moved[0] * change
    s.V_Z += moved[1] * change
    moved[1] -= L_1 * moved[0]
    moved[0] -= L_0 * moved[0]


@kernel
def explain(k: int, y: Measurement, p: Constants, s: State) -> None:
    """Learn from measurement k; the scanner is in the state as it is there."""
    signal = y.lateral_force / p.lateral_force
    u_x, u_y = drive_in_force(0, y, p, s), drive_in_force(1, y, p, s)
    # An answer that came late, or a drive that was cut off, is not what was predicted with: the drives of an older
    # packet differ little in sum from those of the newer one, and each by more than what is learned.
    age = k - y.drive_sequence
    s.steady = s.steady + 1.0 if age == s.age else 0.0
    s.age = age
    known = y.drive_sequence < 0 or y.drive_sequence == s.expects or s.steady > _STEADY
    known = known and s.started != 0.0 and k - s.last == 1
    known = known and abs(u_x - s.expected[0, 2]) + abs(u_y - s.expected[1, 2]) < SAME * p.f_0
    if known:
        learn_of_z(drive_in_force(2, y, p, s), p, s)
    v_x, v_y = s.V_X, s.V_Y
    from_x, from_y = s.seen[0, 1], s.seen[1, 1]
    before, speed = hypot(from_x, from_y), hypot(v_x, v_y)
    d_x, d_y = s.X - s.seen[0, 0], s.Y - s.seen[1, 0]
    q_x, q_y = stretched(0, s.X - 0.5 * d_x, s), stretched(1, s.Y - 0.5 * d_y, s)
    way = hypot(d_x, d_y)
    # How far the motion is from a steady one, over its way.
    uneven = hypot(d_x - p.hold * v_x, d_y - p.hold * v_y) + hypot(d_x - p.hold * from_x, d_y - p.hold * from_y)
    if known and max(before, speed) <= REST * s.fastest:
        # At rest friction is what the drive in force leaves.
        held = s.gain_of[0] * (balance(0, u_x, s.X, p, s) - signal)
        update(0, held, signal, stretched(0, s.X, s), p.f_0 * FLOOR + p.force_noise, p, s)
    elif known and SLIDES * s.fastest * p.hold < way < 1.5 * s.fastest * p.hold and uneven < 0.4 * way:
        phase = p.wave_number * (abs(d_x) + abs(d_y))
        noise = p.f_0 * (_SLIDING * p.hold + p.ripple * min(phase * phase / 12.0, 1.0)) + p.force_noise
        # Where the motion is not steady neither is the load.
        noise *= 1.0 + square(10.0 * uneven / way)
        mean = 0.5 * (signal + s.signal)
        tells = abs(d_x) > (TELLS if p.slots == 1 else _TELLS) * way
        across = 0.0
        if tells and p.slots == 1:
            # Across the motion friction turns with it, by which it hides another force: there the drive is balanced.
            # In a packet the tip goes too far between two measurements.
            p_x = s.expected[0, 3] - s.gain_of[0] * mean
            p_y = s.expected[1, 3] - s.gain_of[1] * mean * d_y / d_x
            across = (p_y * d_x - p_x * d_y) / (way * way)
        resists = left_over(0, s.X, s.V_X, u_x, p, s) - across * d_y
        update(0, resists, mean, q_x, noise, p, s)
        if tells:
            turned = abs(d_x * v_y - d_y * v_x) + abs(d_x * from_y - d_y * from_x)
            noise += p.f_0 * turned / (way * s.fastest)
            resists = left_over(1, s.Y, s.V_Y, u_y, p, s) + across * d_x
            update(1, resists, mean * d_y / d_x, q_y, noise, p, s)
            s.knows_y = max(s.knows_y, 1.0)
    elif known and p.slots == 1 and way > SLIDES * s.fastest * p.hold:
        # A tip that is thrown tells no force, but what x alone tells from then on is not that of y.
        s.knows_y = max(s.knows_y, 1.0)
    if p.slots > 1:
        learn_across(signal, u_x, u_y, p, s)
    if s.knows_y == 0.0:
        # As long as nothing is known of y: what is wrong about friction is so along both.
        s.gain_of[1] = s.learned[1, 0] = s.gain_of[0]
    s.seen[0, 0], s.seen[0, 1], s.seen[1, 0], s.seen[1, 1] = s.X, s.V_X, s.Y, s.V_Y
    s.signal = signal


@kernel
def find_zeros_at_start(y: Measurement, p: Constants, s: State) -> None:
    """Take what is left over at the start for the zero of the drive, if the tip rests.

    Either the tip has been set down, and friction holds nothing; or signal and drive show the same friction of x, which
    lies along the reference. Along z the load is measured.
    """
    moves = hypot(y.velocity[0], y.velocity[1]) / (p.x0 * p.w0) * p.hold
    if s.fallbacks > 0.0 or (p.measured == 0 and moves > _RESTS_AT_START):
        return
    least, least_z = _SLOW_AT_START * p.f_0, FIRST_Z[1]
    if p.measured != 0:
        least += _ANOTHER_ZERO * hypot(p.stiffness[0] * p.position_noise, p.force_noise)
        least_z += _ANOTHER_ZERO * p.stiffness[2] * p.z_noise
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
