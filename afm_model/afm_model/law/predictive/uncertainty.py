"""Covariance of what is estimated when nothing of friction is known: position, speed, ratio of friction, its slope."""

from typing import Any

from ...core.jit import kernel
from .constants import FLOOR
from .covariance import carry_covariance
from .estimate import ROUGH, bend_of

AT_X, AT_Y, SPEED, RATIO, SLOPE = range(5)
"""What is estimated: position, speed along the balance of forces, ratio of friction and its slope along the way."""


@kernel
def begin_together(p: Any, s: Any) -> None:
    """At rest, at the first measured position; friction may be anything."""
    for i in range(5):
        for j in range(5):
            s.uncertainty[i, j] = 0.0
    s.uncertainty[AT_X, AT_X] = s.uncertainty[AT_Y, AT_Y] = p.position_noise * p.position_noise
    s.uncertainty[RATIO, RATIO] = 1.0
    s.uncertainty[SLOPE, SLOPE] = (p.ripple * p.wave_number) ** 2


@kernel
def carry(way: float, t_x: float, t_y: float, nominal: float, p: Any, s: Any) -> None:
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
    across = (p.L[0, 0] * p.position_noise) ** 2 / (1.0 - p.L[0, 0])
    s.uncertainty[AT_X, AT_X] += across * t_y * t_y
    s.uncertainty[AT_Y, AT_Y] += across * t_x * t_x
    s.uncertainty[AT_X, AT_Y] -= across * t_x * t_y
    s.uncertainty[AT_Y, AT_X] -= across * t_x * t_y


@kernel
def weigh(s: Any) -> float:
    """Variance of the sum of what is estimated with the weights s.weights; its covariances go to s.gains."""
    variance = 0.0
    for i in range(5):
        s.gains[i] = 0.0
        for j in range(5):
            s.gains[i] += s.uncertainty[i, j] * s.weights[j]
    for i in range(5):
        variance += s.weights[i] * s.gains[i]
    return variance


@kernel
def update(innovation: float, variance: float, s: Any) -> None:
    """Kalman update by a measurement of the sum last weighed, of that variance, the noise included."""
    for i in range(5):
        s.change[i] += s.gains[i] * innovation / variance
        for j in range(5):
            s.uncertainty[i, j] -= s.gains[i] * s.gains[j] / variance


@kernel
def take(i: int, innovation: float, noise: float, s: Any) -> None:
    """Kalman update by a measurement of component i, which is off by `innovation` from what was predicted."""
    for j in range(5):
        s.weights[j] = 1.0 if j == i else 0.0
    variance = weigh(s) + noise * noise
    # What it still differs by after the measurements before.
    update(innovation - s.change[i], variance, s)


@kernel
def creep(way: float, t_x: float, t_y: float, s: Any) -> None:
    """It may have moved so far along t."""
    s.uncertainty[AT_X, AT_X] += way * way * t_x * t_x
    s.uncertainty[AT_X, AT_Y] += way * way * t_x * t_y
    s.uncertainty[AT_Y, AT_X] += way * way * t_x * t_y
    s.uncertainty[AT_Y, AT_Y] += way * way * t_y * t_y
