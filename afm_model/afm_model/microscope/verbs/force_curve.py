"""The verb ForceCurve."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from annotated_types import Gt, Le
from numpy.typing import NDArray
from pydantic import Field, model_validator

from ...core.errors import VerbError
from ...core.schema import Unit, build, python_value, refuse_together
from ...program import orders
from ...program.force_curve import APPROACH, DWELL, LIFT, RETRACT, SETTLE
from ...program.orders import Order, Step
from ..arrays import Arrays, Variable, attributes, variable
from ..collect import RecordCollector
from ..execution import Execution, Task, after, landing
from ..quantities import Count, Force, Length, Rest, SampleRate, Speed, Volts
from ..results import MicroscopeState, TimeSeries
from ..verb import Verb, saturating, too_fast, too_much
from ..view import InstrumentView

if TYPE_CHECKING:
    import xarray

_PHASES = (LIFT, SETTLE, APPROACH, DWELL, RETRACT)
"""Of the steps of an order, in order."""
_NAMES = ["z", "deflection_voltage", "lateral_voltage", "step"]
_AGAIN = 2.0
"""The tip goes back to the sample by so many times the way that it was lifted by, at most."""
_FLAGS = {"flag_values": [APPROACH, DWELL, RETRACT], "flag_meanings": "approach dwell retract"}
_UNITS = {
    **{"triggered": "1", "trigger": "V", "approach_rate": "m/s", "retract_rate": "m/s"},
    **{"deflection_sensitivity": "m/V", "spring_constant": "N/m", "x": "m", "y": "m"},
}
"""Of the fields of a curve that are single numbers."""


@dataclass(frozen=True)
class Curve:
    """One force curve: approach, dwell, retract."""

    record: TimeSeries
    """Channels `z` (as driven, towards the sample) [m], `deflection_voltage` [V], `lateral_voltage` [V], `phase`."""
    triggered: bool  # the approach ended by its trigger
    x: float  # place [m]
    y: float
    approach_rate: float  # [m/s]
    retract_rate: float
    deflection_sensitivity: float  # that the microscope believes [m/V]
    spring_constant: float  # for vertical forces, that it believes [N/m]
    trigger: float = 0.0  # rise of the deflection at which the approach was to end [V]; 0: none
    verb: "ForceCurve | None" = None  # by which it was measured, if that is known

    def _variables(self, dims: tuple[str, ...]) -> dict[str, Variable]:
        found = self.record.variables(dims)
        found["phase"] = found["phase"]._replace(attributes={**found["phase"].attributes, **_FLAGS})
        force = self.record.channels["deflection_voltage"] * self.deflection_sensitivity * self.spring_constant
        return found | {"force": variable(dims, force, "force", "N")}

    def arrays(self) -> Arrays:
        """Over time: `z`, `deflection_voltage`, `lateral_voltage`, `phase` and `force`."""
        numbers = {name: getattr(self, name) for name in _UNITS} | {"triggered": int(self.triggered)}
        time = variable(("time",), self.record.time, "time", "s")
        return Arrays(self._variables(("time",)), {"time": time}, self._asked() | numbers)

    def _asked(self) -> dict[str, Any]:
        return attributes(self.verb, {}) if self.verb is not None else {}

    @staticmethod
    def together(curves: "Sequence[Curve]") -> Arrays:
        """Return the curves over (curve, sample); shorter ones end with NaN.

        The numbers of each curve are coordinates along `curve`, the fields of the verb attributes.
        """
        dims = ("curve", "sample")
        every = [curve._variables(dims) | {"time": variable(dims, curve.record.time, "time", "s")} for curve in curves]
        longest = max(len(curve.record.time) for curve in curves)

        def padded(parts: list[NDArray[Any]]) -> NDArray[Any]:
            return np.stack([np.pad(each, (0, longest - len(each)), constant_values=np.nan) for each in parts])

        variables = {
            name: first._replace(values=padded([each[name].values for each in every]))
            for name, first in every[0].items()
        }
        numbers = {
            name: Variable(("curve",), np.array([float(getattr(curve, name)) for curve in curves]), {"units": unit})
            for name, unit in _UNITS.items()
        }
        return Arrays(variables, numbers, curves[0]._asked())


def as_curves(curves: "Curve | Sequence[Curve] | xarray.Dataset") -> list[Curve]:
    """Force curves as `Curve`, from those or from their labelled arrays, of one or of many.

    Raises
    ------
    ValueError
        If it is something else.
    """
    if isinstance(curves, Curve):
        return [curves]
    if isinstance(curves, Sequence) and all(isinstance(each, Curve) for each in curves):
        return list(curves)
    if not {"z", "deflection_voltage", "phase"} <= set(getattr(curves, "data_vars", ())):
        raise ValueError(f"{type(curves).__name__} has no force curves: it must be a list of Curve or labelled arrays")
    dataset: Any = curves
    given = {str(name): python_value(value) for name, value in dataset.attrs.items()}
    asked = {name: given[name] for name in ForceCurve.model_fields if name in given}
    verb = build(ForceCurve, asked) if given.get("verb") == ForceCurve.__name__ else None
    if "curve" not in dataset.dims:
        return [_curve(dataset, np.asarray(dataset.time), dataset.attrs, verb)]
    found = []
    for number in range(dataset.sizes["curve"]):
        one = dataset.isel(curve=number)
        time = np.asarray(one.time)
        measured = np.isfinite(time)
        numbers = {name: one[name].item() for name in _UNITS}
        found.append(_curve(one.isel(sample=measured), time[measured], numbers, verb))
    return found


def _curve(dataset: Any, time: Any, numbers: Mapping[str, Any], verb: "ForceCurve | None") -> Curve:
    variables = {str(name): each for name, each in dataset.data_vars.items() if name not in ("force", "time")}
    record = TimeSeries(
        np.asarray(time, dtype=np.float64),
        {name: np.asarray(values, dtype=np.float64) for name, values in variables.items()},
        {name: values.attrs["units"] for name, values in variables.items()},
    )
    read = {name: python_value(numbers[name]) for name in _UNITS}
    return Curve(record=record, **read | {"triggered": bool(read["triggered"])}, verb=verb)


Measured = list[tuple[RecordCollector, bool]]
"""A record for each curve, and whether its approach ended by its trigger."""
_OVERSHOOT = 0.1
"""Part of the trigger by which the deflection may rise beyond it without a message."""


def _rise(curve: Curve) -> float:
    """Largest deflection over that at the begin of the approach, where the cantilever is free [V]."""
    volts = curve.record.channels["deflection_voltage"]
    approach = volts[curve.record.channels["phase"] == APPROACH]
    first = approach[: max(approach.size // 100, 1)]
    return float(volts.max() - first.mean()) if first.size else 0.0


class ForceCurve(Verb):
    """Force curves where the scanner stands. The feedback is off meanwhile, and on again after them."""

    returns: ClassVar = list[Curve]
    on_sample: ClassVar = True
    presses: ClassVar = True

    lift: Length = Field(200e-9, description="z is first withdrawn by this from where it stands")
    ramp: Length = Field(400e-9, description="way of an approach at most")
    settle: Annotated[float, Gt(0), Le(1e4), Unit("s")] = Field(
        2e-3, description="rest before an approach; the trigger counts from the mean deflection in it"
    )
    approach_rate: Speed = Field(1e-6, description="velocity of z on the way to the sample")
    retract_rate: Speed = Field(1e-6, description="velocity of z on the way back")
    trigger_voltage: Volts = Field(
        0.0, description="rise of the deflection at which an approach ends; 0: by trigger_force"
    )
    trigger_force: Force = Field(0.0, description="the same as vertical force; 0, too: an approach ends with the ramp")
    dwell: Rest = Field(0.0, description="rest at the end of an approach, z held")
    count: Count = Field(1, description="curves, one after the other")
    sample_rate: SampleRate = Field(50e3, description="samples of the result; each is a mean over samples of the ADC")

    @model_validator(mode="after")
    def _one_trigger(self) -> "ForceCurve":
        refuse_together(self, "", "trigger_voltage", "trigger_force")
        return self

    def trigger(self, view: InstrumentView) -> float:
        """Rise of the deflection at which an approach ends [V]; 0: with the ramp."""
        return view.volts(self.trigger_force) if self.trigger_force > 0.0 else self.trigger_voltage

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        if self.trigger_force > 0.0 and view.spring_constant == 0.0:
            yield (
                f"trigger_force = {self.trigger_force:g} N is not allowed with plant.kind = "
                f"{view.parameters.plant.kind}, which has no spring constant: give trigger_voltage"
            )
        yield from saturating("a trigger", self.trigger(view), view)
        yield from too_fast("approach_rate", self.approach_rate, self.trigger(view), self.ramp, view)
        yield from too_fast("retract_rate", self.retract_rate, 0.0, self.ramp, view)
        low, high = view.reach
        if view.offset - self.lift < low:
            yield f"lift = {self.lift:g} m is not allowed here: z has {view.offset - low:.4g} m left to go away"
        if view.offset - self.lift + self.ramp > high:
            yield (
                f"ramp = {self.ramp:g} m is not allowed here: with lift = {self.lift:g} m z has "
                f"{high - view.offset + self.lift:.4g} m to go towards the sample"
            )
        one = self.ramp / self.approach_rate + self.dwell + self.ramp / self.retract_rate
        yield from too_much(
            len(_NAMES) * view.samples(self.count * one, self.sample_rate),
            f"count = {self.count} of curves of up to {one:.4g} s at sample_rate = {self.sample_rate:g} Hz",
        )

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        measured: Measured = []

        def result() -> list[Curve]:
            curves = self.curves(run.view, measured)
            run.remark = "; ".join(filter(None, [self._untriggered(curves), self._overshot(curves), run.of_lift]))
            return curves

        run.result = result
        yield from self.measuring(run, measured)

    def _untriggered(self, curves: list[Curve]) -> str:
        """What is to be said of approaches that ended without their trigger."""
        missed = [curve for curve in curves if curve.trigger > 0.0 and not curve.triggered]
        if not missed:
            return ""
        return (
            f"in {len(missed)} of {len(curves)} curves the deflection did not rise by the trigger of "
            f"{missed[0].trigger:.4g} V within ramp = {self.ramp:.4g} m: use a longer ramp, a shorter lift or a lower "
            f"trigger"
        )

    def _overshot(self, curves: list[Curve]) -> str:
        """What is to be said of approaches that went beyond their trigger."""
        parts = [_rise(curve) / curve.trigger for curve in curves if curve.triggered and curve.trigger > 0.0]
        if not parts or max(parts) < 1.0 + _OVERSHOOT:
            return ""
        return (
            f"the deflection rose to {max(parts):.3g} times the trigger: after it z goes on for a sample and for the "
            f"lag of the scanner; use an approach_rate below {self.approach_rate:g} m/s"
        )

    def measuring(self, run: Execution, measured: Measured) -> Iterator[Task]:
        """The tasks; what is measured is put into `measured`, one that was broken off last."""
        view = run.view
        run.state.approached = False
        run.surface = view.offset
        down = view.offset - self.lift
        top = down + self.ramp
        one = self.lift / self.retract_rate + self.settle + self.dwell
        one += self.ramp / self.approach_rate + self.ramp / self.retract_rate
        back = 2.0 * self.settle + _AGAIN * self.lift / self.approach_rate
        run.total = self.count * one + back
        steps = (
            Step(orders.RAMP, target=down, rate=self.retract_rate, then=1),
            Step(orders.REST, duration=self.settle, then=2),
            Step(orders.RAMP, target=top, rate=self.approach_rate, trigger=self.trigger(view), then=3, triggered=3),
            Step(orders.DWELL, duration=self.dwell, then=4),
            Step(orders.RAMP, target=down, rate=self.retract_rate),
        )
        stays = False
        target = min(down + _AGAIN * self.lift, view.reach[1])

        def landed() -> tuple[Step, ...]:
            # A short lift does not leave the sample: the setpoint counts from where the deflection is.
            return landing(view, target, self.approach_rate, self.settle, run.rest)

        run.back = lambda: (after(steps[0], landed()), back + (top - down) / self.retract_rate)
        for number in range(self.count):
            recorder = run.recorder(_NAMES, self.sample_rate)
            measured.append((recorder, False))
            yield Task(Order(view.stay(), steps), one, f"curve {number + 1} of {self.count}", recorder)
            measured[-1] = recorder, run.triggered
            stays |= view.touching
        if stays:
            pressed = max(view.setpoint, 0.0) * view.vertical_sensitivity
            run.of_lift = view.stays_in_contact("lift", self.lift, pressed)
        yield Task(Order(view.stay(), landed()), back, "back to the sample")
        if not run.triggered:
            raise VerbError(
                f"after the curves the sample was not found again: z went {target - down:.4g} m without the "
                f"deflection rising to the setpoint of {view.setpoint:.4g} V; the tip is withdrawn"
            )
        run.state.approached = True

    def curves(self, view: InstrumentView, measured: Measured) -> list[Curve]:
        """What was measured, as far as it came."""
        return [self._curve(view, recorder, triggered) for recorder, triggered in measured]

    def _curve(self, view: InstrumentView, recorder: RecordCollector, triggered: bool) -> Curve:
        record = recorder.record()
        step = np.rint(record.channels["step"]).astype(int)
        # Behind the last step the order is done: -1. A mean over its end would be some step between.
        step = np.maximum.accumulate(step)
        phase = np.array([*_PHASES, RETRACT], np.float64)[step]
        part = phase >= APPROACH
        values = {name: values[part] for name, values in record.channels.items() if name != "step"}
        units = {name: unit for name, unit in record.units.items() if name != "step"} | {"phase": "1"}
        x, y = view.place
        return Curve(
            TimeSeries(record.time[part], values | {"phase": phase[part]}, units),
            triggered=triggered,
            x=x,
            y=y,
            approach_rate=self.approach_rate,
            retract_rate=self.retract_rate,
            # Both are those of vertical motion: their product times the voltage is the vertical force.
            deflection_sensitivity=view.vertical_sensitivity,
            spring_constant=view.vertical_stiffness,
            trigger=self.trigger(view),
            verb=self,
        )
