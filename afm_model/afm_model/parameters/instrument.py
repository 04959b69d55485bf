"""Parameters of the virtual instrument: plant, time steps, reference to track, detector, score."""

import math
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Lt
from pydantic import Field, model_validator

from .physics import Physics
from .schema import Group, NonNegative, Positive, Unit

Shape = Literal["sine", "triangle", "constant"]


class Plant(Group):
    """Which equations of motion are integrated, and how finely."""

    kind: Literal["compliant", "paper"] = Field(
        "compliant", description="compliant: eight states, contact can be lost; paper: six states of the paper's (5)"
    )
    z: Literal["computed", "held", "uniform"] = Field(
        "computed",
        description="paper plant only: f_z computed; z held at the setpoint (4.1); f_z drawn in +-M_z (4.2)",
    )
    M_z: NonNegative = Field(0.05, description="bound of the drawn f_z [w0^2 z0], paper plant with z = uniform")
    seed: Annotated[int, Ge(0)] = Field(0, description="seed of every random number of a run")
    dt: Annotated[Positive, Unit("s")] = Field(1e-6, description="integration step")
    control_period: Annotated[Positive, Unit("s")] = Field(2e-6, description="control period, a multiple of dt")
    delay_ticks: Annotated[int, Ge(0), Le(100_000)] = Field(
        0, description="control periods from a drive command to the piezo; until the first is there the sample rests"
    )

    @property
    def substeps(self) -> int:
        """Integration steps per control period."""
        return round(self.control_period / self.dt)


class Reference(Group):
    """Reference trajectory of the scanner, and the setpoint of the tip height."""

    shape_x: Shape = Field("sine", description="waveform along x")
    shape_y: Shape = Field("sine", description="waveform along y")
    amplitude_x: Annotated[float, Unit("m")] = Field(5e-9, description="amplitude along x (paper: 20 x0)")
    amplitude_y: Annotated[float, Unit("m")] = Field(5e-9, description="amplitude along y (paper: 20 y0)")
    omega_x: Annotated[NonNegative, Unit("rad/s")] = Field(50.0, description="angular frequency along x")
    omega_y: Annotated[NonNegative, Unit("rad/s")] = Field(50.0, description="angular frequency along y")
    z_r: Annotated[float, Unit("m")] = Field(1e-13, description="setpoint of the tip height z_c (paper: 1e-6 z0)")

    @property
    def period(self) -> float:
        """Period of x, the fast axis [s]; 0 if x does not move periodically."""
        if self.shape_x == "constant" or self.omega_x == 0.0:
            return 0.0
        return 2.0 * math.pi / self.omega_x


class Detector(Group):
    """Photodetector and position sensors. Noise and resolution are off by default."""

    sample_period: Annotated[Positive, Unit("s")] = Field(
        1e-6, description="period of the virtual ADC; a multiple of plant.dt that divides plant.control_period"
    )
    deflection_sensitivity: Annotated[float, Gt(0), Unit("m/V")] = Field(
        10e-9, description="deflection per volt (inverse optical lever sensitivity)"
    )
    lateral_sensitivity: Annotated[float, Gt(0), Unit("N/V")] = Field(50e-9, description="lateral force per volt")
    noise: Annotated[NonNegative, Unit("V")] = Field(
        0.0, description="rms white noise of a photodetector sample; the deflection rate has none"
    )
    adc_bits: Annotated[int, Ge(0), Lt(33)] = Field(0, description="resolution over +-adc_limit; 0: continuous")
    adc_limit: Annotated[Positive, Unit("V")] = Field(
        10.0, description="with adc_bits > 0 the ADC saturates at +-adc_limit"
    )
    position_noise: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="rms white noise of a scanner position sample; the velocity has none"
    )


class Score(Group):
    """What part of a run is scored."""

    start: Annotated[float, Unit("s")] = Field(
        -1.0, description="time from which the run is scored; negative: after the first half period of the reference"
    )


class InstrumentParameters(Physics):
    """All parameters of the virtual instrument."""

    plant: Plant = Plant()
    reference: Reference = Reference()
    detector: Detector = Detector()
    score: Score = Score()

    @property
    def score_start(self) -> float:
        """Time from which the run is scored [s]."""
        return self.score.start if self.score.start >= 0.0 else 0.5 * self.reference.period

    @model_validator(mode="after")
    def _periods_fit(self) -> "InstrumentParameters":
        period = self.detector.sample_period
        _require_multiple("detector.sample_period", period, "plant.dt", self.plant.dt)
        _require_multiple("plant.control_period", self.plant.control_period, "detector.sample_period", period)
        return self

    @property
    def static_load(self) -> float:
        """Load on the tip at rest at the setpoint [N]; negative: the cantilever pulls."""
        cantilever = self.cantilever
        stiffness = cantilever.m_c * (2.0 * math.pi * cantilever.f_c) ** 2
        return stiffness * (self.reference.z_r - cantilever.a) + cantilever.W

    @model_validator(mode="after")
    def _tip_touches_at_rest(self) -> "InstrumentParameters":
        limit = -self.contact.pull_off_force
        if self.static_load <= limit:
            raise ValueError(
                f"the tip does not touch the sample at rest: the static load is {self.static_load:.4g} N and must be > "
                f"{limit:.4g} N, the pull-off load (reference.z_r = {self.reference.z_r:g} m, cantilever.a = "
                f"{self.cantilever.a:g} m, cantilever.W = {self.cantilever.W:g} N): lower a or raise the others"
            )
        return self

    @model_validator(mode="after")
    def _step_resolves_the_contact(self) -> "InstrumentParameters":
        limit = stable_step(self)
        if self.plant.dt > limit:
            raise ValueError(
                f"plant.dt = {self.plant.dt:g} s is not allowed: it must be <= {limit:.3g} s, where the explicit step "
                f"still resolves the fastest resonance of scanner, cantilever and contact"
            )
        return self


def stable_step(parameters: InstrumentParameters) -> float:
    """Largest stable step [s]: 2 / omega of the fastest resonance of the scanner and, compliant, of the contact.

    That of the contact, docs/theory.md (42), is taken at the static load of the setpoint (zero load if it pulls), where
    the sample makes the contact stiffest. A run that presses much harder than at rest needs a smaller step.
    """
    scanner, cantilever = parameters.scanner, parameters.cantilever
    if parameters.plant.kind == "paper":
        # It has no contact spring: tip and sample move as one mass, on both springs.
        vertical = 2.0 * math.pi * math.hypot(scanner.f_z, cantilever.f_c / math.sqrt(scanner.mu))
    else:
        # The sum bounds the larger eigenvalue of sample and tip from above.
        mass = cantilever.m_c / (1.0 + 1.0 / scanner.mu)
        alone = 2.0 * math.pi * max(cantilever.f_c, scanner.f_z)
        vertical = math.sqrt(_stiffest_contact(parameters) / mass + alone**2)
    return 2.0 / max(vertical, 2.0 * math.pi * max(scanner.f_x, scanner.f_y))


def _stiffest_contact(parameters: InstrumentParameters) -> float:
    """Contact stiffness [N/m] under the static load of the setpoint, where the sample makes it largest."""
    contact, sample = parameters.contact, parameters.sample
    u3 = 0.5 * (1.0 + math.sqrt(1.0 + max(parameters.static_load, 0.0) / contact.pull_off_force))
    # contact.jkr.stiffness_of_u, in plain Python: reading parameters compiles nothing.
    stiffness_of_u = 18.0 * u3 ** (2.0 / 3.0) * (2.0 * u3 - 1.0) / (6.0 * u3 - 1.0)
    a0_squared = (12.0 * math.pi * contact.R**2 * contact.surface_energy / contact.K) ** (2.0 / 3.0)
    rho = 1.0 / (1.0 - parameters.curvature_ratio) if sample.beta != 0.0 else 1.0
    return stiffness_of_u * contact.pull_off_force * contact.R / a0_squared * rho ** (2.0 / 3.0)


def _require_multiple(name: str, value: float, of_name: str, of: float) -> None:
    ratio = value / of
    if round(ratio) < 1 or abs(ratio - round(ratio)) > 1e-6 * ratio:
        raise ValueError(f"{name} = {value:g} s is not allowed: it must be a multiple of {of_name} = {of:g} s")
