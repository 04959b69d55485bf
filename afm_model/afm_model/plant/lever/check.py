"""Which parameters the plant `lever` can be made of, and which are implausible; docs/lever.md (8), (15)."""

import math

from ...cantilever import beam
from ...core import registry
from ...core.elementary import square
from ...core.errors import ParameterError
from ...core.schema import flatten
from ...parts.part import Tree
from ..physics import Cantilever, Contact, Scanner
from .apex import apex_warnings, check_apex
from .constants import sample_curvature
from .loss import check_losses, loss_warnings

RESOLVED = (0.75, 1.5, 1.5)
"""Angle [rad] by which the fastest mode of bending may turn in a step, with 1, 2, 3 of them; docs/lever.md section 3.

One mode alone rings in contact at 6.7 f0, so that it needs shorter steps for what it can show.
"""
RESOLVED_TORSION = 1.5
"""The same for torsion that moves."""
RESOLVED_SCANNER = 0.5
"""The same for a resonance of the scanner."""
_CONTACT_RESONANCE = 5.2
"""First contact resonance over f0, docs/lever.md section 1."""
_EDGE_TIME = 4.0
"""How many times its radius an edge may be passed in a period of that: from there on the tip is seen to jump off."""


def check(parameters: Tree) -> None:
    """Raise ValueError for what is impossible."""
    plant = parameters.plant
    refuse_of_other_plants(parameters)
    check_apex(parameters)
    check_losses(parameters)
    c, s = plant.cantilever_numbers, plant.scanner_numbers
    if c.thickness >= c.width or c.width >= c.length:
        raise ValueError(
            f"plant.thickness = {c.thickness:g} m, plant.width = {c.width:g} m, plant.length = {c.length:g} m are not "
            f"allowed: a cantilever is longer than wide and wider than thick"
        )
    modes = plant.modes
    frequency = c.f0 * beam.MODE[modes - 1].frequency
    require_step(
        plant.dt,
        frequency,
        RESOLVED[modes - 1],
        f"bending mode {modes} of the cantilever",
        " or fewer plant.modes" * (modes > 1),
    )
    if plant.torsion == "moving":
        require_step(
            plant.dt, c.f_torsion, RESOLVED_TORSION, "the torsion of the cantilever", " or plant.torsion = static"
        )
    require_step(plant.dt, max(s.f_x, s.f_y, s.f_z), RESOLVED_SCANNER, "the scanner")


def require_step(dt: float, frequency: float, phase: float, what: str, otherwise: str = "") -> None:
    """Raise ValueError if a step [s] is more than this part [rad] of a period of a resonance [Hz]."""
    most = phase / (2.0 * math.pi * frequency)
    if dt > most:
        raise ValueError(
            f"plant.dt = {dt:g} s is not allowed: it is too long for {what}, whose resonance is at {frequency:.4g} Hz; "
            f"take plant.dt <= {most:.3g} s{otherwise}"
        )


def require_blunt_sample(parameters: Tree) -> None:
    """Raise ParameterError if the sample is sharper than the tip: asked when an instrument is made.

    A sample that declares its contrast has checked that itself, with the place.
    """
    bend = sample_curvature(parameters) * parameters.plant.cantilever_numbers.tip_radius
    if bend >= 1.0 and registry.find("sample", parameters.sample.kind).contrast is None:
        R = parameters.plant.cantilever_numbers.tip_radius
        raise ParameterError(
            f"sample.kind = {parameters.sample.kind} is sharper than the tip: its radius of curvature is down to "
            f"{R / bend:.3g} m and must be > plant.tip_radius = {R:g} m: take a sharper tip or a smoother sample, "
            f"such as sample.kind = flat"
        )


def refuse_of_other_plants(parameters: Tree) -> None:
    """Parameters that would have no effect are no silent ones."""
    for name, group, given in (
        ("cantilever", Cantilever(), parameters.cantilever),
        ("scanner", Scanner(), parameters.scanner),
        ("contact", Contact(), parameters.contact),
    ):
        usual = flatten(group)
        for leaf, value in flatten(given).items():
            if value != usual[leaf] and (name, leaf) != ("cantilever", "a"):
                raise ValueError(
                    f"{name}.{leaf} = {value} has no effect with plant.kind = {parameters.plant.kind}, which takes "
                    f"cantilever, scanner and contact from plant.*: leave it out"
                )


_PLAUSIBLE = {
    "plant.k": ("N/m", 0.005, 100.0, "cantilevers have"),
    "plant.f0": ("Hz", 1e3, 5e6, "cantilevers have"),
    "plant.Q": ("", 1.0, 1e6, "cantilevers have"),
    "plant.f_torsion": ("Hz", 1e3, 1e7, "cantilevers have"),
    "plant.tip_radius": ("m", 1e-9, 1e-5, "tips have"),
    "plant.work_of_adhesion": ("J/m^2", 1e-3, 2.0, "surfaces have"),
    "plant.tau": ("Pa", 1e5, 5e9, "contacts have"),
    "plant.K": ("Pa", 1e6, 2e12, "materials have"),
    "plant.hamaker": ("J", 1e-21, 1e-18, "materials have"),
    "plant.range": ("m", 1e-10, 1e-8, "surfaces have"),
}
"""What is usual."""


def warnings(parameters: Tree) -> list[str]:
    """What is implausible, a sentence each."""
    others = _jumps_off(parameters) + apex_warnings(parameters) + loss_warnings(parameters)
    return implausible(parameters) + others


def implausible(parameters: Tree) -> list[str]:
    """Of cantilever, scanner and materials."""
    plant = parameters.plant
    values = plant.cantilever_numbers._asdict() | plant.pair_numbers._asdict()
    found = []
    for name, (unit, low, high, who) in _PLAUSIBLE.items():
        value = values[name.removeprefix("plant.")]
        if not low <= value <= high:
            found.append(f"{name} = {value:g} {unit} is implausible: {who} {low:g} to {high:g} {unit}".rstrip())
    if plant.temperature > 0.0 and not 100.0 <= plant.temperature <= 1000.0:
        found.append(f"plant.temperature = {plant.temperature:g} K is implausible: a room has 295 K")
    c, s = plant.cantilever_numbers, plant.scanner_numbers
    density = beam.mass(c.k, c.f0) / (c.length * c.width * c.thickness)
    if not 700.0 <= density <= 12000.0:
        found.append(
            f"plant.k = {c.k:g} N/m, plant.f0 = {c.f0:g} Hz and the dimensions of the cantilever do not go together: "
            f"they make its density {density:.3g} kg/m^3"
        )
    for axis in "xyz":
        k, f = getattr(s, f"k_{axis}"), getattr(s, f"f_{axis}")
        if k < 1e4:
            found.append(f"plant.k_{axis} = {k:g} N/m is implausible: scanners have 1e5 to 1e8 N/m")
        moved = k / square(2.0 * math.pi * f)
        if not 1e-5 <= moved <= 10.0:
            found.append(
                f"plant.k_{axis} = {k:g} N/m and plant.f_{axis} = {f:g} Hz make the moving mass {moved:.3g} kg: "
                f"scanners move 1e-4 to 1 kg"
            )
    return found


def _jumps_off(parameters: Tree) -> list[str]:
    """Of edges that are passed faster than the contact can follow; of samples in closed form with a known speed."""
    part = registry.find("sample", parameters.sample.kind)
    if part.contrast is not None or part.lattice is not None:
        return []
    speed = getattr(parameters.reference, "top_speed", 0.0)
    curvature = 2.0 * sample_curvature(parameters)
    slowest = _CONTACT_RESONANCE * parameters.plant.cantilever_numbers.f0 / _EDGE_TIME
    if speed * curvature <= slowest:
        return []
    return [
        f"the reference moves at up to {speed:.3g} m/s over edges with a radius of {1.0 / curvature:.3g} m: from some "
        f"{slowest / curvature:.2g} m/s on the tip jumps off them, and how high depends on plant.dt = "
        f"{parameters.plant.dt:g} s: compare with a run at half of it"
    ]
