"""All parameters of the virtual instrument, and of a controller: the law, and what it believes of the microscope."""

from typing import Annotated

from annotated_types import Ge, Le
from pydantic import Field, model_validator

from ..core import registry
from ..core.schema import Group, NonNegative, Positive, Unit, flatten, specifications
from ..detector import Photodiode
from ..fault import Schedule
from ..law import PaperLaw
from ..onboard import OnboardParameters
from ..parts.ticks import ticks_of
from ..piezo import PiezoParameters
from ..plant import PlantGroup
from ..plant.physics import Cantilever, Contact, PlantPhysics, Scales, Scanner
from ..program import Reference
from ..sample import PaperSample

_FASTEST = 1e-6
"""Of a drift [m/s]: a hundred times what is plausible."""
_Rate = Annotated[float, Ge(-_FASTEST), Le(_FASTEST), Unit("m/s")]


class Drift(Group):
    """Thermal drift of the sample against the holder of the tip, which no position sensor sees. By default off."""

    rate_x: _Rate = Field(0.0, description="velocity of the sample along x at the start")
    rate_y: _Rate = Field(0.0, description="velocity of the sample along y at the start")
    rate_z: _Rate = Field(0.0, description="velocity of the sample along z at the start, positive towards the tip")
    decay_time: Annotated[NonNegative, Unit("s")] = Field(
        0.0, description="these velocities fall by exp(-t / decay_time), as after warming up; 0: they stay"
    )
    wander: Annotated[float, Ge(0.0), Le(_FASTEST), Unit("m/s")] = Field(
        0.0, description="rms of a random part of the velocity, along each axis by itself"
    )
    wander_time: Annotated[Positive, Unit("s")] = Field(60.0, description="correlation time of the random part")

    @property
    def on(self) -> bool:
        """Whether anything drifts."""
        return any((self.rate_x, self.rate_y, self.rate_z, self.wander))

    def warnings(self) -> list[str]:
        """What is implausible, a sentence each."""
        given = {name: getattr(self, name) for name in ("rate_x", "rate_y", "rate_z", "wander")}
        return [
            f"drift.{name} = {value:g} m/s is implausible: microscopes drift by 1e-12 to 1e-9 m/s"
            for name, value in given.items()
            if abs(value) > 1e-8
        ]


class Calibrations(Group):
    """What the microscope believes of its cantilever and detector; 0: what their own parameters say.

    Verbs compute forces with it: setpoints, triggers, curves, images and their notes (docs/verbs.md). The plant keeps
    its own numbers.
    """

    spring_constant: Annotated[NonNegative, Unit("N/m")] = Field(
        0.0, description="believed of the cantilever, for a force across it; 0: its own"
    )
    deflection_sensitivity: Annotated[NonNegative, Unit("m/V")] = Field(
        0.0, description="believed, for vertical motion of the tip; 0: from detector.deflection_sensitivity"
    )
    lateral_sensitivity: Annotated[NonNegative, Unit("N/V")] = Field(
        0.0, description="believed; 0: detector.lateral_sensitivity"
    )


MAX_STEPS = 10_000_000
"""Integration steps in a control tick at most: a second or two of computing, in which nothing else is done."""
MAX_SAMPLES = 100_000
"""Samples in a control tick at most. With noise on they take 10 kB of random numbers each."""


class Score(Group):
    """What part of a run is scored."""

    start: Annotated[float, Unit("s")] = Field(
        -1.0, description="time from which the run is scored; negative: after the first half period of the reference"
    )


class InstrumentParameters(PlantPhysics):
    """All parameters of the virtual instrument."""

    sample: PaperSample = PaperSample()
    piezo: PiezoParameters = PiezoParameters()
    plant: PlantGroup = PlantGroup()
    reference: Reference = Reference()
    detector: Photodiode = Photodiode()
    onboard: OnboardParameters = OnboardParameters()
    fault: Schedule = Schedule()
    drift: Drift = Drift()
    calibration: Calibrations = Calibrations()
    score: Score = Score()

    @property
    def score_start(self) -> float:
        """Time from which the run is scored [s]."""
        return self.score.start if self.score.start >= 0.0 else 0.5 * self.reference.period

    @property
    def score_tick(self) -> int:
        """First control tick that is scored."""
        return ticks_of(self.score_start, self.plant.control_period)

    @model_validator(mode="after")
    def _tip_touches_in_one_point(self) -> "InstrumentParameters":
        if registry.find("plant", self.plant.kind).sample_in_si:
            return self
        curvature = registry.find("sample", self.sample.kind).curvature(self)
        kappa_r = curvature * self.contact.R / self.scales.z0
        if kappa_r >= 1.0:
            units = {spec.name: spec.unit for spec in specifications(type(self.sample))}
            given = ", ".join(
                f"sample.{name} = {value:g} {units[name]}"
                for name, value in flatten(self.sample).items()
                if isinstance(value, float)
            )
            raise ValueError(
                f"the tip cannot touch the sample in one point: 1 + kappa r = {1.0 - kappa_r:.4g} at the bottom of the "
                f"valleys and must be > 0 (contact.R = {self.contact.R:g} m, {given}): "
                f"take a sharper tip or a smoother sample"
            )
        return self

    @model_validator(mode="after")
    def _periods_fit(self) -> "InstrumentParameters":
        period = self.detector.sample_period
        _require_multiple("detector.sample_period", period, "plant.dt", self.plant.dt)
        _require_multiple("plant.control_period", self.plant.control_period, "detector.sample_period", period)
        if dac_period := self.piezo.dac_period:
            _require_multiple("piezo.dac_period", dac_period, "detector.sample_period", period)
            _require_multiple("plant.control_period", self.plant.control_period, "piezo.dac_period", dac_period)
        _require_few("integration steps", MAX_STEPS, self.plant.control_period, "plant.dt", self.plant.dt)
        _require_few("samples", MAX_SAMPLES, self.plant.control_period, "detector.sample_period", period)
        return self

    @model_validator(mode="after")
    def _parts_allow(self) -> "InstrumentParameters":
        for name in InstrumentParameters.model_fields:
            group = getattr(self, name)
            if group.family:
                registry.find(group.family, group.kind).check(self)
        return self


def _require_multiple(name: str, value: float, of_name: str, of: float) -> None:
    ratio = value / of
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6 * ratio:
        raise ValueError(f"{name} = {value:g} s is not allowed: it must be a multiple of {of_name} = {of:g} s")


def _require_few(what: str, most: int, control_period: float, of_name: str, of: float) -> None:
    ratio = control_period / of
    if ratio > most:
        raise ValueError(
            f"{of_name} = {of:g} s is not allowed with plant.control_period = {control_period:g} s: a control tick "
            f"would have {ratio:.3g} {what}, and {most} are the most"
        )


class ControllerParameters(Group):
    """The law and what the controller believes of the microscope."""

    law: PaperLaw = PaperLaw()
    scanner: Scanner = Scanner()
    cantilever: Cantilever = Cantilever()
    scales: Scales = Scales()
    piezo: PiezoParameters = PiezoParameters()
    contact: Contact = Contact()
    sample: PaperSample = PaperSample()

    @model_validator(mode="after")
    def _law_allows(self) -> "ControllerParameters":
        registry.find("law", self.law.kind).check(self)
        return self
