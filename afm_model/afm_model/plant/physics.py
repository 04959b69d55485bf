"""Parameters of the microscope: contact, cantilever, scanner, scales. Defaults: section 4 of the paper."""

import math
from typing import Annotated, NamedTuple

from annotated_types import Ge, Lt
from pydantic import Field

from ..core.elementary import cbrt, square
from ..core.schema import Group, NonNegative, Positive, Unit


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
        return math.pi * self.tau * square(cbrt(self.R * self.pull_off_force / self.K))


class Cantilever(Group):
    """Cantilever (the paper's equation (2), docs/theory.md (20))."""

    m_c: Annotated[Positive, Unit("kg")] = Field(6e-9, description="mass")
    f_c: Annotated[Positive, Unit("Hz")] = Field(2400.0, description="resonance")
    xi_c: Annotated[float, Ge(0), Lt(1)] = Field(0.01, description="damping ratio (compliant plant)")
    a: Annotated[float, Unit("m")] = Field(0.0, description="height of the cantilever's rest position")
    W: Annotated[float, Unit("N")] = Field(0.6e-9, description="constant load pressing the tip down")


class Scanner(Group):
    """Piezo scanner with the sample on it (the paper's equation (1), docs/theory.md (19))."""

    mass_ratio: Positive = Field(
        100.0, description="mass of scanner and sample over that of the cantilever, mu = m_p / m_c"
    )
    xi_x: Annotated[float, Ge(0), Lt(1)] = Field(0.0366, description="damping ratio along x")
    xi_y: Annotated[float, Ge(0), Lt(1)] = Field(0.0293, description="damping ratio along y")
    xi_z: Annotated[float, Ge(0), Lt(1)] = Field(0.0410, description="damping ratio along z")
    f_x: Annotated[Positive, Unit("Hz")] = Field(669.07, description="resonance along x")
    f_y: Annotated[Positive, Unit("Hz")] = Field(407.07, description="resonance along y")
    f_z: Annotated[Positive, Unit("Hz")] = Field(686.13, description="resonance along z")

    @property
    def frequencies(self) -> tuple[float, float, float]:
        """Resonances along x, y, z [Hz]."""
        return self.f_x, self.f_y, self.f_z

    @property
    def damping_ratios(self) -> tuple[float, float, float]:
        """Along x, y, z."""
        return self.xi_x, self.xi_y, self.xi_z


class Scales(Group):
    """Scales of the nondimensional equations (section 2.1 of the paper).

    They are more than units: the curvature of the sample is that in scaled coordinates, docs/theory.md C12, and the
    gains of the paper's laws are numbers in these units.
    """

    w0: Annotated[Positive, Unit("rad/s")] = Field(
        1e4, description="frequency scale; 1 time unit is 1/w0. It changes what the gains of the law mean"
    )
    x0: Annotated[Positive, Unit("m")] = Field(
        2.5e-10,
        description="lateral length scale, x and y. It changes the motion: the sample's curvature is that in x0 and "
        "z0, and the gains of the law are numbers in these units",
    )
    z0: Annotated[Positive, Unit("m")] = Field(
        1e-7, description="vertical length scale; it changes the motion as x0 does"
    )


class Units(NamedTuple):
    """SI value of the units of force in the nondimensional equations, docs/theory.md (22), (23)."""

    lateral_force: float  # m_p w0^2 x0 [N]
    normal_force: float  # m_c w0^2 z0 [N]


class PlantPhysics(Group):
    """What every plant is made of."""

    contact: Contact = Contact()
    cantilever: Cantilever = Cantilever()
    scanner: Scanner = Scanner()
    scales: Scales = Scales()

    @property
    def units(self) -> Units:
        """Units of force."""
        scales = self.scales
        force = self.cantilever.m_c * square(scales.w0)
        return Units(self.scanner.mass_ratio * force * scales.x0, force * scales.z0)
