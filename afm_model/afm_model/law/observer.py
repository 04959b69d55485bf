"""law.kind observer: state feedback with a disturbance observer, predicted through the delay; docs/laws.md (6.1).

Ohnishi, Shibata, Murakami, DOI 10.1109/3516.491410.
"""

from typing import Annotated

from pydantic import Field

from ..core.elementary import expm1
from ..core.jit import kernel
from ..core.records import Vector
from ..core.schema import NonNegative, Unit
from ..parts.part import Law, Numbers, Tree
from ..parts.signals import Measurement, PiezoDrive
from . import sampled
from .sampled import FeedbackLaw, SampledConstants, SampledState, lateral_axes, pole, time_constant
from .scanner import drive_between, error_ahead, feed_forward, follow_flight, place_poles, position, rate, send


class ObserverLaw(FeedbackLaw):
    """Takes the whole load on the scanner, friction for the most part, from what the last drive has made of it."""

    kind: str = Field("observer", description="control law")
    averaging_time: Annotated[NonNegative, Unit("s")] = Field(
        0.0,
        description="time constant of the observed load; 0: law.delay_ticks times that of the error, so that without "
        "delay it is the load of the last period",
    )


class Constants(SampledConstants):
    k_1: Vector
    k_2: Vector
    gain: float


class State(SampledState):
    before_1: Vector
    before_2: Vector
    load: Vector


def _values(parameters: Tree) -> Numbers:
    law, axes = parameters.law, lateral_axes(parameters)
    poles = [pole(parameters, axis) for axis in axes]
    K = [place_poles(axis, pole, pole) for axis, pole in zip(axes, poles, strict=True)]
    average = parameters.scales.w0 * law.averaging_time or law.delay_ticks * time_constant(parameters)
    return {
        **sampled.sampled_values(parameters),
        "k_1": [*(k for k, _ in K), 0.0],
        "k_2": [*(k for _, k in K), 0.0],
        "gain": -expm1(-axes[0].hold / average) if average > 0.0 else 1.0,
    }


@kernel
def control(t: float, y: Measurement, u: PiezoDrive, p: Constants, s: State) -> None:
    """See `afm_model.parts.Law`."""
    follow_flight(y, p, s)
    sampled.control_height(y, u, p, s)
    for axis in range(2):
        x, v = position(y, p, axis), rate(y, p, axis)
        if s.started != 0.0:
            # The drive that would have made this motion of a free scanner; the rest of the drive went into the load.
            free = drive_between(p, axis, s.before_1[axis], s.before_2[axis], x, v)
            s.load[axis] += p.gain * (y.drive[axis] / p.volts[axis] - free - s.load[axis])
        s.before_1[axis], s.before_2[axis] = x, v
        e, e_rate = error_ahead(y, p, s, axis, s.load[axis])
        wanted = feed_forward(y, p, axis) + s.load[axis] - p.k_1[axis] * e - p.k_2[axis] * e_rate
        send(u, p, s, axis, wanted)
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
