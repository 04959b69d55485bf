"""Force curve: z goes to the sample until the deflection reaches a trigger, rests, and goes back.

    lift -> settle -> approach -> dwell -> retract -> settle ... -> done

This is an order of the program `verbs` (`ordered`), given at the start and repeated: a z loop inside the instrument
(`onboard.kind`) is asked to move z by an offset from where it stood at the start, at the rate of the virtual ADC. x and
y are held. The trigger is the rise of the detector's voltage over its mean while the tip settles, so that an offset of
the detector does not matter.
"""

import math
from typing import Annotated

from annotated_types import Ge, Le
from pydantic import Field, model_validator

from ..compiled.jit import kernel
from ..core.schema import NonNegative, Positive, Unit, refuse_together
from ..parts.groups import ProgramParameters
from ..parts.part import Channel, Program, Tree
from ..parts.signals import Detection, Setpoint
from . import ordered, orders
from .orders import Order, Polynomial, Step

LIFT, SETTLE, APPROACH, DWELL, RETRACT, DONE = range(6)
"""Phases, the values of the channel `curve_phase`."""

_Metre = Annotated[NonNegative, Unit("m")]
_Rate = Annotated[Positive, Unit("m/s")]


class ForceCurveParameters(ProgramParameters):
    """Force curves at one place, one after the other."""

    kind: str = Field("force_curve", description="program of the reference")
    x: Annotated[float, Unit("m")] = Field(0.0, description="place of the scanner along x")
    y: Annotated[float, Unit("m")] = Field(0.0, description="place of the scanner along y")
    lift: _Metre = Field(0.0, description="distance by which z is first withdrawn")
    settle: Annotated[NonNegative, Unit("s")] = Field(
        1e-3, description="rest before an approach; the trigger counts from the mean deflection in it"
    )
    ramp: Annotated[Positive, Unit("m")] = Field(200e-9, description="way of an approach at most")
    approach_rate: _Rate = Field(1e-6, description="velocity of z on the way to the sample")
    retract_rate: _Rate = Field(1e-6, description="velocity of z on the way back")
    trigger_voltage: Annotated[NonNegative, Unit("V")] = Field(
        0.0, description="rise of the deflection at which the approach ends; 0: by trigger_force"
    )
    trigger_force: Annotated[NonNegative, Unit("N")] = Field(
        0.0, description="the same as vertical force; 0, too: the approach ends with the ramp"
    )
    dwell: Annotated[NonNegative, Unit("s")] = Field(0.0, description="rest at the end of the approach, z held")
    count: Annotated[int, Ge(1), Le(1_000_000)] = Field(1, description="curves")

    @property
    def longest(self) -> float:
        """Time that all curves take at most, without a trigger [s]."""
        way = self.ramp / self.approach_rate + self.ramp / self.retract_rate
        return self.lift / self.retract_rate + self.count * (self.settle + self.dwell + way)

    @model_validator(mode="after")
    def _one_trigger(self) -> "ForceCurveParameters":
        refuse_together(self, "reference.", "trigger_voltage", "trigger_force")
        return self


class Constants(ordered.Constants):
    count: float  # curves


class State(ordered.State):
    curves: float  # that are done


def _first(parameters: Tree) -> Order:
    """Steps in the order of the phases."""
    curve, plant = parameters.reference, parameters.plant
    trigger = curve.trigger_voltage
    if curve.trigger_force > 0.0:
        trigger = plant.deflection_voltage(parameters, curve.trigger_force)
    away = {"target": -curve.lift, "rate": curve.retract_rate}
    towards = {"target": curve.ramp - curve.lift, "rate": curve.approach_rate, "trigger": trigger}
    steps = (
        Step(orders.RAMP, **away, then=SETTLE),
        Step(orders.REST, duration=curve.settle, then=APPROACH),
        Step(orders.RAMP, **towards, then=DWELL, triggered=DWELL),
        Step(orders.DWELL, duration=curve.dwell, then=RETRACT),
        Step(orders.RAMP, **away, then=DONE),
        Step(orders.DWELL, duration=math.inf),
    )
    return Order(Polynomial((curve.x,), (curve.y,)), steps)


def _check(parameters: Tree) -> None:
    curve, plant = parameters.reference, parameters.plant
    if parameters.onboard.kind == "none":
        raise ValueError(
            "reference.kind = force_curve needs a loop inside the instrument that moves z: give onboard.kind = pi"
        )
    if plant.kind == "paper":
        raise ValueError(
            "reference.kind = force_curve is not allowed with plant.kind = paper, whose tip cannot leave the sample: "
            "take plant.kind = lever or compliant"
        )
    if curve.trigger_force > 0.0 and plant.spring_constant(parameters) == 0.0:
        raise ValueError(
            f"reference.trigger_force = {curve.trigger_force:g} N is not allowed with plant.kind = {plant.kind}, which "
            f"has no spring constant: give reference.trigger_voltage"
        )


@kernel
def watch(t: float, d: Detection, r: Setpoint, p: Constants, s: State) -> None:
    """See `afm_model.parts.Program`: the steps, again and again."""
    phase = s.at
    ordered.watch(t, d, r, p, s)
    if phase == RETRACT and s.at != RETRACT:
        s.curves += 1.0
        if s.curves < p.count:
            s.at, s.total, s.samples = SETTLE, 0.0, 0.0


FORCE_CURVE = Program(
    name="force_curve",
    parameters=ForceCurveParameters,
    constants=Constants,
    state=State,
    values=lambda parameters: {**ordered.values(parameters), "count": parameters.reference.count},
    start=lambda parameters: {**ordered.start(parameters), "curves": 0.0},
    check=_check,
    reference=ordered.reference,
    watch=watch,
    order=ordered.put_in_force,
    first=_first,
    channels=(
        Channel("curve_phase", "1", "at"),
        Channel("curves_done", "1", "curves"),
        Channel("curve_triggered", "1", "fired"),
        Channel("z_offset", "m", "offset"),
    ),
)
