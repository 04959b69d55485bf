"""law.kind observer: state feedback with a disturbance observer, predicted through the delay; docs/laws.md
(6.1), (6.2).

Ohnishi, Shibata, Murakami, DOI 10.1109/3516.491410.
"""

import math
from typing import Annotated, Literal

from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Vector
from ..core.elementary import expm1
from ..core.schema import NonNegative, Unit
from ..parts.part import Law, Numbers, Tree
from ..parts.signals import Measurement, PiezoDrive
from . import sampled
from .sampled import FeedbackLaw, SampledConstants, SampledState, lateral_axes, pole, time_constant
from .scanner import (
    drive_between,
    error_ahead,
    feed_forward,
    follow_flight,
    place_poles,
    position,
    rate,
    reference_at,
    send,
)

_MOVING = 0.3
"""Speed of a scanner that moves, over that of the reference."""


class ObserverLaw(FeedbackLaw):
    """Takes the whole load on the scanner, friction for the most part, from what the last drive has made of it."""

    kind: str = Field("observer", description="control law")
    averaging_time: Annotated[NonNegative, Unit("s")] = Field(
        0.0,
        description="time constant of the observed load; 0: law.delay_ticks times that of the error (law.friction = "
        "learned: twice that), so that without delay it is the load of the last period",
    )
    friction: Literal["none", "learned"] = Field(
        "none",
        description="learned: the bound of friction is learned while the scanner moves, and fed forward along the "
        "reference to come; none: friction is a load like any other",
    )


class Constants(SampledConstants):
    k_1: Vector
    k_2: Vector
    gain: float
    learned: float


class State(SampledState):
    started: float
    before_1: Vector
    before_2: Vector
    load: Vector  # but for friction, if that is learned
    bound: float  # of friction [U]


def _values(parameters: Tree) -> Numbers:
    law, axes = parameters.law, lateral_axes(parameters)
    poles = [pole(parameters, axis) for axis in axes]
    K = [place_poles(axis, pole, pole) for axis, pole in zip(axes, poles, strict=True)]
    learned = law.friction == "learned"
    # The load that is left where friction is learned does not turn with the motion.
    average = parameters.scales.w0 * law.averaging_time or law.delay_ticks * time_constant(parameters) * (1 + learned)
    return {
        **sampled.sampled_values(parameters),
        "k_1": [*(k for k, _ in K), 0.0],
        "k_2": [*(k for _, k in K), 0.0],
        "learned": learned,
        "gain": -expm1(-axes[0].hold / average) if average > 0.0 else 1.0,
    }


@kernel
def along(y: Measurement, p: Constants, after: float) -> tuple[float, float, float]:
    """Direction and speed of the reference `after` [1/w0] from now."""
    _, x = reference_at(y, p, 0, after)
    _, y_ = reference_at(y, p, 1, after)
    speed = math.sqrt(x * x + y_ * y_)
    return (x / speed, y_ / speed, speed) if speed > 0.0 else (0.0, 0.0, 0.0)


@kernel
def learn(y: Measurement, p: Constants, s: State, felt_x: float, felt_y: float) -> bool:
    """Learn the bound of friction from the load of the last period; whether the scanner moved, so that it was friction.

    A scanner that is held still shows that the bound is not below the load.
    """
    x, y_, speed = along(y, p, -0.5 * p.hold)
    before = x * s.before_2[0] + y_ * s.before_2[1]
    moved = min(before, x * rate(y, p, 0) + y_ * rate(y, p, 1)) > _MOVING * speed > 0.0
    miss = x * (felt_x - s.load[0]) + y_ * (felt_y - s.load[1]) - s.bound
    if moved:
        s.bound += p.gain * miss
    elif miss > 0.0:
        s.bound += miss
    return moved


@kernel
def control(t: float, y: Measurement, u: PiezoDrive, p: Constants, s: State) -> None:
    """See `afm_model.parts.Law`."""
    follow_flight(y, p, s)
    sampled.control_height(y, u, p, s)
    # The drive that would have made this motion of a free scanner; the rest of the drive went into the load.
    x, v, x_y, v_y = position(y, p, 0), rate(y, p, 0), position(y, p, 1), rate(y, p, 1)
    felt = (
        y.drive[0] / p.volts[0] - drive_between(p, 0, s.before_1[0], s.before_2[0], x, v),
        y.drive[1] / p.volts[1] - drive_between(p, 1, s.before_1[1], s.before_2[1], x_y, v_y),
    )
    knows = s.started != 0.0
    if knows and p.learned != 0.0:
        knows = learn(y, p, s, felt[0], felt[1])
    last, meanwhile, then = along(y, p, -0.5 * p.hold), along(y, p, 0.5 * p.ahead), along(y, p, p.ahead + 0.5 * p.hold)
    for axis in range(2):
        if knows:
            s.load[axis] += p.gain * (felt[axis] - s.bound * last[axis] - s.load[axis])
        s.before_1[axis], s.before_2[axis] = position(y, p, axis), rate(y, p, axis)
        e, e_rate = error_ahead(y, p, s, axis, s.load[axis] + s.bound * meanwhile[axis])
        wanted = feed_forward(y, p, axis) + (s.load[axis] + s.bound * then[axis])
        send(u, p, s, axis, wanted - p.k_1[axis] * e - p.k_2[axis] * e_rate)
    s.started = 1.0


OBSERVER = Law(
    name="observer",
    parameters=ObserverLaw,
    constants=Constants,
    state=State,
    values=_values,
    control=control,
    knowledge="positions and velocities of the scanner, deflection; scanner, cantilever",
)
