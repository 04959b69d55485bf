"""Parameters of the friction-predicting law, what it cannot be made for, and where it cannot hold what it promises."""

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

from annotated_types import Ge, Le

from afm_model.law import SampledLaw
from afm_model.parts import Field, LawEstimate, NonNegative, Positive, Tree, Unit

from .constants import (
    FIRST_Z,
    INTERVALS,
    LONG,
    LONGEST_DELAY,
    OF_VALUE,
    RATIO,
    SLOTS,
    SURFACES,
    VALUE,
    longest,
)
from .gains import grid


class PredictiveLaw(SampledLaw):
    """What the friction-predicting law knows and assumes. Its gains follow from the microscope and the period."""

    kind: str = Field("predictive", description="friction-predicting control, docs/predictive.md")
    packet: Annotated[int, Ge(1), Le(64)] = Field(
        1, description="drives in a control period, each with its time; piezo.dac_period has to be as short"
    )
    spare: Annotated[int, Ge(0), Le(16)] = Field(
        0,
        description="further control periods for which an answer holds drives, played while the next one is late",
    )
    reserve: Annotated[int, Ge(0), Le(511)] = Field(
        0,
        description="further drives after those, planned a few with each answer and kept: they bridge a pause of the "
        "controller",
    )
    feedback: Literal["full", "measured"] = Field(
        "full", description="full: positions and rates as measured; measured: an observer that positions correct"
    )
    position_noise: Annotated[Positive, Unit("m")] = Field(5e-11, description="measured: rms noise of a position")
    deflection_noise: Annotated[NonNegative, Unit("m")] = Field(
        1e-11, description="measured: rms noise of the deflection"
    )
    force_noise: Annotated[NonNegative, Unit("N")] = Field(
        5e-11, description="measured: rms noise of the lateral force"
    )
    surface: Literal["known", "observed", "learned"] = Field(
        "observed",
        description="height of the sample along the reference: known: that of sample.*; observed: from tip and "
        "scanner, continued; learned: observed, and kept along the line of the reference",
    )
    friction: Literal["nominal", "identified"] = Field(
        "identified", description="bound of friction: nominal: that of contact.*; identified: from the lateral force"
    )
    lateral_gain: Literal["nominal", "estimated"] = Field(
        "estimated", description="force on the scanner per lateral signal, over that of the model"
    )
    slow_force: Literal["nominal", "estimated"] = Field(
        "estimated", description="force that the model does not contain, such as that of creep and drift"
    )
    stiffness: Literal["nominal", "estimated"] = Field(
        "estimated", description="stiffness of the scanner over that of the model; of z the sensitivity is part of it"
    )
    corner_x: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="preview: places +-corner_x at which a reference straight along x turns back; 0: none is known"
    )
    corner_y: Annotated[NonNegative, Unit("m")] = Field(0.0, description="the same along y")
    response: Annotated[NonNegative, Unit("s")] = Field(
        0.0, description="time in which an error vanishes; 0: 1/w0, but at least 1.6 and at most 2 control periods"
    )
    height: Annotated[Positive, Unit("m")] = Field(
        12.5e-9, description="largest height of the sample about its mean, for an observed surface"
    )
    wave_number: Annotated[Positive, Unit("rad/m")] = Field(
        2e9, description="largest wave number of the sample along x and y, for an observed surface"
    )

    @property
    def drives_a_period(self) -> int:
        return self.packet


def check(parameters: Tree) -> None:
    """Raise ValueError for parameters that are not allowed together."""
    law, w0 = parameters.law, parameters.scales.w0
    if law.surface == "known" and parameters.sample.kind != "paper":
        raise ValueError(
            f"law.surface = known is not allowed with sample.kind = {parameters.sample.kind}: the law knows the sample "
            f"paper alone; it must be one of {', '.join(list(SURFACES)[1:])}"
        )
    if law.delay_ticks > LONGEST_DELAY:
        raise ValueError(f"law.delay_ticks = {law.delay_ticks} is not allowed: it must be <= {LONGEST_DELAY}")
    slots = longest(parameters)
    if slots > SLOTS:
        raise ValueError(
            f"law.packet = {law.packet} with law.delay_ticks = {law.delay_ticks}, law.spare = {law.spare} and "
            f"law.reserve = {law.reserve} is not allowed: law.packet (law.delay_ticks + 1 + law.spare) + law.reserve = "
            f"{slots} must be <= {SLOTS}"
        )
    division = grid(law.period * w0 / law.packet, law.response * w0, law.packet)
    at_once = max(law.packet * (1 + law.spare), law.packet + 1 if law.reserve else 0)
    ahead = division.fine * (division.holds + at_once - 1)
    if ahead > INTERVALS:
        raise ValueError(
            f"law.period = {law.period:g} s is not allowed with law.packet = {law.packet}, law.response = "
            f"{law.response:g} s: the law would look {ahead} intervals ahead and must not look farther than "
            f"{INTERVALS}; raise law.packet or lower law.response"
        )


def warnings(parameters: Tree, control_period: float) -> list[str]:
    """Where positions alone are not enough; axes that swing by half a period or more between two drives."""
    law, scanner = parameters.law, parameters.scanner
    slot = control_period / law.packet
    sentences = []
    if law.feedback == "measured" and law.surface == "observed" and law.packet > 1:
        sentences.append(
            f"x and y will be tracked within a tenth of the way at best: with law.feedback = measured and law.packet ="
            f" {law.packet} law.surface should be known or learned, it is {law.surface} (docs/predictive.md)"
        )
    if law.feedback == "measured" and slot * parameters.scales.w0 >= LONG:
        sentences.append(
            f"the tip may be lost where friction is stronger than configured: with law.feedback = measured a drive "
            f"should be held for less than {LONG / parameters.scales.w0:g} s, it is for {slot:g} s; raise law.packet"
            " (docs/predictive.md)"
        )
    return sentences + [
        f"along {axis} the scanner swings between two drives: 2 pi scanner.f_{axis} plant.control_period / law.packet "
        f"= {2.0 * math.pi * f * slot:.3g} should be < 3.14 (scanner.f_{axis} = {f:g} Hz, plant.control_period = "
        f"{control_period:g} s, law.packet = {law.packet})"
        for axis, f in (("x", scanner.f_x), ("y", scanner.f_y), ("z", scanner.f_z))
        if 2.0 * f * slot >= 1.0
    ]


def estimates(p: Any, s: Any) -> Iterator[LawEstimate]:
    """What it believes of the microscope, each with its standard deviation, and how far it distrusts its model."""
    yield from _of_friction(p, s)
    for i, axis in enumerate("xyz"):
        yield LawEstimate(f"sensor_zero_{axis}", "m", float(s.unstretched[i] * (p.z0 if axis == "z" else p.x0)))
    yield LawEstimate("distrust", "1", float(s.distrust))
    yield LawEstimate("fallbacks", "1", float(s.fallbacks))


def _of_friction(p: Any, s: Any) -> Iterator[LawEstimate]:
    """What it believes where friction moves the scanner."""
    # Each name of a record is looked up once: that takes longer than all that is computed here.
    gain_of, slow, softer, unsure, stiffness = s.gain_of, s.slow, s.softer, s.unsure, p.stiffness
    lateral_force = p.lateral_force
    for i, axis in enumerate("xyz"):
        force, of_model = p.normal_force if axis == "z" else lateral_force, stiffness[i]
        numbers = [
            ("lateral_gain", "1", gain_of[i], unsure[i, 0, 0], 1.0),
            ("slow_force", "N", slow[i] * force, unsure[i, 1, 1], force),
            ("stiffness", "1", 1.0 + softer[i] / of_model, unsure[i, 2, 2], 1.0 / of_model),
        ]
        # Along z there is no friction.
        for name, unit, value, variance, scale in numbers[1:3] if axis == "z" else numbers:
            yield LawEstimate(f"{name}_{axis}", unit, float(value))
            yield LawEstimate(f"{name}_{axis}_deviation", unit, float(scale * math.sqrt(max(variance, 0.0))))
    # Over a known surface the ratio is a mean, and the deviation is that of one measurement.
    variance = s.P[RATIO, RATIO] if p.measured else s.ratio[OF_VALUE] if s.unknown else p.ratio_noise * p.ratio_noise
    yield LawEstimate("friction_ratio", "1", float(s.ratio[VALUE]))
    yield LawEstimate("friction_ratio_deviation", "1", math.sqrt(max(float(variance), 0.0)))


def remark(state: Any) -> str:
    """Return how often the guard has distrusted the model, whether it does now, and what is not as configured."""
    sentences = []
    if state.fallbacks > 0.0:
        now = f"; distrust now {state.distrust:.2g} of 1" if state.distrust > 0.0 else ""
        times = f"{state.fallbacks:.0f} times{now}"
        sentences.append(f"the model did not explain the measurements: fell back to open loop {times}")
    if state.contradicts > 0.0 and state.unknown:
        sentences.append(
            "the height measured is not that of sample.*: the surface is followed as law.surface = observed"
        )
    if abs(state.learned[2, 1]) >= FIRST_Z[1]:
        sentences.append(
            "a force along z is larger than the law learns, and is an error of the load: the zero of the z sensor is "
            "no longer that of the piezo, or the z piezo drifts"
        )
    return "; ".join(sentences)
