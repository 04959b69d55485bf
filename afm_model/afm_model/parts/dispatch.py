"""How compiled code reaches the parts: each function of a family, called by its address in the header of a block.

The compiled loop knows no part, so that it and its cache are the same whatever parts are chosen. What that costs a step
is in docs/architecture.md.
"""

from collections.abc import Callable
from typing import Any

from ..compiled.calls import Argument, by_address
from ..compiled.jit import kernel
from ..compiled.records import Block, place, record_at
from ..compiled.ways import by_lane
from .header import BlockHeader, LawHeader
from .onboard import Onboard
from .part import CONSTANTS, MAP, STATE, WHOLE, Detector, Fault, Law, Part, Piezo, Plant, Program, Sample
from .signals import Displacement, Surface


def dispatcher(family: type[Part], name: str) -> Callable[..., None]:
    """What calls the function `name` of the part of a family that a block holds.

    Called with the arguments of that function but those of the part (its constants, state, map), then the block. A
    part without this function is left alone.
    """
    kinds = family.functions[name]
    header = LawHeader if family is Law else BlockHeader
    places: dict[Argument, int | None] = {WHOLE: None}
    places |= {kind: place(header, f"{family.family}_{kind}") for kind in (CONSTANTS, STATE, MAP) if kind in kinds}
    return by_address(f"{name} of a {family.family}", kinds, place(header, f"{family.family}_{name}"), places)


reference, watch = dispatcher(Program, "reference"), dispatcher(Program, "watch")
control = dispatcher(Law, "control")
on_sample, on_command = dispatcher(Fault, "on_sample"), dispatcher(Fault, "on_command")
on_drive, on_measurement = dispatcher(Fault, "on_drive"), dispatcher(Fault, "on_measurement")
actuate = dispatcher(Piezo, "actuate")
regulate = dispatcher(Onboard, "regulate")
step, observe = dispatcher(Plant, "step"), dispatcher(Plant, "observe")
detect = dispatcher(Detector, "detect")
_surface = dispatcher(Sample, "surface")


@kernel
def _surface_alone(x: float, y: float, m: Block) -> Any:
    g = record_at(m, 0, BlockHeader)
    h = record_at(m, g.surface, Surface)
    h.adhesion = h.modulus = h.viscosity = h.tension = 1.0
    d = record_at(m, g.displacement, Displacement)
    if d.there != 0:
        x -= d.x
        y -= d.y
    _surface(x, y, h, m)
    if d.there != 0:
        h.strength *= d.friction
        h.height += d.z
    return h


@kernel
def _surface_in_lane(x: float, y: float, m: Any) -> Any:
    h = m.surface
    h.adhesion = h.modulus = h.viscosity = h.tension = 1.0
    m.sample_surface(x, y, h, m.sample, m)
    return h


_surface_of = by_lane(_surface_alone, _surface_in_lane)


@kernel
def surface(x: float, y: float, m: Block) -> Any:
    """The sample of the block m at (x, y) [x0], as a record of Surface that the next call writes over."""
    return _surface_of(x, y, m)
