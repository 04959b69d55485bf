"""All parameters of the virtual instrument: the microscope, its parts, what is scored."""

from typing import Annotated

from pydantic import Field, model_validator

from ..core import registry
from ..core.schema import Group, Unit, flatten, specifications
from ..detector import Photodiode
from ..fault import Schedule
from ..onboard import OnboardParameters
from ..parts.timing import ticks_of
from ..piezo import PiezoParameters
from ..plant import PlantGroup
from ..plant.physics import Microscope
from ..program import Reference
from ..sample import PaperSample
from .drift import Drift

MAX_STEPS = 10_000_000
"""Integration steps in a control tick at most: a second or two of computing, in which nothing else is done."""
MAX_SAMPLES = 100_000
"""Samples in a control tick at most. With noise on they take 10 kB of random numbers each."""


class Score(Group):
    """What part of a run is scored."""

    start: Annotated[float, Unit("s")] = Field(
        -1.0, description="time from which the run is scored; negative: after the first half period of the reference"
    )


class InstrumentParameters(Microscope):
    """All parameters of the virtual instrument."""

    sample: PaperSample = PaperSample()
    piezo: PiezoParameters = PiezoParameters()
    plant: PlantGroup = PlantGroup()
    reference: Reference = Reference()
    detector: Photodiode = Photodiode()
    onboard: OnboardParameters = OnboardParameters()
    fault: Schedule = Schedule()
    drift: Drift = Drift()
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
