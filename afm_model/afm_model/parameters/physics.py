"""Parameters of the microscope: contact, sample, cantilever, scanner, scales. Defaults: section 4 of the paper."""

import math
from typing import Annotated

from annotated_types import Ge, Gt, Lt
from pydantic import Field, model_validator

from .schema import Group, NonNegative, Positive, Unit


class Contact(Group):
    """Tip and contact (section 1 of the paper)."""

    tau: Annotated[Positive, Unit("Pa")] = Field(0.91e9, description="interfacial shear strength")
    K: Annotated[Positive, Unit("Pa")] = Field(44.80e9, description="reduced elastic modulus")
    gamma: Annotated[Positive, Unit("J/m^2")] = Field(
        0.404, description="surface energy of the paper's formulas; the work of adhesion is twice this"
    )
    work_of_adhesion: Annotated[NonNegative, Unit("J/m^2")] = Field(
        0.0, description="work of adhesion; 0: use 2 gamma. If given, it takes the place of gamma"
    )
    R: Annotated[Positive, Unit("m")] = Field(40e-9, description="tip radius")
    zeta_n: NonNegative = Field(0.1, description="damping ratio of the normal contact (compliant plant)")

    @property
    def surface_energy(self) -> float:
        """gamma of the paper's formulas [J/m^2]."""
        return 0.5 * self.work_of_adhesion if self.work_of_adhesion > 0.0 else self.gamma

    @property
    def pull_off_force(self) -> float:
        """|L_s| = 3 pi R gamma [N] on a flat sample, docs/theory.md (2)."""
        return 3.0 * math.pi * self.R * self.surface_energy

    @property
    def friction_at_pull_off(self) -> float:
        """F_fs = pi tau (R |L_s| / K)^(2/3) [N] on a flat sample, docs/theory.md (13)."""
        return math.pi * self.tau * (self.R * self.pull_off_force / self.K) ** (2.0 / 3.0)


class Sample(Group):
    """Test sample h = beta sin(k_x x) sin(k_y y)."""

    beta: Annotated[float, Unit("m")] = Field(12.5e-9, description="height amplitude; 0 is a flat sample")
    k_x: Annotated[NonNegative, Unit("rad/m")] = Field(2e9, description="wave number along x")
    k_y: Annotated[NonNegative, Unit("rad/m")] = Field(2e9, description="wave number along y")


class Cantilever(Group):
    """Cantilever (the paper's equation (2), docs/theory.md (20))."""

    m_c: Annotated[Positive, Unit("kg")] = Field(6e-9, description="mass")
    f_c: Annotated[Positive, Unit("Hz")] = Field(2400.0, description="resonance")
    xi_c: Annotated[float, Ge(0), Lt(1)] = Field(0.01, description="damping ratio (compliant plant)")
    a: Annotated[float, Unit("m")] = Field(0.0, description="height of the cantilever's rest position")
    W: Annotated[float, Unit("N")] = Field(0.6e-9, description="constant load pressing the tip down")


class Scanner(Group):
    """Piezo scanner with the sample on it (the paper's equation (1), docs/theory.md (19))."""

    mu: Positive = Field(100.0, description="mass ratio m_p / m_c")
    xi_x: Annotated[float, Ge(0), Lt(1)] = Field(0.0366, description="damping ratio along x")
    xi_y: Annotated[float, Ge(0), Lt(1)] = Field(0.0293, description="damping ratio along y")
    xi_z: Annotated[float, Ge(0), Lt(1)] = Field(0.0410, description="damping ratio along z")
    f_x: Annotated[Positive, Unit("Hz")] = Field(669.07, description="resonance along x")
    f_y: Annotated[Positive, Unit("Hz")] = Field(407.07, description="resonance along y")
    f_z: Annotated[Positive, Unit("Hz")] = Field(686.13, description="resonance along z")


class Scales(Group):
    """Scales of the nondimensional equations (section 2.1 of the paper)."""

    w0: Annotated[Positive, Unit("rad/s")] = Field(1e4, description="frequency scale; 1 time unit is 1/w0")
    x0: Annotated[Positive, Unit("m")] = Field(2.5e-10, description="lateral length scale, x and y")
    z0: Annotated[Positive, Unit("m")] = Field(1e-7, description="vertical length scale")


class Piezo(Group):
    """Piezo drive: static displacement per volt, range and resolution."""

    sensitivity_x: Annotated[float, Gt(0), Unit("m/V")] = Field(20e-9, description="static displacement per volt, x")
    sensitivity_y: Annotated[float, Gt(0), Unit("m/V")] = Field(20e-9, description="static displacement per volt, y")
    sensitivity_z: Annotated[float, Gt(0), Unit("m/V")] = Field(20e-9, description="static displacement per volt, z")
    limit: Annotated[NonNegative, Unit("V")] = Field(0.0, description="drive saturates at +-limit; 0: no limit")
    dac_bits: Annotated[int, Ge(0), Lt(33)] = Field(0, description="resolution over +-limit; 0: continuous")

    @model_validator(mode="after")
    def _bits_need_a_range(self) -> "Piezo":
        if self.dac_bits > 0 and self.limit == 0.0:
            raise ValueError(
                f"piezo.dac_bits = {self.dac_bits} needs a range: piezo.limit must be > 0 V, it is {self.limit:g} V"
            )
        return self


class Physics(Group):
    """Everything that fixes the equations of motion."""

    contact: Contact = Contact()
    sample: Sample = Sample()
    cantilever: Cantilever = Cantilever()
    scanner: Scanner = Scanner()
    scales: Scales = Scales()
    piezo: Piezo = Piezo()

    @property
    def curvature_ratio(self) -> float:
        """|kappa| r at the tops and bottoms of the sample [1], in coordinates scaled by x0 and z0."""
        x0, z0 = self.scales.x0, self.scales.z0
        k2 = 0.5 * ((self.sample.k_x * x0) ** 2 + (self.sample.k_y * x0) ** 2)
        return k2 * abs(self.sample.beta) / z0 * self.contact.R / z0

    @model_validator(mode="after")
    def _tip_touches_in_one_point(self) -> "Physics":
        kappa_r = self.curvature_ratio
        if kappa_r >= 1.0:
            raise ValueError(
                f"the tip cannot touch the sample in one point: 1 + kappa r = {1.0 - kappa_r:.4g} at the bottom of the "
                f"valleys and must be > 0 (contact.R = {self.contact.R:g} m, sample.beta = {self.sample.beta:g} m, "
                f"sample.k_x = {self.sample.k_x:g} rad/m, sample.k_y = {self.sample.k_y:g} rad/m): "
                f"take a sharper tip or a smoother sample"
            )
        return self
