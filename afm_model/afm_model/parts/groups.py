"""Parameters that every part of a family has, besides its own.

A part's own group is made from the one of its family: `class Creep(PiezoParameters): ...`.
"""

from typing import Annotated, Any

from annotated_types import Ge, Gt, Le, Lt
from pydantic import Field, model_validator

from ..core.schema import Group, NonNegative, Positive, Unit, refuse_together


class ProgramParameters(Group):
    """Reference of the scanner, and the setpoint of the tip height."""

    family = "program"

    kind: str = Field("periodic", description="program of the reference")
    z_r: Annotated[float, Unit("m")] = Field(
        1e-13, description="setpoint of the tip height z_c at the start (paper: 1e-6 z0)"
    )

    @property
    def period(self) -> float:
        """Period of x, the fast axis [s]; 0 if x does not move periodically."""
        return 0.0

    @property
    def amplitude(self) -> tuple[float, float]:
        """Amplitude along x and y [m], by which errors are judged; 0 without a motion."""
        return 0.0, 0.0

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity along x and y of a periodic reference where it is fastest [m/s]; 0 if it does not move."""
        return 0.0, 0.0


class LawParameters(Group):
    """A control law. All its parameters may change while the controller runs."""

    family = "law"

    kind: str = Field("tanh", description="control law")


class FaultParameters(Group):
    """What goes wrong between instrument and controller."""

    family = "fault"

    kind: str = Field("none", description="what goes wrong")


class PiezoParameters(Group):
    """Piezo drive: static displacement per volt, range and resolution."""

    family = "piezo"

    kind: str = Field("linear", description="the piezo ceramic")
    sensitivity_x: Annotated[float, Gt(0), Unit("m/V")] = Field(20e-9, description="static displacement per volt, x")
    sensitivity_y: Annotated[float, Gt(0), Unit("m/V")] = Field(20e-9, description="static displacement per volt, y")
    sensitivity_z: Annotated[float, Gt(0), Unit("m/V")] = Field(20e-9, description="static displacement per volt, z")
    limit: Annotated[NonNegative, Unit("V")] = Field(0.0, description="drive saturates at +-limit; 0: no limit")
    slew_limit: Annotated[NonNegative, Unit("V/s")] = Field(
        0.0, description="the drive follows no faster, in steps at the updates of the DAC; 0: at once"
    )
    dac_period: Annotated[NonNegative, Unit("s")] = Field(
        0.0,
        description="time between two updates of the drive, a multiple of detector.sample_period that divides "
        "plant.control_period: drives of a horizon are put in force at an update; 0: the control period",
    )
    dac_bits: Annotated[int, Ge(0), Lt(33)] = Field(0, description="resolution over +-limit; 0: continuous")

    @property
    def sensitivities(self) -> tuple[float, float, float]:
        """Static displacement per volt along x, y, z [m/V]."""
        return self.sensitivity_x, self.sensitivity_y, self.sensitivity_z

    @model_validator(mode="after")
    def _bits_need_a_range(self) -> "PiezoParameters":
        if self.dac_bits > 0 and self.limit == 0.0:
            raise ValueError(
                f"piezo.dac_bits = {self.dac_bits} needs a range: piezo.limit must be > 0 V, it is {self.limit:g} V"
            )
        return self


class OnboardParameters(Group):
    """What runs inside the instrument at the rate of the virtual ADC."""

    family = "onboard"

    kind: str = Field("none", description="loop inside the instrument")


class PlantParameters(Group):
    """How finely the equations of motion are integrated, and how often the controller is asked."""

    family = "plant"

    kind: str = Field("compliant", description="equations of motion")
    seed: Annotated[int, Ge(0), Le(2**63 - 1)] = Field(0, description="seed of every random number of a run")
    dt: Annotated[Positive, Unit("s")] = Field(1e-6, description="integration step")
    control_period: Annotated[Positive, Unit("s")] = Field(2e-6, description="control period, a multiple of dt")
    delay_ticks: Annotated[int, Ge(0), Le(100_000)] = Field(
        0, description="control periods from a drive command to the piezo; until the first is there the sample rests"
    )

    @property
    def substeps(self) -> int:
        """Integration steps per control period."""
        return round(self.control_period / self.dt)

    @property
    def cantilever_numbers(self) -> Any:
        """Numbers of the plant's own cantilever; None: it has none, use `cantilever.*`."""
        return None

    @property
    def scanner_numbers(self) -> Any:
        """Numbers of the plant's own scanner; None: it has none, use `scanner.*`."""
        return None

    def spring_constant(self, parameters: Any) -> float:
        """Spring constant that forces are computed with [N/m]: calibrated, or the cantilever's own; 0: not known."""
        return float(parameters.calibration.spring_constant) or self.own_spring_constant(parameters)

    def own_spring_constant(self, parameters: Any) -> float:
        """Of the cantilever of an instrument with this plant [N/m]; 0: not known."""
        return float(self.cantilever_numbers.k) if self.cantilever_numbers is not None else 0.0

    def vertical_stiffness(self, parameters: Any) -> float:
        """Vertical force over vertical motion of the tip [N/m]; 0: not known."""
        return self.spring_constant(parameters)

    def deflection_under(self, parameters: Any, force: float) -> float:
        """Deflection that is shown under a vertical force [m], where the spring constant is known."""
        return force / self.spring_constant(parameters)

    def deflection_voltage(self, parameters: Any, force: float) -> float:
        """The same [V]: what a force is, as setpoint, trigger and in force curves; docs/microscope.md."""
        if calibrated := float(parameters.calibration.deflection_sensitivity):
            return force / (self.vertical_stiffness(parameters) * calibrated)
        return self.deflection_under(parameters, force) / float(parameters.detector.deflection_sensitivity)

    def radius_of_tip(self, parameters: Any) -> float:
        """Of the tip of an instrument with this plant [m]."""
        return float(parameters.contact.R if self.cantilever_numbers is None else self.cantilever_numbers.tip_radius)


class SampleParameters(Group):
    """The sample."""

    family = "sample"

    kind: str = Field("paper", description="the sample")


class DetectorParameters(Group):
    """Photodetector and position sensors. By default they are ideal."""

    family = "detector"

    kind: str = Field("photodiode", description="the photodetector")
    sample_period: Annotated[Positive, Unit("s")] = Field(
        1e-6, description="period of the virtual ADC; a multiple of plant.dt that divides plant.control_period"
    )
    deflection_sensitivity: Annotated[float, Gt(0), Unit("m/V")] = Field(
        10e-9, description="deflection per volt (inverse optical lever sensitivity)"
    )
    lateral_sensitivity: Annotated[float, Gt(0), Unit("N/V")] = Field(50e-9, description="lateral force per volt")
    position_noise: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="rms white noise of a scanner position sample"
    )
    position_noise_density: Annotated[NonNegative, Unit("m/sqrt(Hz)")] = Field(
        0.0, description="one-sided density of the noise of the position sensors, in place of detector.position_noise"
    )
    position_bandwidth: Annotated[NonNegative, Unit("Hz")] = Field(
        0.0, description="first-order low-pass of the position sensors; 0: none"
    )
    position_bits: Annotated[int, Ge(0), Lt(33)] = Field(
        0, description="resolution of the position sensors over +-position_limit; 0: continuous"
    )
    position_limit: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="the position sensors saturate at +-position_limit; 0: no limit"
    )
    rate_bandwidth: Annotated[NonNegative, Unit("Hz")] = Field(
        20e3,
        description="first-order low-pass of velocities and deflection rate where they are differences of what sensors "
        "read, sample by sample, which they are if these are not ideal; 0: none",
    )
    channels: str = Field(
        "", description="more channels to sample, names separated by commas, such as truth/position_x"
    )

    @model_validator(mode="after")
    def _sensors_fit(self) -> "DetectorParameters":
        refuse_together(self, "detector.", "position_noise", "position_noise_density")
        if self.position_bits > 0 and self.position_limit == 0.0:
            raise ValueError(
                f"detector.position_bits = {self.position_bits} needs a range: detector.position_limit must be > 0 m, "
                f"it is {self.position_limit:g} m"
            )
        return self
