"""The tip's apex on a sample of atoms, plant `lever`: parameters, constants, state; docs/lever.md (32) to (36).

The place that the tip holds on to is then one in the potential of the sample. It has a separate mass and damping, or
it has none and slips immediately.
"""

import math
from typing import Annotated

from pydantic import Field

from ...core import registry
from ...core.elementary import square
from ...core.errors import ParameterError
from ...core.random_numbers import key_of
from ...core.schema import NonNegative, Unit
from ...parts.groups import PlantParameters
from ...parts.part import Corrugation, Numbers, Tree

BOLTZMANN = 1.380649e-23
"""[J/K]."""
ELECTRONVOLT = 1.602176634e-19
"""[J]"""
RESOLVED = 0.5
"""Angle [rad] by which the apex may turn in a step, in the steepest minimum."""
THERMAL_APEX = 1001
"""Stream of the random numbers of a run: the thermal noise of the apex."""


class ApexParameters(PlantParameters):
    """What counts on a sample of atoms alone."""

    apex_stiffness: Annotated[NonNegative, Unit("N/m")] = Field(
        0.0,
        description="lateral stiffness of the tip's apex on a lattice, in series with that of the contact; 0: rigid",
    )
    apex_mass: Annotated[NonNegative, Unit("kg")] = Field(
        0.0, description="mass that slips on a lattice; 0: none, the tip slips at once into the next minimum"
    )
    apex_damping: Annotated[NonNegative, Unit("1/s")] = Field(
        0.0, description="damping of that mass against the lattice: force over momentum"
    )


APEX_CONSTANTS = (
    "lattice",  # 1.0 on a sample of atoms
    "lattice_period",  # [m]
    "lattice_force",  # largest force of the potential along a row of minima [N]
    "lattice_slope",  # and how much more per load [1]
    "apex_compliance",  # of the tip's apex [m/N]
    "apex_hold",  # of its inertia and damping at mid-step: force per way from the start of the step [N/m]
    "apex_carry",  # and per rate there [N s/m]
    "apex_noise",  # rms thermal force in a step [N]
    "apex_key",  # of its random numbers
)
_OF_LATTICES = ("apex_stiffness", "apex_mass", "apex_damping")


def lattice_of(parameters: Tree) -> Corrugation | None:
    """Of the sample, if it is one of atoms."""
    make = registry.find("sample", parameters.sample.kind).lattice
    return None if make is None else make(parameters)


def apex_constants(parameters: Tree, h: float) -> Numbers:
    """Values of APEX_CONSTANTS for a step h [s]."""
    found = lattice_of(parameters)
    if found is None:
        return dict.fromkeys(APEX_CONSTANTS, 0.0)
    plant = parameters.plant
    mass, damping = plant.apex_mass, plant.apex_damping
    return {
        "lattice": 1.0,
        "lattice_period": found.period,
        "lattice_force": found.force,
        "lattice_slope": found.slope,
        "apex_compliance": 1.0 / plant.apex_stiffness if plant.apex_stiffness else 0.0,
        "apex_hold": mass * (4.0 / square(h) + 2.0 * damping / h),
        "apex_carry": 2.0 * mass / h,
        "apex_noise": math.sqrt(2.0 * mass * damping * BOLTZMANN * plant.temperature / h),
        "apex_key": key_of(plant.seed, THERMAL_APEX),
    }


def check_apex(parameters: Tree) -> None:
    """Raise ValueError for what is impossible on a lattice, or has no effect."""
    plant = parameters.plant
    if lattice_of(parameters) is None:
        for name in _OF_LATTICES:
            if getattr(plant, name) != 0.0:
                raise ValueError(
                    f"plant.{name} = {getattr(plant, name):g} has no effect with sample.kind = "
                    f"{parameters.sample.kind}: it counts on a lattice alone, leave it out"
                )
        return
    for name in ("tau", "strengthening"):
        if getattr(plant, name) != 0.0:
            raise ValueError(
                f"plant.{name} = {getattr(plant, name):g} has no effect with sample.kind = {parameters.sample.kind}, "
                f"whose friction is that of a potential: leave it out"
            )
    if plant.apex_mass == 0.0 and plant.apex_damping > 0.0:
        raise ValueError(
            f"plant.apex_damping = {plant.apex_damping:g} 1/s is not allowed with plant.apex_mass = 0 kg: what has no "
            f"mass slips at once; give plant.apex_mass > 0 as well"
        )


def require_resolved_apex(parameters: Tree, give: float, load: float) -> None:
    """Raise ParameterError if a step is too long for the apex: asked when an instrument is made.

    Parameters
    ----------
    parameters : InstrumentParameters
    give : float [m/N]
        Lateral compliance of contact and apex.
    load : float [N]
    """
    plant, found = parameters.plant, lattice_of(parameters)
    if found is None or plant.apex_mass == 0.0:
        return
    steepest = (1.0 / give if give > 0.0 else 0.0) + found.stiffness + max(load, 0.0) * found.bend
    most = RESOLVED / math.sqrt(steepest / plant.apex_mass)
    if plant.dt > most:
        raise ParameterError(
            f"plant.dt = {plant.dt:g} s is not allowed: it is too long for the tip's apex of plant.apex_mass = "
            f"{plant.apex_mass:g} kg; take plant.dt <= {most:.3g} s or plant.apex_mass = 0"
        )


def apex_warnings(parameters: Tree) -> list[str]:
    """What is implausible of lattice and apex, a sentence each."""
    found, plant = lattice_of(parameters), parameters.plant
    if found is None:
        return []
    barrier, height = (part * found.period / math.pi for part in (found.force, found.slope))
    told = []
    for name, value, low, high, unit in (
        ("the distance of the minima of the lattice", found.period, 1e-10, 5e-9, "m"),
        ("the barrier of the lattice", barrier / ELECTRONVOLT, 1e-3, 10.0, "eV"),
        ("the height of the lattice", height, 1e-13, 1e-10, "m"),
        ("plant.apex_stiffness", plant.apex_stiffness, 0.1, 1e3, "N/m"),
        ("plant.apex_mass", plant.apex_mass, 1e-18, 1e-9, "kg"),
    ):
        if value > 0.0 and not low <= value <= high:
            told.append(f"{name} = {value:.3g} {unit} is implausible: usual are {low:g} to {high:g} {unit}")
    if 0.0 < barrier < BOLTZMANN * plant.temperature:
        told.append(
            f"the barrier of the lattice, {barrier / ELECTRONVOLT:.3g} eV, is below k_B T at plant.temperature = "
            f"{plant.temperature:g} K: the tip will not stick"
        )
    return told
