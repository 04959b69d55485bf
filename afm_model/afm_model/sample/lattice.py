"""A flat sample of atoms: a periodic potential for the place of the tip, docs/lever.md (30), (31).

V = E s(x, y) with s from 0 in a minimum to 1 on the saddle between two neighbours. The path of the tip over the atoms
may have a height, which is a potential too: the load times it.
"""

import math
from typing import Annotated, Literal

from annotated_types import Ge, Le
from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Block, Record
from ..core import registry
from ..core.elementary import cos, sin, sincos
from ..core.schema import NonNegative, Positive, Unit
from ..parts.groups import SampleParameters
from ..parts.part import Corrugation, Numbers, Sample, Tree
from ..parts.signals import Surface

LINE, SQUARE, HEXAGONAL = range(3)
LATTICES = {"line": LINE, "square": SQUARE, "hexagonal": HEXAGONAL}


class Lattice(SampleParameters):
    """Atoms in rows. The tip is in a minimum at x = y = 0."""

    kind: str = Field("lattice", description="the sample")
    lattice: Literal["line", "square", "hexagonal"] = Field(
        "square", description="minima of the potential; line: along one direction only, nothing holds the tip across it"
    )
    constant: Annotated[Positive, Unit("m")] = Field(0.4e-9, description="distance of neighbouring minima")
    barrier: Annotated[NonNegative, Unit("J")] = Field(
        0.0, description="energy from a minimum to the saddle between two neighbours; 0: from peak_force"
    )
    peak_force: Annotated[NonNegative, Unit("N")] = Field(
        0.0, description="largest lateral force of the potential along a row of minima, pi barrier / constant"
    )
    height: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="height of the tip's path, from a minimum to that saddle: the barrier grows by load times it"
    )
    angle: Annotated[float, Ge(-math.pi), Le(math.pi), Unit("rad")] = Field(
        0.0, description="of a row of neighbouring minima against x"
    )

    @property
    def energy(self) -> float:
        """Barrier at zero load [J]."""
        return self.barrier or self.peak_force * self.constant / math.pi


class Constants(Record):
    kind: int
    q: float
    cos: float
    sin: float
    energy: float
    height: Annotated[float, "m"]
    x0: Annotated[float, "m"]
    z0: Annotated[float, "m"]


def _values(parameters: Tree) -> Numbers:
    sample = parameters.sample
    return {
        "kind": LATTICES[sample.lattice],
        "q": 2.0 * math.pi / sample.constant,
        "cos": cos(sample.angle),
        "sin": sin(sample.angle),
        "energy": sample.energy,
    }


@kernel
def corrugation(kind: int, q: float, x: float, y: float) -> tuple[float, float, float, float, float, float]:
    """Shape s of the potential, 0 in a minimum and 1 on the saddle between neighbours, a row of minima along x.

    Parameters
    ----------
    kind : LINE, SQUARE or HEXAGONAL
    q : float [rad/m]
        2 pi over the lattice constant.
    x, y : floats [m]

    Returns
    -------
    (s, s_x, s_y, s_xx, s_yy, s_xy) : floats [1], [1/m], [1/m^2]
    """
    if kind == HEXAGONAL:
        # Waves along the three shortest reciprocal vectors q (1, 1/sqrt 3), q (1, -1/sqrt 3), q (0, 2/sqrt 3).
        r = q / math.sqrt(3.0)
        s1, c1 = sincos(q * x + r * y)
        s2, c2 = sincos(q * x - r * y)
        s3, c3 = sincos(2.0 * r * y)
        return (
            0.25 * (3.0 - c1 - c2 - c3),
            0.25 * q * (s1 + s2),
            0.25 * r * (s1 - s2 + 2.0 * s3),
            0.25 * q * q * (c1 + c2),
            0.25 * r * r * (c1 + c2 + 4.0 * c3),
            0.25 * q * r * (c1 - c2),
        )
    sx, cx = sincos(q * x)
    if kind == LINE:
        return 0.5 * (1.0 - cx), 0.5 * q * sx, 0.0, 0.5 * q * q * cx, 0.0, 0.0
    sy, cy = sincos(q * y)
    return 0.5 * (2.0 - cx - cy), 0.5 * q * sx, 0.5 * q * sy, 0.5 * q * q * cx, 0.5 * q * q * cy, 0.0


@kernel
def surface(x: float, y: float, h: Surface, p: Constants, unused: Block) -> None:
    """See `afm_model.parts.Sample`. `curvature` is 0: the tip touches many atoms, its contact is that on a plane."""
    x, y = x * p.x0, y * p.x0
    s, s_1, s_2, s_11, s_22, s_12 = corrugation(p.kind, p.q, p.cos * x + p.sin * y, p.cos * y - p.sin * x)
    # Back into the frame of the scanner.
    c, n = p.cos, p.sin
    s_x, s_y = c * s_1 - n * s_2, n * s_1 + c * s_2
    s_xx = c * c * s_11 - 2.0 * c * n * s_12 + n * n * s_22
    s_yy = n * n * s_11 + 2.0 * c * n * s_12 + c * c * s_22
    s_xy = c * n * (s_11 - s_22) + (c * c - n * n) * s_12
    h.potential_x, h.potential_y = p.energy * s_x, p.energy * s_y
    h.potential_xx, h.potential_yy, h.potential_xy = p.energy * s_xx, p.energy * s_yy, p.energy * s_xy
    slope = p.height * p.x0 / p.z0
    h.height = p.height / p.z0 * s
    h.slope_x, h.slope_y = slope * s_x, slope * s_y
    h.curvature = 0.0
    slope *= p.x0
    h.curvature_xx, h.curvature_yy, h.curvature_xy = slope * s_xx, slope * s_yy, slope * s_xy
    h.strength = 1.0


def _check(parameters: Tree) -> None:
    sample, plant = parameters.sample, parameters.plant
    if not registry.find("plant", plant.kind).takes_lattice:
        raise ValueError(
            f"sample.kind = lattice has no effect with plant.kind = {plant.kind}, whose friction has no atoms: use "
            f"plant.kind = lever"
        )
    if sample.barrier > 0.0 and sample.peak_force > 0.0:
        raise ValueError(
            f"sample.barrier = {sample.barrier:g} J and sample.peak_force = {sample.peak_force:g} N are not allowed "
            f"together: one follows from the other, give one of them"
        )
    if sample.energy == 0.0 and sample.height == 0.0:
        raise ValueError(
            "sample.barrier = 0 J is not allowed with sample.peak_force = 0 N and sample.height = 0 m: a lattice needs "
            "one of them, sample.kind = flat has none"
        )


def _corrugation(parameters: Tree) -> Corrugation:
    sample = parameters.sample
    q = 2.0 * math.pi / sample.constant
    return Corrugation(
        period=sample.constant,
        force=0.5 * q * sample.energy,
        stiffness=0.5 * q * q * sample.energy,
        slope=0.5 * q * sample.height,
        bend=0.5 * q * q * sample.height,
    )


LATTICE = Sample(
    name="lattice",
    parameters=Lattice,
    constants=Constants,
    values=_values,
    check=_check,
    height=lambda parameters: 0.5 * parameters.sample.height,
    lattice=_corrugation,
    surface=surface,
)
