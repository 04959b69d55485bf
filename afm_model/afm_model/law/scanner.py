"""The free scanner as a sampled law knows it: exact steps under a held drive, drives in flight, reference ahead.

Each axis is x'' = U - eta^2 x - 2 xi eta x' - a in the units of the paper (1/w0, x0 or z0); the load a is friction
along x and y, and N / mu along z. docs/laws.md (1.1) to (1.3).
"""

import math
from collections import defaultdict
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import kernel
from ..compiled.records import Record, Vector
from ..core.elementary import exp, expm1, sin, sincos, square
from ..parts.part import Tree
from ..parts.signals import Measurement, PiezoDrive

_Array = NDArray[np.float64]


class ScannerConstants(Record):
    """The free scanner over one control period T, w0 and the delay; vectors are of x, y and z."""

    hold: Annotated[float, "1/w0"]  # T
    ahead: Annotated[float, "1/w0"]  # the delay
    w0: Annotated[float, "rad/s"]
    delayed: float  # 1.0 if there is a delay
    length: Annotated[Vector, "m"]  # x0, x0, z0
    volts: Annotated[Vector, "V"]  # drive per unit of U
    limit: Vector  # largest |U|; infinite without piezo.limit
    phi_11: Vector  # exact step over one period: phi e + gamma U
    phi_12: Vector
    phi_21: Vector
    phi_22: Vector
    gamma_1: Vector
    gamma_2: Vector
    weight_1: Vector  # gamma / |gamma|^2: the drive that comes closest to a wanted change
    weight_2: Vector
    ahead_11: Vector  # phi to the power delay_ticks
    ahead_12: Vector
    ahead_21: Vector
    ahead_22: Vector
    due_1: Vector  # ahead gamma: what the drive that comes into force has stood for among those in flight
    due_2: Vector
    flown_1: Vector  # what a unit of U held over all the delay makes
    flown_2: Vector


class ScannerState(Record):
    """The drive answered last [U], and what the drives in flight will have made of a scanner at rest."""

    follows: float  # 1.0 once there was a measurement
    last: Vector
    flight_1: Vector
    flight_2: Vector


class HeldAxis(NamedTuple):
    """One free axis over a time of held drive, nondimensional."""

    eta: float  # resonance [w0]
    xi: float  # damping ratio
    hold: float  # time of held drive [1/w0]
    phi: _Array  # (2, 2)
    gamma: _Array  # (2,)


def free_axis(eta: float, xi: float, hold: float) -> HeldAxis:
    """Exact step of a free axis, xi < 1, over a time `hold` [1/w0] of held drive."""
    decay, w = xi * eta, eta * math.sqrt(1.0 - xi * xi)
    s, c = sincos(w * hold)
    left = exp(-decay * hold)
    moved = left * s / w
    phi = np.array([[left * c + decay * moved, moved], [-eta * eta * moved, left * c - decay * moved]])
    # 1 - phi_11 without loss of digits at a short hold.
    lost = 2.0 * left * square(sin(0.5 * w * hold)) - expm1(-decay * hold) - decay * moved
    return HeldAxis(eta, xi, hold, phi, np.array([lost / (eta * eta), moved]))


def times(a: _Array, b: _Array) -> _Array:
    """Product of a matrix (2, 2) with another or a vector, always in this order of sums."""
    return np.stack([row[0] * b[0] + row[1] * b[1] for row in a])


def free_axes(parameters: Tree, periods: int = 1) -> list[HeldAxis]:
    """x, y, z of the scanner over `periods` control periods of the law."""
    scanner, w0 = parameters.scanner, parameters.scales.w0
    hold = w0 * parameters.law.period * periods
    return [
        free_axis(2.0 * math.pi * f / w0, xi, hold)
        for f, xi in zip(scanner.frequencies, scanner.damping_ratios, strict=True)
    ]


def place_poles(axis: HeldAxis, one: float, other: float) -> tuple[float, float]:
    """K for which phi - gamma K has the eigenvalues `one` and `other`: Ackermann's formula."""
    (g_1, g_2), (h_1, h_2) = axis.gamma, times(axis.phi, axis.gamma)
    wanted = times(axis.phi - one * np.eye(2), axis.phi - other * np.eye(2))
    K = (g_1 * wanted[1] - g_2 * wanted[0]) / (g_1 * h_2 - h_1 * g_2)
    return float(K[0]), float(K[1])


def scanner_values(parameters: Tree) -> dict[str, Any]:
    """Values of ScannerConstants for a law that is made for a period and a delay."""
    law, scales, piezo = parameters.law, parameters.scales, parameters.piezo
    columns: dict[str, list[float]] = defaultdict(list)
    lengths = (scales.x0, scales.x0, scales.z0)
    for axis, metres, length in zip(free_axes(parameters), piezo.sensitivities, lengths, strict=True):
        volts = length / (square(axis.eta) * metres)
        columns["length"].append(length)
        columns["volts"].append(volts)
        columns["limit"].append(piezo.limit / volts if piezo.limit > 0.0 else math.inf)
        ahead = np.eye(2)
        for _ in range(law.delay_ticks):
            ahead = times(axis.phi, ahead)
        matrices = {
            "phi": axis.phi,
            "gamma": axis.gamma,
            "weight": axis.gamma / (square(axis.gamma[0]) + square(axis.gamma[1])),
            "ahead": ahead,
            "due": times(ahead, axis.gamma),
            # The static response is 1 / eta^2.
            "flown": (np.eye(2) - ahead)[:, 0] / square(axis.eta),
        }
        for of, matrix in matrices.items():
            for index, number in np.ndenumerate(matrix):
                columns[f"{of}_{''.join(str(i + 1) for i in index)}"].append(float(number))
    hold = scales.w0 * law.period
    timing = {"hold": hold, "ahead": hold * law.delay_ticks, "w0": scales.w0, "delayed": float(law.delay_ticks > 0)}
    return timing | columns


@kernel
def follow_flight(y: Measurement, p: ScannerConstants, s: ScannerState) -> None:
    """Bring the effect of the drives in flight up to this measurement: one has been sent, one has come into force.

    At the start the scanner rests under the drive that holds it until the first answer is there.
    """
    if p.delayed == 0.0:
        return
    for axis in range(3):
        applied = y.drive[axis] / p.volts[axis]
        if s.follows == 0.0:
            s.flight_1[axis] = p.flown_1[axis] * applied
            s.flight_2[axis] = p.flown_2[axis] * applied
        else:
            one, two = s.flight_1[axis], s.flight_2[axis]
            s.flight_1[axis] = p.phi_11[axis] * one + p.phi_12[axis] * two
            s.flight_2[axis] = p.phi_21[axis] * one + p.phi_22[axis] * two
            s.flight_1[axis] += p.gamma_1[axis] * s.last[axis] - p.due_1[axis] * applied
            s.flight_2[axis] += p.gamma_2[axis] * s.last[axis] - p.due_2[axis] * applied


@kernel
def send(u: PiezoDrive, p: ScannerConstants, s: ScannerState, axis: int, wanted: float) -> float:
    """Write the drive for `wanted` [U] of one axis, within the range of the piezo; returns what was sent [U]."""
    sent = min(max(wanted, -p.limit[axis]), p.limit[axis])
    s.last[axis] = sent
    u.voltage[axis] = p.volts[axis] * sent
    return sent


@kernel
def position(y: Measurement, p: ScannerConstants, axis: int) -> float:
    """Measured position of the scanner [x0, z0]."""
    return y.position[axis] / p.length[axis]


@kernel
def rate(y: Measurement, p: ScannerConstants, axis: int) -> float:
    """Measured velocity of the scanner [x0 w0, z0 w0]."""
    return y.velocity[axis] / (p.length[axis] * p.w0)


@kernel
def predict(y: Measurement, p: ScannerConstants, s: ScannerState, axis: int, load: float) -> tuple[float, float]:
    """Position and velocity when the drive answered now comes into force, under a constant `load` until then."""
    x, v = position(y, p, axis), rate(y, p, axis)
    if p.delayed == 0.0:
        return x, v
    one = p.ahead_11[axis] * x + p.ahead_12[axis] * v + s.flight_1[axis] - p.flown_1[axis] * load
    two = p.ahead_21[axis] * x + p.ahead_22[axis] * v + s.flight_2[axis] - p.flown_2[axis] * load
    return one, two


@kernel
def reference_at(y: Measurement, p: ScannerConstants, axis: int, after: float) -> tuple[float, float]:
    """Reference `after` [1/w0] from now, by its position, velocity and acceleration now."""
    speed = p.length[axis] * p.w0
    r, v = y.reference_position[axis] / p.length[axis], y.reference_velocity[axis] / speed
    a = y.reference_acceleration[axis] / (speed * p.w0)
    return r + after * (v + 0.5 * after * a), v + after * a


@kernel
def drive_between(p: ScannerConstants, axis: int, r: float, v: float, next_r: float, next_v: float) -> float:
    """Drive [U] that takes the free scanner from (r, v) closest to (next_r, next_v) in one period: least squares."""
    miss_1 = next_r - p.phi_11[axis] * r - p.phi_12[axis] * v
    miss_2 = next_v - p.phi_21[axis] * r - p.phi_22[axis] * v
    return p.weight_1[axis] * miss_1 + p.weight_2[axis] * miss_2


@kernel
def feed_forward(y: Measurement, p: ScannerConstants, axis: int) -> float:
    """Drive [U] along the reference while the drive answered now is in force: the free scanner inverted."""
    r, v = reference_at(y, p, axis, p.ahead)
    next_r, next_v = reference_at(y, p, axis, p.ahead + p.hold)
    return drive_between(p, axis, r, v, next_r, next_v)


@kernel
def error_ahead(y: Measurement, p: ScannerConstants, s: ScannerState, axis: int, load: float) -> tuple[float, float]:
    """Tracking error and its rate when the drive answered now comes into force, under a constant `load` until then."""
    x, v = predict(y, p, s, axis, load)
    r, r_rate = reference_at(y, p, axis, p.ahead)
    return x - r, v - r_rate
