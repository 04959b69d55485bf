"""law.kind super_twisting: the super-twisting algorithm, discretised implicitly; docs/laws.md (5.1), (5.2).

Gains: Levant, DOI 10.1080/0020717031000099029, and Moreno, Osorio, DOI 10.1109/TAC.2012.2186179. Discrete form:
Koch, Reichhartinger, DOI 10.1016/j.automatica.2019.05.040.
"""

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Vector
from ..core.elementary import hypot
from ..core.schema import NonNegative, Positive, Unit
from ..parts.part import Law, Numbers, Tree
from ..parts.signals import Measurement, PiezoDrive
from . import sampled
from .implicit import lateral_unit
from .sampled import FeedbackLaw, SampledConstants, SampledState, lateral_axes, pole
from .scanner import HeldAxis, feed_forward, follow_flight, place_poles, position, rate, reference_at, send

K_1, K_2 = 1.5, 1.1
"""Levant's gains: K_1 sqrt(L) and K_2 L for a disturbance whose rate is bounded by L."""
_REAL, _IMAGINARY = 0.5 * K_1, math.sqrt(K_2 - 0.25 * K_1 * K_1)
"""Roots of p^2 + K_1 p + K_2 = 0 are -_REAL +- i _IMAGINARY."""
_SMALLEST = 1e-12
"""Below this the sliding variable [x0 w0] counts as zero."""


class SuperTwistingLaw(FeedbackLaw):
    """Continuous switching with an integral of the sign: friction need not be known, only how fast it changes."""

    kind: str = Field("super_twisting", description="control law")
    friction_bound: Annotated[Positive, Unit("N")] = Field(
        225e-9, description="bound on friction: the integral goes no farther (the paper's M = 15)"
    )
    friction_rate: Annotated[NonNegative, Unit("N/s")] = Field(
        0.0,
        description="bound on the rate of friction; 0: law.friction_bound / ((1 + law.delay_ticks) law.period), "
        "the largest that samples at this rate distinguish from a jump",
    )


class Constants(SampledConstants):
    k_1: Vector
    k_2: Vector
    c_1: Vector
    c_2: Vector
    bound: float
    root_L: float
    fastest: float


class State(SampledState):
    twist_x: float
    twist_y: float


def sliding_row(axis: HeldAxis, K: tuple[float, float]) -> tuple[float, float]:
    """C of the sliding variable s = C e that K takes to zero in one step, scaled so that C gamma is the period.

    C is the left eigenvector of phi - gamma K for the eigenvalue 0.
    """
    closed = axis.phi - np.outer(axis.gamma, K)
    # Both columns are multiples of one vector, and C is normal to it: the longer one has more digits.
    longest = closed[:, int(np.argmax(np.abs(closed).max(axis=0)))]
    C = np.array([-longest[1], longest[0]])
    C *= axis.hold / (C[0] * axis.gamma[0] + C[1] * axis.gamma[1])
    return float(C[0]), float(C[1])


def _values(parameters: Tree) -> Numbers:
    law, unit = parameters.law, lateral_unit(parameters)
    axes = lateral_axes(parameters)
    K = [place_poles(axis, 0.0, pole(parameters, axis)) for axis in axes]
    C = [sliding_row(axis, k) for axis, k in zip(axes, K, strict=True)]
    hold = axes[0].hold
    L = law.friction_rate / (unit * parameters.scales.w0)
    if L == 0.0:
        L = law.friction_bound / unit / (hold * (1 + law.delay_ticks))
    rows = {"k_1": [k for k, _ in K], "k_2": [k for _, k in K], "c_1": [c for c, _ in C], "c_2": [c for _, c in C]}
    return {
        **sampled.sampled_values(parameters),
        **{name: [*values, 0.0] for name, values in rows.items()},
        "bound": law.friction_bound / unit,
        "root_L": math.sqrt(L),
        # An integrator with a delay bears a closed loop no faster than this: SIMC, tau_c = theta, in units of the hold.
        "fastest": 1.0 / (4.0 * law.delay_ticks) if law.delay_ticks > 0 else math.inf,
    }


@kernel
def sliding(y: Measurement, p: Constants, axis: int) -> tuple[float, float]:
    """Sliding variable of one axis, and the drive without what makes it slide."""
    r, r_rate = reference_at(y, p, axis, 0.0)
    e, e_rate = position(y, p, axis) - r, rate(y, p, axis) - r_rate
    s = p.c_1[axis] * e + p.c_2[axis] * e_rate
    # K e takes s to zero in one step: without its part s / hold, s stays as it is.
    return s, feed_forward(y, p, axis) - p.k_1[axis] * e - p.k_2[axis] * e_rate + s / p.hold


@kernel
def control(t: float, y: Measurement, u: PiezoDrive, p: Constants, s: State) -> None:
    """See `afm_model.parts.Law`."""
    follow_flight(y, p, s)
    sampled.control_height(y, u, p, s)
    s_x, u_x = sliding(y, p, 0)
    s_y, u_y = sliding(y, p, 1)
    # The continuous law is linear with the eigenvalues sqrt(L / |s|) (-_REAL +- i _IMAGINARY); implicitly, a pole p of
    # continuous time becomes 1 / (1 - hold p).
    size = hypot(s_x, s_y)
    m = min(p.hold * p.root_L / math.sqrt(max(size, _SMALLEST)), p.fastest)
    real, imaginary = 1.0 + _REAL * m, _IMAGINARY * m
    square = real * real + imaginary * imaginary
    both, product = 2.0 * real / square, 1.0 / square
    proportional = (both - 2.0) / p.hold
    integral = (both - 1.0 - product) / p.hold
    send(u, p, s, 0, u_x + proportional * s_x + s.twist_x)
    send(u, p, s, 1, u_y + proportional * s_y + s.twist_y)
    s.twist_x += integral * s_x
    s.twist_y += integral * s_y
    size = hypot(s.twist_x, s.twist_y)
    if size > p.bound:
        s.twist_x *= p.bound / size
        s.twist_y *= p.bound / size


SUPER_TWISTING = Law(
    name="super_twisting",
    parameters=SuperTwistingLaw,
    constants=Constants,
    state=State,
    values=_values,
    control=control,
    knowledge="positions and velocities of the scanner, deflection; scanner, cantilever; bounds on friction and rate",
)
