"""law.kind implicit: sliding mode in backward Euler, on the disc of friction; docs/laws.md (4.1), (4.2).

Acary, Brogliato, Orlov, DOI 10.1109/TAC.2011.2174676.
"""

from typing import Annotated

from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Vector
from ..core.elementary import hypot, square
from ..core.schema import NonNegative, Positive, Unit
from ..parts.part import Law, Numbers, Tree
from ..parts.signals import Measurement, PiezoDrive
from . import sampled
from .sampled import FeedbackLaw, SampledConstants, SampledState, lateral_axes, pole
from .scanner import error_ahead, feed_forward, follow_flight, place_poles, reference_at, send


class ImplicitLaw(FeedbackLaw):
    """Set-valued switching of bounded size along the error of the next tick: no chatter, and no integral either."""

    kind: str = Field("implicit", description="control law")
    friction_bound: Annotated[Positive, Unit("N")] = Field(
        225e-9, description="largest force of the switching, a bound on friction (the paper's M = 15)"
    )
    friction: Annotated[NonNegative, Unit("N")] = Field(
        0.0, description="friction fed forward along the reference's velocity, where it is known; 0: it is not"
    )


class Constants(SampledConstants):
    k_1: Vector
    k_2: Vector
    bound: float
    friction: float


class State(SampledState):
    """Nothing more."""


def lateral_unit(parameters: Tree) -> float:
    """Lateral force unit m_p w0^2 x0 [N]."""
    scales = parameters.scales
    return float(parameters.scanner.mass_ratio * parameters.cantilever.m_c * square(scales.w0) * scales.x0)


def _values(parameters: Tree) -> Numbers:
    law, unit = parameters.law, lateral_unit(parameters)
    # A step of the law lasts until its next drive can act: the period and the delay.
    axes = lateral_axes(parameters, 1 + law.delay_ticks)
    K = [place_poles(axis, 0.0, pole(parameters, axis)) for axis in axes]
    return {
        **sampled.sampled_values(parameters),
        "k_1": [*(k for k, _ in K), 0.0],
        "k_2": [*(k for _, k in K), 0.0],
        "bound": law.friction_bound / unit,
        "friction": law.friction / unit,
    }


@kernel
def control(t: float, y: Measurement, u: PiezoDrive, p: Constants, s: State) -> None:
    """See `afm_model.parts.Law`."""
    follow_flight(y, p, s)
    sampled.control_height(y, u, p, s)
    # Known friction, at the middle of the time in which this drive is in force.
    middle = p.ahead + 0.5 * p.hold
    _, v_x = reference_at(y, p, 0, middle)
    _, v_y = reference_at(y, p, 1, middle)
    speed = hypot(v_x, v_y)
    f_x, f_y = 0.0, 0.0
    if speed > 0.0:
        f_x, f_y = p.friction * v_x / speed, p.friction * v_y / speed
    # K e is the drive that takes the sliding variable to zero in one step; the switching gives it within its disc.
    e, e_rate = error_ahead(y, p, s, 0, f_x)
    a_x = p.k_1[0] * e + p.k_2[0] * e_rate
    e, e_rate = error_ahead(y, p, s, 1, f_y)
    a_y = p.k_1[1] * e + p.k_2[1] * e_rate
    size = hypot(a_x, a_y)
    part = 1.0 if size <= p.bound else p.bound / size
    send(u, p, s, 0, feed_forward(y, p, 0) + f_x - part * a_x)
    send(u, p, s, 1, feed_forward(y, p, 1) + f_y - part * a_y)


IMPLICIT = Law(
    name="implicit",
    parameters=ImplicitLaw,
    constants=Constants,
    state=State,
    values=_values,
    control=control,
    knowledge="positions and velocities of the scanner, deflection; scanner, cantilever; a bound on friction",
)
