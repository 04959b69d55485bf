"""law.kind load: state feedback with a load that is estimated from positions alone; docs/laws.md (6.3).

For a scanner that friction hardly moves: hysteresis, creep and a wrong sensitivity act as one load that changes slowly.
"""

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Array, Vector
from ..core.elementary import square
from ..core.schema import NonNegative, Unit
from ..parts.part import Law, Numbers, Tree
from ..parts.signals import Measurement, PiezoDrive
from . import sampled
from .sampled import FeedbackLaw, SampledConstants, SampledState, lateral_axes, pole
from .scanner import feed_forward, follow_flight, place_poles, position, reference_at, send

_CHANGES = 0.1
"""Change of the load over that of the drive along the reference, by hysteresis."""
_WHILE = 100.0
"""Time in which the rate of the load may change by so much [1/w0]."""
_ACCELERATES = 0.5
"""Acceleration by a wrong resonance, over the change of the drive along the reference."""
_FASTEST = 1.3
"""Largest bandwidth of the estimated load: over the resonance, and times the time until a drive takes effect. A faster
loop does not tolerate a sensitivity or a resonance that is some ten percent wrong."""

_LITTLE = 1e-11
"""Displacement [m] of the scanner by friction up to which the load changes slowly."""


class LoadLaw(FeedbackLaw):
    """Estimates position, rate and load of each axis by a Kalman filter, and cancels the load as it goes on."""

    kind: str = Field("load", description="control law")
    position_noise: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="rms noise of a position sensor; 0: the load is estimated as fast as the loop tolerates"
    )


class Constants(SampledConstants):
    k_1: Vector
    k_2: Vector
    step: Annotated[Array, (2, 4, 4)]  # position, rate, load and its rate over one period, without a drive
    of_drive: Annotated[Array, (2, 2)]  # position and rate made by a unit of U in one period
    walk: Annotated[Array, (2, 4)]  # variance that a period adds, over the squared speed of the reference
    first: Annotated[Array, (2, 4)]  # variance at the first measurement, in the same way
    least_noise: Annotated[Array, (2,)]  # variance of a position that limits the bandwidth, in the same way
    noise: Annotated[float, "x0"]


class State(SampledState):
    started: float
    fastest: float  # speed of the reference so far [x0 w0]
    estimate: Annotated[Array, (2, 4)]  # position, rate, load and its rate [U]
    covariance: Annotated[Array, (2, 4, 4)]  # their covariance, over the squared speed of the reference
    carried: Annotated[Array, (4, 4)]  # workspace
    moved: Annotated[Array, (4,)]  # workspace


def _values(parameters: Tree) -> Numbers:
    axes, poles = lateral_axes(parameters), []
    step, walk, first, least = np.zeros((2, 4, 4)), np.zeros((2, 4)), np.zeros((2, 4)), np.zeros(2)
    for i, axis in enumerate(axes):
        poles.append(place_poles(axis, pole(parameters, axis), pole(parameters, axis)))
        hold, spring = axis.hold, square(axis.eta)
        step[i, :2, :2], step[i, :2, 2], step[i, :2, 3] = axis.phi, -axis.gamma, -0.5 * hold * axis.gamma
        step[i, 2] = 0.0, 0.0, 1.0, hold
        step[i, 3, 3] = 1.0
        rate = _CHANGES * spring
        walk[i] = 0.0, square(_ACCELERATES * spring) * hold, 0.0, square(rate) * hold / _WHILE
        first[i] = 0.0, 1.0, square(_WHILE * rate), square(rate)
        bandwidth = _FASTEST * min(axis.eta, 1.0 / (hold * (parameters.law.delay_ticks + 0.5)))
        # With this noise a filter of the load alone has that bandwidth.
        least[i] = square(rate / (math.sqrt(_WHILE * hold) * square(square(bandwidth))))
    return {
        **sampled.sampled_values(parameters),
        "k_1": [*(k for k, _ in poles), 0.0],
        "k_2": [*(k for _, k in poles), 0.0],
        "step": step,
        "of_drive": np.stack([axis.gamma for axis in axes]),
        "walk": walk,
        "first": first,
        "least_noise": least,
        "noise": parameters.law.position_noise / parameters.scales.x0,
    }


@kernel
def carry(axis: int, drive: float, p: Constants, s: State) -> None:
    """Carry estimate and covariance of an axis through one control period under a drive [U]."""
    F, x, P = p.step[axis], s.estimate[axis], s.covariance[axis]
    for i in range(4):
        s.moved[i] = p.of_drive[axis, i] * drive if i < 2 else 0.0
        for j in range(4):
            s.moved[i] += F[i, j] * x[j]
            s.carried[i, j] = 0.0
            for k in range(4):
                s.carried[i, j] += F[i, k] * P[k, j]
    for i in range(4):
        x[i] = s.moved[i]
        for j in range(4):
            P[i, j] = p.walk[axis, i] if i == j else 0.0
            for k in range(4):
                P[i, j] += s.carried[i, k] * F[j, k]


@kernel
def correct(axis: int, measured: float, speed: float, p: Constants, s: State) -> None:
    """Correct estimate and covariance of an axis by its measured position."""
    x, P = s.estimate[axis], s.covariance[axis]
    missed, variance = measured - x[0], P[0, 0] + square(p.noise / speed) + p.least_noise[axis]
    for i in range(4):
        s.moved[i] = P[i, 0] / variance
        x[i] += s.moved[i] * missed
    for i in range(4):
        for j in range(4):
            P[i, j] -= s.moved[i] * s.moved[j] * variance


@kernel
def begin(axis: int, measured: float, p: Constants, s: State) -> None:
    """Begin with a scanner that rests at the measured position under an unknown load."""
    for i in range(4):
        s.estimate[axis, i] = 0.0
        for j in range(4):
            s.covariance[axis, i, j] = p.first[axis, i] if i == j else 0.0
    s.estimate[axis, 0] = measured


@kernel
def control(t: float, y: Measurement, u: PiezoDrive, p: Constants, s: State) -> None:
    """See `afm_model.parts.Law`."""
    follow_flight(y, p, s)
    sampled.control_height(y, u, p, s)
    v_x, v_y = reference_at(y, p, 0, 0.0)[1], reference_at(y, p, 1, 0.0)[1]
    s.fastest = max(s.fastest, math.sqrt(v_x * v_x + v_y * v_y))
    speed = max(s.fastest, p.noise / _WHILE)
    for axis in range(2):
        measured, x = position(y, p, axis), s.estimate[axis]
        if s.started == 0.0:
            begin(axis, measured, p, s)
        else:
            carry(axis, y.drive[axis] / p.volts[axis], p, s)
        if speed > 0.0:
            correct(axis, measured, speed, p, s)
        # The load is a ramp: its mean until this drive comes into force, and while the drive is.
        meanwhile, then = x[2] + 0.5 * p.ahead * x[3], x[2] + (p.ahead + 0.5 * p.hold) * x[3]
        one = p.ahead_11[axis] * x[0] + p.ahead_12[axis] * x[1] + s.flight_1[axis] - p.flown_1[axis] * meanwhile
        two = p.ahead_21[axis] * x[0] + p.ahead_22[axis] * x[1] + s.flight_2[axis] - p.flown_2[axis] * meanwhile
        r, v = reference_at(y, p, axis, p.ahead)
        wanted = feed_forward(y, p, axis) + then
        send(u, p, s, axis, wanted - p.k_1[axis] * (one - r) - p.k_2[axis] * (two - v))
    s.started = 1.0


def _warnings(parameters: Tree, control_period: float) -> list[str]:
    """Say that friction moves the scanner, if it does."""
    scanner, friction = parameters.scanner, parameters.contact.friction_at_pull_off
    softest = scanner.mass_ratio * parameters.cantilever.m_c * square(2.0 * math.pi * min(scanner.f_x, scanner.f_y))
    if friction < _LITTLE * softest:
        return []
    return [
        f"friction of {1e9 * friction:.3g} nN moves the scanner by {1e9 * friction / softest:.3g} nm, and "
        f"law.kind = load should be used below {1e9 * _LITTLE:g} nm: take observer or predictive (docs/laws.md)"
    ]


LOAD = Law(
    name="load",
    parameters=LoadLaw,
    constants=Constants,
    state=State,
    values=_values,
    control=control,
    warnings=_warnings,
    knowledge="positions of the scanner, their noise, deflection; scanner, cantilever",
)
