"""Positions alone: scanner and strength of friction in one Kalman filter, docs/predictive.md (8.9), (8.10).

A copy of the plant runs along, set-valued friction included. At the low speed of a reference friction turns the motion
at once into the balance of forces b, drive less spring: the scanner slips along b. So the errors of position, speed
along b, ratio of friction to its nominal bound and slope of that ratio along the way follow one linear model.
"""

import math

from afm_model.parts import Measurement, hypot, kernel, routine, square

from .constants import (
    ANSWERS,
    AT_X,
    AT_Y,
    GONE,
    MEAN,
    RATIO,
    SLOPE,
    SLOPE_X,
    SLOPE_Y,
    SLOTS,
    SPEED,
    VALUE,
    WAY_X,
    WAY_Y,
    Constants,
)
from .kalman import (
    DOUBTS,
    NIS,
    SURE,
    along_variance,
    carry_covariance,
    correct,
    take,
    take_height_seen,
    weigh,
)
from .nominal_plant import (
    NEAR_BY,
    balance,
    bound_at,
    drive_in_force,
    drive_of_period,
    look,
    move,
    nominal_bound,
    take_load,
)
from .sample_estimate import REST, bumps, strength
from .state import State

UNKNOWN = 0.25
"""Standard deviation of the ratio at the start."""
_STOPS = 3.0
"""Standard deviations for friction that is too low, and for a speed that is not zero."""
_OFF = 2.0
"""Standard deviations that friction of the copy may be off the measured one by noise; what is beyond moves the copy."""
_RINGS = 5e-4
"""Change of friction in a time unit between two measurements of it, over its bound, that no line has."""
_TELLS = 0.3
"""Smallest cosine between the motion and x at which the force along x shows friction."""
_OFTEN = 20.0
"""Measurements in which friction was seen from which on its mean is known."""
_PART_UNSEEN = 0.1
"""Part of a change of the ratio beyond its ripple that is believed where friction is not seen."""
_LESS = 300.0
"""By so many times the variance of the ratio over a known surface, for each unit beyond."""
_ON_MAP = 0.3
"""Bend of the ratio that a map leaves, over that of the surface."""


@kernel
def begin_observer(p: Constants, s: State) -> None:
    """At rest, at the first measured position."""
    s.P[:] = 0.0
    s.P[AT_X, AT_X] = s.P[AT_Y, AT_Y] = square(p.position_noise)
    s.P[RATIO, RATIO] = square(UNKNOWN) * p.identified
    s.P[SLOPE, SLOPE] = square(bumps(p, s) * p.wave_number)
    s.moved_by_c[:] = 0.0
    s.across = s.grip = s.off_force = 0.0
    s.nis = s.nis_of_height = 1.0


@kernel
def carry(way: float, t_x: float, t_y: float, nominal: float, p: Constants, s: State) -> None:
    """Carry the covariance through a control period in which the scanner goes so far along t."""
    F, P = s.carried, s.P
    F[:] = 0.0
    # Along t the free scanner that friction brakes; across it nothing moves.
    F[AT_X, AT_X], F[AT_X, AT_Y] = p.free[0, 0] * t_x * t_x + t_y * t_y, (p.free[0, 0] - 1.0) * t_x * t_y
    F[AT_Y, AT_X], F[AT_Y, AT_Y] = F[AT_X, AT_Y], p.free[0, 0] * t_y * t_y + t_x * t_x
    F[AT_X, SPEED], F[AT_Y, SPEED], F[SPEED, SPEED] = p.free[0, 1] * t_x, p.free[0, 1] * t_y, p.free[1, 1]
    F[SPEED, AT_X], F[SPEED, AT_Y] = p.free[1, 0] * t_x, p.free[1, 0] * t_y
    F[AT_X, RATIO], F[AT_Y, RATIO] = -p.of_drive[0] * nominal * t_x, -p.of_drive[0] * nominal * t_y
    F[SPEED, RATIO] = -p.of_drive[1] * nominal
    for i in range(3):
        F[i, SLOPE] = 0.5 * way * F[i, RATIO]
    F[RATIO, RATIO], F[RATIO, SLOPE], F[SLOPE, SLOPE] = 1.0, way, 1.0
    carry_covariance(P, F, s.half)
    # What counts is the largest error: the largest second derivative of a wave, not its rms one.
    q = p.wave_number * (abs(t_x) + abs(t_y))
    bend = square(bumps(p, s) * (_ON_MAP if s.mapped > 0.0 else 1.0) * q * q * way)
    P[RATIO, RATIO] += 0.25 * bend * way * way
    P[RATIO, SLOPE] += 0.5 * bend * way
    P[SLOPE, RATIO] += 0.5 * bend * way
    P[SLOPE, SLOPE] += bend
    # The load is not quite static, and less so where positions or heights are off by more than they should be.
    uneven = square(p.uneven[s.unknown]) + square(p.uneven[0]) * _LESS * max(max(s.nis, s.nis_of_height) - DOUBTS, 0.0)
    uneven *= square(strength(s))
    for i in range(3):
        for j in range(3):
            P[i, j] += uneven * F[i, RATIO] * F[j, RATIO]
    turned = square(p.astray)
    P[AT_X, AT_X] += turned * t_y * t_y
    P[AT_Y, AT_Y] += turned * t_x * t_x
    P[AT_X, AT_Y] -= turned * t_x * t_y
    P[AT_Y, AT_X] -= turned * t_x * t_y


@kernel
def rest(s: State) -> None:
    """What rests has no speed that is uncertain."""
    for i in range(5):
        s.P[SPEED, i] = s.P[i, SPEED] = 0.0


@kernel
def rests_for_certain(t_x: float, t_y: float, size: float, p: Constants, s: State) -> bool:
    """Whether copy and tip rest: what the drive leaves, so much along t, is below all likely bounds of friction.

    The place has been looked at.
    """
    nominal = nominal_bound(s.load, p, s)
    unsure = hypot(nominal * math.sqrt(s.P[RATIO, RATIO]), p.stiffness[0] * math.sqrt(along_variance(t_x, t_y, s)))
    return s.V_X == 0.0 and s.V_Y == 0.0 and size < s.here * nominal - _STOPS * unsure


@kernel
def doubt(miss: float, t_x: float, t_y: float, p: Constants, s: State) -> None:
    """Raise the variances for a position missed by more than noise: position, speed and ratio were not known."""
    speed = min(abs(miss) / p.hold, s.fastest)
    for i, t in ((AT_X, t_x), (AT_Y, t_y)):
        s.P[i, i] += miss * miss
        s.P[i, SPEED] += abs(miss) * speed * t
        s.P[SPEED, i] += abs(miss) * speed * t
    s.P[SPEED, SPEED] += speed * speed
    s.P[RATIO, RATIO] += square(min(abs(miss) / (p.of_drive[0] * p.f_0), UNKNOWN)) * p.identified


@kernel
def see_ratio(t_x: float, t_y: float, size: float, nominal: float, p: Constants, s: State) -> None:
    """Write the row of the ratio seen in the lateral force, which depends on the place as well.

    At another place the surface has another bound, and the balance of forces another direction.
    """
    ratio, on_map = s.here, s.mapped > 0.0
    look(s.X + NEAR_BY, s.Y, p, s)
    slope_x = (nominal_bound(s.load, p, s) / nominal * (s.here / ratio if on_map else 1.0) - 1.0) / NEAR_BY
    look(s.X, s.Y + NEAR_BY, p, s)
    slope_y = (nominal_bound(s.load, p, s) / nominal * (s.here / ratio if on_map else 1.0) - 1.0) / NEAR_BY
    look(s.X, s.Y, p, s)
    s.weights[:] = 0.0
    s.weights[AT_X] = ratio * (slope_x - t_y * t_y * p.stiffness[0] / (t_x * size))
    s.weights[AT_Y] = ratio * (slope_y + t_y * p.stiffness[1] / size)
    s.weights[RATIO] = 1.0


@kernel
def take_ratio_seen(innovation: float, noise: float, missed: float, held: float, p: Constants, s: State) -> bool:
    """Correct by the ratio that is seen in the lateral force, by the row `s.weights`; whether the tip seems to slip.

    The ratio is never more than that of the bound. A lower one means something only while the tip slips: while the copy
    slips, or where the tip went further than the copy by `missed`. Where friction is all that the drive leaves, up to
    `held`, rest is the likelier cause.
    """
    slips = s.V_X != 0.0 or s.V_Y != 0.0 or missed > 0.0
    if innovation < 0.0 and not slips:
        return False
    variance = weigh(noise, s)
    if missed == 0.0 and p.slots == 1:
        slow = hypot(s.V_X, s.V_Y) < _STOPS * math.sqrt(s.P[SPEED, SPEED])
        slow = slow and innovation < -_STOPS * math.sqrt(variance)
        unsure = hypot(p.force_noise, p.stiffness[0] * math.sqrt(s.P[AT_X, AT_X]))
        holds = abs(held) < _STOPS * unsure
        holds = holds and innovation < -max(SURE * math.sqrt(variance), _STOPS * _RINGS * p.hold)
        if slow or holds:
            s.V_X, s.V_Y = 0.0, 0.0
            rest(s)
            return False
    expected = innovation * innovation <= SURE * SURE * variance
    if not expected:
        s.P[RATIO, RATIO] += square(innovation) * p.identified
        variance = weigh(noise, s)
    correct(innovation, variance, s)
    return innovation * innovation <= SURE * SURE * variance and slips


@kernel
def copied_friction(b_x: float, b_y: float, p: Constants, s: State) -> float:
    """Friction along x of the copy, its bound by its own load, where the drive leaves this at rest."""
    f = bound_at(s.X, s.Y, s.Z, p, s)
    speed = hypot(s.V_X, s.V_Y)
    if speed > 0.0:
        return f * s.V_X / speed
    size = hypot(b_x, b_y)
    return b_x * min(f / size, 1.0) if size > 0.0 else 0.0


@kernel
def follow_force(force: float, u_x: float, u_y: float, rested: bool, p: Constants, s: State) -> None:
    """Move the copy by what its friction was off the measured one in a control period, as far as that is not noise.

    Friction as it is measured knows whether the tip slips, and of no surface. In a period in which the tip starts, it
    is what it is at the end.
    """
    b_x, b_y = balance(0, u_x, s.X, p, s), balance(1, u_y, s.Y, p, s)
    off = copied_friction(b_x, b_y, p, s) - force
    mean = off if rested else 0.5 * (off + s.off_force)
    s.off_force = off
    noise = hypot(p.force_noise, p.f_0 * _RINGS * p.hold)
    if s.V_X == 0.0 and s.V_Y == 0.0:
        noise = hypot(noise, p.stiffness[0] * math.sqrt(s.P[AT_X, AT_X]))
    mean -= min(max(mean, -_OFF * noise), _OFF * noise)
    if mean == 0.0 or abs(b_x) < _TELLS * hypot(b_x, b_y):
        return
    push_x, push_y = s.gain_of[0] * mean, s.gain_of[1] * mean * b_y / b_x
    s.X += p.Gamma_hold[0, 0] * push_x
    s.V_X += p.Gamma_hold[0, 1] * push_x
    s.Y += p.Gamma_hold[1, 0] * push_y
    s.V_Y += p.Gamma_hold[1, 1] * push_y
    if s.V_X * b_x + s.V_Y * b_y < 0.0:
        # Friction turns no motion round.
        s.V_X, s.V_Y = 0.0, 0.0


@kernel
def lean(u_x: float, u_y: float, p: Constants, s: State) -> tuple[float, float, float]:
    """Direction and size of what the drive leaves at rest where the copy is, which is looked at."""
    look(s.X, s.Y, p, s)
    b_x, b_y = balance(0, u_x, s.X, p, s), balance(1, u_y, s.Y, p, s)
    size = hypot(b_x, b_y)
    return (b_x / size, b_y / size, size) if size > 0.0 else (1.0, 0.0, 0.0)


@kernel
def follow_drives(k: int, y: Measurement, p: Constants, s: State) -> None:
    """Move the copy on through the drives that were in force until measurement k."""
    for ahead in range(min(max(k - s.last, 1), SLOTS)):
        for j in range(p.slots):
            u_x, u_y = drive_of_period(s.last + ahead, j, 0, y, p, s), drive_of_period(s.last + ahead, j, 1, y, p, s)
            u_z = drive_of_period(s.last + ahead, j, 2, y, p, s)
            if p.slots == 1 and s.last + ahead >= k - 1:
                # Whatever the delay is: the drive that was in force.
                u_x, u_y, u_z = drive_in_force(0, y, p, s), drive_in_force(1, y, p, s), drive_in_force(2, y, p, s)
            move(u_x, u_y, u_z, p.dt_copy, p.steps_copy, p, s)


@routine
def observe_scanner(k: int, x: float, y_: float, y: Measurement, p: Constants, s: State) -> None:
    """Run the copy up to measurement k, and correct it and the ratio by the positions x, y_ and the lateral force."""
    from_x, from_y, periods = s.X, s.Y, max(k - s.last, 1)
    rested = s.V_X == 0.0 and s.V_Y == 0.0
    force = y.lateral_force / p.lateral_force
    follow_drives(k, y, p, s)
    u_x, u_y = drive_in_force(0, y, p, s), drive_in_force(1, y, p, s)
    if p.slots == 1 and periods == 1:
        follow_force(force, u_x, u_y, rested, p, s)
    take_load(y, p, s)
    t_x, t_y, size = lean(u_x, u_y, p, s)
    P, ratio, nominal = s.P, s.here, nominal_bound(s.load, p, s)
    way = hypot(s.X - from_x, s.Y - from_y)
    slope = s.ratio[SLOPE_X] * t_x + s.ratio[SLOPE_Y] * t_y
    s.change[:] = 0.0
    q = p.wave_number * (abs(t_x) + abs(t_y))
    for i in range(5):
        if s.mapped > 0.0:
            P[SLOPE, i] = P[i, SLOPE] = 0.0
        elif i < SLOPE and t_x * s.ratio[WAY_X] + t_y * s.ratio[WAY_Y] < 0.0:
            # The slope is along the way: that turns back.
            P[SLOPE, i], P[i, SLOPE] = -P[SLOPE, i], -P[i, SLOPE]
    if s.mapped > 0.0:
        P[SLOPE, SLOPE] = square(_ON_MAP * bumps(p, s) * p.wave_number)
    rests = rests_for_certain(t_x, t_y, size, p, s)
    for _ in range(0 if rests and way == 0.0 else min(periods, ANSWERS)):
        carry(way / periods, t_x, t_y, nominal, p, s)
    P[RATIO, RATIO] += square(p.wander[s.unknown] * strength(s)) * periods
    if rests:
        rest(s)
    noise = square(p.position_noise)
    along = (x - s.X) * t_x + (y_ - s.Y) * t_y
    off = along * along / (along_variance(t_x, t_y, s) + noise)
    s.nis += NIS * (min(off, SURE * SURE) - s.nis)
    missed = along if off > SURE * SURE else 0.0
    if missed != 0.0:
        doubt(missed, t_x, t_y, p, s)
        if p.slots > 1:
            # Direction and bound of friction are those where the tip is, not those where the copy has gone.
            s.X, s.Y = x, y_
            t_x, t_y, size = lean(u_x, u_y, p, s)
            ratio, nominal = s.here, nominal_bound(s.load, p, s)
    s.grip, most, tells = 0.0, math.inf, abs(t_x) > _TELLS
    if size > 0.0 and tells:
        see_ratio(t_x, t_y, size, nominal, p, s)
        # Where the tip runs fast its load is not that at rest, and where it goes far its surface is another.
        went = hypot(x - from_x, y_ - from_y) / (periods * p.hold)
        swing = p.f_load * p.height * square(q * min(s.V_X * t_x + s.V_Y * t_y, went))
        seen, of_seen = force / (t_x * nominal), square(p.ratio_noise / t_x) + swing * swing
        if p.slots > 1:
            # What moves less than expected may rest: friction that was not seen is not believed in.
            most = max(ratio, seen)
        held = balance(0, u_x, s.X, p, s) - force
        if take_ratio_seen(seen - ratio, of_seen, missed, held, p, s):
            s.grip = max(seen, 0.0)
            s.slips += 1.0
    take(AT_X, x - s.X, noise, s)
    take(AT_Y, y_ - s.Y, noise, s)
    if s.started != 0.0:
        take_height_seen(y.position[2] / p.z0, p, s)
    s.across = along_variance(-t_y, t_x, s)
    s.X += s.change[AT_X]
    s.Y += s.change[AT_Y]
    speed = s.V_X * t_x + s.V_Y * t_y + s.change[SPEED]
    if speed <= 0.0:
        speed = 0.0
        rest(s)
    if speed <= REST * s.fastest:
        s.grip = 0.0
    s.V_X, s.V_Y = speed * t_x, speed * t_y
    s.ratio[VALUE] = min(ratio + s.change[RATIO], most)
    ripple = bumps(p, s)
    if s.slips > _OFTEN and not tells:
        # No force tells it, and what positions tell is also the speed: only slowly beyond what a surface explains.
        likely = min(max(s.ratio[VALUE], s.ratio[MEAN] - ripple), s.ratio[MEAN] + ripple)
        s.ratio[VALUE] = likely + _PART_UNSEEN * (s.ratio[VALUE] - likely)
    steepest = ripple * q
    slope = min(max(slope + s.change[SLOPE], -steepest), steepest)
    s.ratio[SLOPE_X], s.ratio[SLOPE_Y], s.ratio[WAY_X], s.ratio[WAY_Y] = slope * t_x, slope * t_y, t_x, t_y
    # The mean is that of the way gone, at most over a few waves; over a known surface nothing else is left.
    s.ratio[GONE] = min(s.ratio[GONE] + q * way, 8.0 * math.pi)
    part = min(q * way / s.ratio[GONE], 1.0) if s.ratio[GONE] > 0.0 else 0.0
    s.ratio[MEAN] += part * (s.ratio[VALUE] - s.ratio[MEAN])
    ripple = bumps(p, s)
    s.ratio[MEAN] = min(max(s.ratio[MEAN], s.ratio[VALUE] - ripple), s.ratio[VALUE] + ripple)
