"""Force curve: z goes to the sample until the deflection reaches a trigger, rests, and goes back.

    lift -> settle -> approach -> dwell -> retract -> settle ... -> done

The program asks a z loop inside the instrument (`onboard.kind`) to move z by an offset from where it stood at the
start, at the rate of the virtual ADC; the loop itself is open meanwhile. x and y are held. The trigger is the rise of
the detector's voltage over its mean while the tip settles, so that an offset of the detector does not matter.
"""

from typing import Annotated, Any

from annotated_types import Ge, Le
from pydantic import Field, model_validator

from ..core.jit import kernel
from ..core.records import Record
from ..core.schema import NonNegative, Positive, Unit
from ..parts.groups import ProgramParameters
from ..parts.part import Channel, Numbers, Program, Tree
from ..parts.signals import OPEN

LIFT, SETTLE, APPROACH, DWELL, RETRACT, DONE = range(6)
"""Phases, as the channel `curve_phase` tells them."""

_Metre = Annotated[NonNegative, Unit("m")]
_Rate = Annotated[Positive, Unit("m/s")]


class ForceCurve(ProgramParameters):
    """Force curves at one place, one after the other."""

    kind: str = Field("force_curve", description="program of the reference")
    x: Annotated[float, Unit("m")] = Field(0.0, description="place of the scanner along x")
    y: Annotated[float, Unit("m")] = Field(0.0, description="place of the scanner along y")
    lift: _Metre = Field(0.0, description="z is first withdrawn by this from where it stands")
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
        0.0, description="the same as force of the cantilever; 0, too: the approach ends with the ramp"
    )
    dwell: Annotated[NonNegative, Unit("s")] = Field(0.0, description="rest at the end of the approach, z held")
    count: Annotated[int, Ge(1), Le(1_000_000)] = Field(1, description="curves")

    @property
    def longest(self) -> float:
        """Time that all curves take at most, without a trigger [s]."""
        way = self.ramp / self.approach_rate + self.ramp / self.retract_rate
        return self.lift / self.retract_rate + self.count * (self.settle + self.dwell + way)

    @model_validator(mode="after")
    def _one_trigger(self) -> "ForceCurve":
        if self.trigger_voltage > 0.0 and self.trigger_force > 0.0:
            raise ValueError(
                f"reference.trigger_voltage = {self.trigger_voltage:g} V and reference.trigger_force = "
                f"{self.trigger_force:g} N are not allowed together: give one"
            )
        return self


class Constants(Record):
    x: float
    y: float
    z_r: float
    lift: float
    settle: float
    ramp: float
    approach_rate: float
    retract_rate: float
    dwell: float
    count: float
    trigger: float  # [V]; 0: none


class State(Record):
    phase: float
    since: Annotated[float, "s"]  # when it began
    offset: Annotated[float, "m"]  # of z
    turn: Annotated[float, "m"]  # of z where the last approach ended
    sum: Annotated[float, "V"]  # of the deflection while the tip settles
    samples: Annotated[float, "V"]
    curves: float  # that are done
    triggered: float  # 1.0 if the last approach ended by its trigger


def _values(parameters: Tree) -> Numbers:
    curve = parameters.reference
    trigger = curve.trigger_voltage
    if curve.trigger_force > 0.0:
        trigger = parameters.plant.deflection_voltage(parameters, curve.trigger_force)
    return {name: getattr(curve, name) for name in Constants.names if name != "trigger"} | {"trigger": trigger}


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
            f"tells no spring constant: give reference.trigger_voltage"
        )


@kernel
def reference(t: float, r: Any, p: Any) -> None:
    """See `afm_model.parts.Program`."""
    for axis in range(3):
        r.velocity[axis] = r.acceleration[axis] = 0.0
    r.position[0], r.position[1], r.position[2] = p.x, p.y, p.z_r


@kernel
def watch(t: float, d: Any, r: Any, p: Any, s: Any) -> None:
    """See `afm_model.parts.Program`. A phase is left at most once in a sample."""
    phase, passed = s.phase, t - s.since
    if phase == LIFT:
        s.offset = max(-p.retract_rate * passed, -p.lift)
        if s.offset <= -p.lift:
            s.phase = SETTLE
    elif phase == SETTLE:
        s.sum += d.deflection_voltage
        s.samples += 1.0
        if passed >= p.settle:
            s.phase = APPROACH
    elif phase == APPROACH:
        way = min(p.approach_rate * passed, p.ramp)
        s.offset = way - p.lift
        reached = p.trigger > 0.0 and d.deflection_voltage - s.sum / s.samples >= p.trigger
        if reached or way >= p.ramp:
            s.triggered = 1.0 if reached else 0.0
            s.turn = s.offset
            s.phase = DWELL
    elif phase == DWELL:
        if passed >= p.dwell:
            s.phase = RETRACT
    elif phase == RETRACT:
        s.offset = max(s.turn - p.retract_rate * passed, -p.lift)
        if s.offset <= -p.lift:
            s.curves += 1.0
            s.phase = SETTLE if s.curves < p.count else DONE
    if s.phase != phase:
        s.since = t
        if s.phase == SETTLE:
            s.sum = s.samples = 0.0
    r.z_mode, r.z_offset = OPEN, s.offset


FORCE_CURVE = Program(
    name="force_curve",
    parameters=ForceCurve,
    constants=Constants,
    state=State,
    values=_values,
    check=_check,
    reference=reference,
    watch=watch,
    channels=(
        Channel("curve_phase", "1", "phase"),
        Channel("curves_done", "1", "curves"),
        Channel("curve_triggered", "1", "triggered"),
        Channel("z_offset", "m", "offset"),
    ),
)
