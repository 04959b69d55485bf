"""Where the scanner is and how strong friction is, in one filter, from positions and the lateral force.

At the low speed of a reference friction turns the motion at once into the balance of forces b, drive less spring: the
scanner slips along b, and at rest friction is b. So position, speed along b and the ratio of friction follow one linear
model, and one Kalman filter estimates them: the lateral force tells friction while the tip slips and the position while
it rests. Which of the two it does is decided by which explains force and speed better: docs/laws.md, (8.11).
"""

import math

from ...core.elementary import hypot, log, square
from ...core.jit import kernel
from ...parts.signals import Measurement
from .kalman import carry_covariance, correct, weigh
from .nominal_plant import balance, look, nominal_bound, run_copy
from .predictive_constants import FLOOR, Constants
from .predictive_state import State
from .sample_estimate import GONE, MEAN, ROUGH, SLOPE_X, SLOPE_Y, VALUE, WAY_X, WAY_Y, bend_of

AT_X, AT_Y, SPEED, RATIO, SLOPE = range(5)
"""What is estimated: position, speed along the balance of forces, ratio of friction and its slope along the way."""


@kernel
def begin_together(p: Constants, s: State) -> None:
    """At rest, at the first measured position; friction may be anything."""
    for i in range(5):
        for j in range(5):
            s.uncertainty[i, j] = 0.0
    s.uncertainty[AT_X, AT_X] = s.uncertainty[AT_Y, AT_Y] = p.position_noise * p.position_noise
    s.uncertainty[RATIO, RATIO] = 1.0
    s.uncertainty[SLOPE, SLOPE] = square(p.ripple * p.wave_number)


@kernel
def carry(way: float, t_x: float, t_y: float, nominal: float, p: Constants, s: State) -> None:
    """Carry the covariance through a control period in which the scanner goes so far along t."""
    F = s.carried
    a, b, c, d = p.free[0, 0], p.free[0, 1], p.free[1, 0], p.free[1, 1]
    e, f = -p.of_drive[0] * nominal, -p.of_drive[1] * nominal
    for i in range(5):
        for j in range(5):
            F[i, j] = 1.0 if i == j else 0.0
    F[AT_X, AT_X], F[AT_X, AT_Y] = a * t_x * t_x + t_y * t_y, (a - 1.0) * t_x * t_y
    F[AT_Y, AT_X], F[AT_Y, AT_Y] = (a - 1.0) * t_x * t_y, a * t_y * t_y + t_x * t_x
    F[AT_X, SPEED], F[AT_X, RATIO], F[AT_X, SLOPE] = t_x * b, t_x * e, t_x * e * 0.5 * way
    F[AT_Y, SPEED], F[AT_Y, RATIO], F[AT_Y, SLOPE] = t_y * b, t_y * e, t_y * e * 0.5 * way
    F[SPEED, AT_X], F[SPEED, AT_Y], F[SPEED, SPEED] = c * t_x, c * t_y, d
    F[SPEED, RATIO], F[SPEED, SLOPE] = f, f * 0.5 * way
    F[RATIO, SLOPE] = way
    carry_covariance(s.uncertainty, F, s.half)
    # What counts is the largest error: the largest second derivative of a wave, not its rms one.
    bend = bend_of(way, t_x, t_y, p.ripple / ROUGH, p)
    s.uncertainty[RATIO, RATIO] += 0.25 * bend * bend * way * way
    s.uncertainty[RATIO, SLOPE] += 0.5 * bend * bend * way
    s.uncertainty[SLOPE, RATIO] += 0.5 * bend * bend * way
    s.uncertainty[SLOPE, SLOPE] += bend * bend
    # Its load is not quite static.
    s.uncertainty[RATIO, RATIO] += FLOOR * FLOOR * p.hold
    # Nothing moves it across but what turns b.
    across = square(p.L[0, 0] * p.position_noise) / (1.0 - p.L[0, 0])
    s.uncertainty[AT_X, AT_X] += across * t_y * t_y
    s.uncertainty[AT_Y, AT_Y] += across * t_x * t_x
    s.uncertainty[AT_X, AT_Y] -= across * t_x * t_y
    s.uncertainty[AT_Y, AT_X] -= across * t_x * t_y


@kernel
def take(i: int, innovation: float, noise: float, s: State) -> None:
    """Kalman update by a measurement of component i, which is off by `innovation` from what was predicted."""
    for j in range(5):
        s.weights[j] = 1.0 if j == i else 0.0
    variance = weigh(s.uncertainty, s.weights, s.gains) + noise * noise
    # What it still differs by after the measurements before.
    correct(s.uncertainty, s.change, s.gains, innovation - s.change[i], variance)


@kernel
def creep(way: float, t_x: float, t_y: float, s: State) -> None:
    """It may have moved so far along t."""
    s.uncertainty[AT_X, AT_X] += way * way * t_x * t_x
    s.uncertainty[AT_X, AT_Y] += way * way * t_x * t_y
    s.uncertainty[AT_Y, AT_X] += way * way * t_x * t_y
    s.uncertainty[AT_Y, AT_Y] += way * way * t_y * t_y


_SURE = 3.0
"""Standard deviations beyond which a difference is not noise."""
_TELLS = 0.3
"""Smallest cosine between the motion and x at which the force along x tells friction."""
_INDEX = 10.0
"""Largest change of friction in a period over the noise: a surface sampled coarsely is not trusted beyond it."""


@kernel
def unlikely(value: float, variance: float) -> float:
    """Square of a negative value over its variance; of a positive one zero."""
    return value * value / variance if value < 0.0 and variance > 0.0 else 0.0


@kernel
def slips(
    force: float,
    b_x: float,
    t_x: float,
    t_y: float,
    nominal: float,
    speed: float,
    before: float,
    p: Constants,
    s: State,
) -> tuple[bool, float, float]:
    """Whether the tip slips at the measurement; how far the force is from what it is then, and that one's variance.

    The weights of the force are ready for `correct`.
    """
    # At rest the force is b_x.
    resting = force - b_x + p.stiffness[0] * s.change[AT_X]
    of_resting = square(p.stiffness[0]) * s.uncertainty[AT_X, AT_X] + square(p.force_noise)
    if before == 0.0:
        resting = force - b_x - p.stiffness[0] * (s.X - s.at_x)
        of_resting = square(p.stiffness[0]) * s.held[AT_X, AT_X] + square(p.force_noise)
    # Slipping it is the bound, along b, whose direction depends on the position.
    s.weights[AT_X], s.weights[AT_Y] = -p.stiffness[0] * t_y * t_y, p.stiffness[1] * t_x * t_y
    s.weights[SPEED], s.weights[RATIO], s.weights[SLOPE] = 0.0, t_x * nominal, 0.0
    slipping = force - t_x * nominal * s.here
    for i in range(5):
        slipping -= s.weights[i] * s.change[i]
    step_x, step_y = s.X - s.at_x, s.Y - s.at_y
    way = math.sqrt(step_x * step_x + step_y * step_y)
    noise = max(p.force_noise, min(bend_of(way, t_x, t_y, p.ripple, p) * way / _INDEX, p.ripple) * nominal)
    of_slipping = weigh(s.uncertainty, s.weights, s.gains) + noise * noise
    v, of_v = speed + s.change[SPEED], s.uncertainty[SPEED, SPEED]
    gain = s.gains[SPEED] / of_slipping
    # It does not slip backwards; it rests only where friction has stopped it, and friction is then below its bound.
    against = slipping * slipping / of_slipping + unlikely(v + gain * slipping, of_v - gain * s.gains[SPEED])
    for_it = resting * resting / of_resting + unlikely(-v, of_v)
    for_it += unlikely(-slipping if t_x > 0.0 else slipping, of_slipping)
    sure = s.slips > 0.0 or resting * resting > _SURE * _SURE * of_resting
    return sure and against + log(of_slipping / of_resting) <= for_it, slipping, of_slipping


@kernel
def rest(
    x: float, y_: float, force: float, u_x: float, t_x: float, t_y: float, speed: float, before: float, time: float,
    p: Constants, s: State,
) -> None:  # fmt: skip
    """Correct what is estimated by a measurement at which the tip rests."""
    slow = _SURE * p.force_noise * time
    if before == 0.0:
        # It has rested all the time: nothing has changed.
        for i in range(5):
            s.change[i] = 0.0
            for j in range(5):
                s.uncertainty[i, j] = s.held[i, j]
        creep(slow * time, t_x, t_y, s)
        s.X, s.Y = s.at_x, s.at_y
        take(AT_X, x - s.X, p.position_noise, s)
        take(AT_Y, y_ - s.Y, p.position_noise, s)
        speed = 0.0
    take(SPEED, -max(speed, 0.0), slow, s)
    b_at_rest = s.gain_of[0] * (balance(0, u_x, s.X, p, s) - force) / p.stiffness[0]
    # The force differs from b_x by the acceleration of such a speed.
    take(AT_X, b_at_rest, hypot(p.force_noise, slow / time) / p.stiffness[0], s)
    # Where it has crept to friction may be another.
    crept_x, crept_y = s.X + s.change[AT_X] - s.at_x, s.Y + s.change[AT_Y] - s.at_y
    if s.uncertainty[RATIO, RATIO] < p.ripple * p.ripple:
        s.uncertainty[RATIO, RATIO] += square(p.ripple * p.wave_number * (abs(crept_x) + abs(crept_y)))


@kernel
def correct_together(k: int, x: float, y_: float, y: Measurement, p: Constants, s: State) -> None:
    """Run the copy up to measurement k, and correct it and friction by the positions x, y_ and the lateral force."""
    periods = max(k - s.last, 1)
    time = periods * p.hold
    before = math.sqrt(s.V_X * s.V_X + s.V_Y * s.V_Y)
    run_copy(k, y, p, s)
    u_x = y.drive[0] / p.volts[0]
    b_x, b_y = balance(0, u_x, s.X, p, s), balance(1, y.drive[1] / p.volts[1], s.Y, p, s)
    size = math.sqrt(b_x * b_x + b_y * b_y)
    t_x, t_y = (b_x / size, b_y / size) if size > 0.0 else (1.0, 0.0)
    look(s.X, s.Y, p, s)
    ratio = s.here
    nominal = nominal_bound(p.w + p.eta_c2 * y.deflection / p.z0, p, s)
    step_x, step_y = s.X - s.at_x, s.Y - s.at_y
    way = math.sqrt(step_x * step_x + step_y * step_y)
    # The slope is along the way: that turns back.
    slope = s.ratio[SLOPE_X] * t_x + s.ratio[SLOPE_Y] * t_y
    if t_x * s.ratio[WAY_X] + t_y * s.ratio[WAY_Y] < 0.0:
        for i in range(4):
            s.uncertainty[i, SLOPE] = -s.uncertainty[i, SLOPE]
            s.uncertainty[SLOPE, i] = -s.uncertainty[SLOPE, i]
    for i in range(5):
        s.change[i] = 0.0
        for j in range(5):
            s.held[i, j] = s.uncertainty[i, j]
    for _ in range(periods):
        carry(way / periods, t_x, t_y, nominal, p, s)
    speed = s.V_X * t_x + s.V_Y * t_y
    if speed <= 0.0:
        # The copy has stopped: how far below zero its speed would be.
        speed = min(before + time * (size - ratio * nominal), 0.0)
    take(AT_X, x - s.X, p.position_noise, s)
    take(AT_Y, y_ - s.Y, p.position_noise, s)
    force = y.lateral_force / p.lateral_force
    slipping, differs, variance = slips(force, b_x, t_x, t_y, nominal, speed, before, p, s)
    along_t = force if t_x > 0.0 else -force
    s.grip = 0.0
    if slipping:
        correct(s.uncertainty, s.change, s.gains, differs, variance)
        speed = max(speed + s.change[SPEED], 0.0)
        if abs(t_x) > _TELLS:
            s.grip = max(force / t_x, 0.0)
    else:
        rest(x, y_, force, u_x, t_x, t_y, speed, before, time, p, s)
        speed = 0.0
        # Friction is never more than its bound, but for noise. Before the first slip that is sought in steps.
        least = along_t / max(abs(t_x), _TELLS) / nominal
        least += 0.5 * p.ripple if s.slips == 0.0 else 0.0
        least -= _SURE * p.ratio_noise
        s.change[RATIO] = max(s.change[RATIO], least - ratio)
        s.ratio[MEAN] = max(s.ratio[MEAN], least)
    s.across = s.uncertainty[AT_X, AT_X] * t_y * t_y + s.uncertainty[AT_Y, AT_Y] * t_x * t_x
    s.across -= 2.0 * s.uncertainty[AT_X, AT_Y] * t_x * t_y
    s.X += s.change[AT_X]
    s.Y += s.change[AT_Y]
    s.V_X, s.V_Y = speed * t_x, speed * t_y
    q = p.wave_number * (abs(t_x) + abs(t_y))
    slope = min(max(slope + s.change[SLOPE], -p.ripple * q), p.ripple * q)
    s.ratio[VALUE] = ratio + s.change[RATIO]
    s.ratio[SLOPE_X], s.ratio[SLOPE_Y], s.ratio[WAY_X], s.ratio[WAY_Y] = slope * t_x, slope * t_y, t_x, t_y
    if s.grip > 0.0 and way > 0.0:
        s.ratio[GONE] = min(s.ratio[GONE] + q * way, 8.0 * math.pi)
        s.ratio[MEAN] += min(q * way / s.ratio[GONE], 1.0) * (s.ratio[VALUE] - s.ratio[MEAN])
