"""Four-quadrant photodiode: deflection and lateral force as voltages, with their imperfections.

    V_deflection = deflection_gain z / S_z + lateral_in_deflection F / S_F
    V_lateral    = deflection_in_lateral z / S_z + lateral_gain F / S_F + lateral_offset

then noise, low-pass, ADC; docs/imperfections.md.
"""

import math
from typing import Annotated

from annotated_types import Ge, Gt, Lt
from pydantic import Field, model_validator

from ..compiled.jit import kernel
from ..compiled.records import Block, Record
from ..core import low_pass
from ..core.converter import convert
from ..core.low_pass import LowPass
from ..core.schema import NonNegative, Positive, Unit, refuse_together
from ..parts.groups import DetectorParameters
from ..parts.part import Detector, Numbers, Tree
from ..parts.signals import Detection, Truth

_Part = Annotated[float, Gt(-1), Lt(1)]


class Photodiode(DetectorParameters):
    """Photodetector and position sensors. By default they are ideal."""

    noise: Annotated[NonNegative, Unit("V")] = Field(0.0, description="rms white noise of a photodetector sample")
    noise_density: Annotated[NonNegative, Unit("V/sqrt(Hz)")] = Field(
        0.0, description="one-sided density of the photodetector's noise, in place of detector.noise"
    )
    deflection_noise_density: Annotated[NonNegative, Unit("m/sqrt(Hz)")] = Field(
        0.0, description="the same as deflection: times detector.deflection_sensitivity"
    )
    bandwidth: Annotated[NonNegative, Unit("Hz")] = Field(
        0.0, description="first-order low-pass of both signals before the ADC; 0: none"
    )
    deflection_gain: Annotated[float, Gt(0)] = Field(
        1.0, description="true deflection voltage over that of detector.deflection_sensitivity"
    )
    lateral_gain: Annotated[float, Gt(0)] = Field(
        1.0, description="true lateral voltage over that of detector.lateral_sensitivity"
    )
    lateral_in_deflection: _Part = Field(
        0.0, description="crosstalk: part of the lateral voltage that is in the deflection voltage"
    )
    deflection_in_lateral: _Part = Field(
        0.0, description="crosstalk: part of the deflection voltage that is in the lateral voltage"
    )
    lateral_offset: Annotated[float, Unit("V")] = Field(0.0, description="lateral voltage without a lateral force")
    adc_bits: Annotated[int, Ge(0), Lt(33)] = Field(0, description="resolution over +-adc_limit; 0: continuous")
    adc_limit: Annotated[Positive, Unit("V")] = Field(
        10.0, description="with adc_bits > 0 the ADC saturates at +-adc_limit"
    )
    range: Annotated[NonNegative, Unit("V")] = Field(0.0, description="the photodiode saturates at +-range; 0: nowhere")

    @model_validator(mode="after")
    def _one_noise(self) -> "Photodiode":
        refuse_together(self, "detector.", "noise", "noise_density", "deflection_noise_density")
        return self

    @property
    def most_voltage(self) -> float:
        """Largest voltage that is read [V]; infinite without a range."""
        adc = self.adc_limit * (1.0 - 2.0 / 2**self.adc_bits) if self.adc_bits > 0 else math.inf
        return min(self.range or math.inf, adc)

    @property
    def sample_noise(self) -> float:
        """Rms noise of a sample [V]."""
        density = self.noise_density or self.deflection_noise_density / self.deflection_sensitivity
        return self.noise or low_pass.noise_of_density(density, self.bandwidth, self.sample_period)


class Constants(LowPass):
    a: Annotated[float, "m"]
    deflection_sensitivity: Annotated[float, "m/V"]
    lateral_sensitivity: Annotated[float, "N/V"]
    deflection_gain: float
    lateral_gain: float
    lateral_in_deflection: float
    deflection_in_lateral: float
    lateral_offset: Annotated[float, "V"]
    adc_lsb: Annotated[float, "V"]
    adc_limit: Annotated[float, "V"]
    range: Annotated[float, "V"]
    most_voltage: Annotated[float, "V"]  # beyond it a sample is saturated


class State(Record):
    """What the low-pass remembers. It is not recorded: most photodiodes have none."""

    started: float
    deflection: Annotated[float, "V"]  # behind the low-pass
    deflection_in: Annotated[float, "V"]  # before it, at the last sample
    deflection_noise: Annotated[float, "V"]
    lateral: Annotated[float, "V"]
    lateral_in: Annotated[float, "V"]
    lateral_noise: Annotated[float, "V"]
    saturated: float  # samples in which one of the voltages was beyond the range


def _values(parameters: Tree) -> Numbers:
    detector = parameters.detector
    return {
        "a": parameters.cantilever.a,
        **low_pass.constants(detector.bandwidth, detector.sample_noise, detector.sample_period),
        "adc_lsb": 2.0 * detector.adc_limit / 2**detector.adc_bits if detector.adc_bits > 0 else 0.0,
        "adc_limit": detector.adc_limit if detector.adc_bits > 0 else 0.0,
        "range": detector.range or math.inf,
        "most_voltage": detector.most_voltage,
    }


@kernel
def detect(o: Truth, d: Detection, p: Constants, s: State, r: Block) -> None:
    """See `afm_model.parts.Detector`; s is a record of State."""
    z = (o.tip_height - p.a + o.deflection_excess) / p.deflection_sensitivity
    f = (o.friction[0] + o.lateral_excess) / p.lateral_sensitivity
    deflection = p.deflection_gain * z + p.lateral_in_deflection * f
    lateral = p.lateral_gain * f + p.deflection_in_lateral * z + p.lateral_offset
    if p.filtered == 0.0:
        deflection += p.noise * r[0]
        lateral += p.noise * r[1]
    else:
        if s.started == 0.0:
            s.started = 1.0
            s.deflection, s.deflection_noise = deflection, p.noise * r[0]
            s.lateral, s.lateral_noise = lateral, p.noise * r[1]
        else:
            s.deflection = p.keep * s.deflection + p.new * deflection + p.old * s.deflection_in
            s.lateral = p.keep * s.lateral + p.new * lateral + p.old * s.lateral_in
            s.deflection_noise = p.keep * s.deflection_noise + p.shake * r[0]
            s.lateral_noise = p.keep * s.lateral_noise + p.shake * r[1]
        s.deflection_in, s.lateral_in = deflection, lateral
        deflection = s.deflection + s.deflection_noise
        lateral = s.lateral + s.lateral_noise
    if max(abs(deflection), abs(lateral)) > p.most_voltage:
        s.saturated += 1.0
    d.deflection_voltage = convert(min(max(deflection, -p.range), p.range), p.adc_lsb, p.adc_limit)
    d.lateral_voltage = convert(min(max(lateral, -p.range), p.range), p.adc_lsb, p.adc_limit)


def _noisy(parameters: Tree) -> bool:
    return bool(parameters.detector.sample_noise > 0.0)


def _ideal(parameters: Tree) -> bool:
    d = parameters.detector
    exact = d.deflection_gain == 1.0 and d.lateral_in_deflection == 0.0
    return bool(exact and d.sample_noise == 0.0 and d.bandwidth == 0.0 and d.adc_bits == 0)


def _warnings(parameters: Tree) -> list[str]:
    d = parameters.detector
    found = []
    density = d.deflection_noise_density or d.noise_density * d.deflection_sensitivity
    if density > 0.0 and not 1e-15 <= density <= 1e-11:
        found.append(
            f"a noise density of {density:.3g} m/sqrt(Hz) of the deflection is implausible: photodetectors have 5e-15 "
            f"to 1e-12 m/sqrt(Hz)"
        )
    if d.bandwidth > 0.5 / d.sample_period and d.sample_noise > 0.0:
        found.append(
            f"detector.bandwidth = {d.bandwidth:g} Hz is above half the rate of the ADC, {0.5 / d.sample_period:g} Hz: "
            f"noise beyond is folded into the signal"
        )
    for name in ("deflection_gain", "lateral_gain"):
        if not 0.5 <= (value := getattr(d, name)) <= 2.0:
            found.append(f"detector.{name} = {value:g} is implausible: calibrations are wrong by a factor of 2 at most")
    for name in ("lateral_in_deflection", "deflection_in_lateral"):
        if abs(value := getattr(d, name)) > 0.2:
            found.append(f"detector.{name} = {value:g} is implausible: crosstalk of photodiodes is 0.01 to 0.1")
    return found


PHOTODIODE = Detector(
    name="photodiode",
    parameters=Photodiode,
    constants=Constants,
    state=State,
    recorded=False,
    values=_values,
    detect=detect,
    noisy=_noisy,
    ideal=_ideal,
    warnings=_warnings,
)
