"""What the contact of the plant `lever` loses: its viscosity, and a liquid bridge; docs/lever.md (47) to (50)."""

import math
from typing import Annotated

from pydantic import Field

from ...core.elementary import cbrt
from ...core.random_numbers import key_of
from ...core.schema import NonNegative, Positive, Unit
from ...parts.part import Numbers, Tree
from .apex import BOLTZMANN, ApexParameters, lattice_of

THERMAL_CONTACT = 1002
"""Stream of the random numbers of a run: the thermal noise of a viscous contact."""


class LossParameters(ApexParameters):
    """By which the contact takes energy besides friction."""

    viscosity: Annotated[NonNegative, Unit("Pa s")] = Field(
        0.0, description="viscosity of the contact: normal force per contact radius and rate of indentation; 0: none"
    )
    relaxation: Annotated[NonNegative, Unit("s")] = Field(
        0.0, description="time in which the force of the viscosity relaxes (standard linear solid); 0: at once"
    )
    bridge_volume: Annotated[NonNegative, Unit("m^3")] = Field(
        0.0, description="volume of the liquid bridge between tip and sample; 0: no bridge"
    )
    bridge_tension: Annotated[Positive, Unit("N/m")] = Field(
        0.072, description="surface tension of its liquid times the cosine of the contact angle"
    )
    bridge_begin: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="distance of tip and sample at which the bridge forms; 0: as they touch"
    )
    bridge_end: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="distance at which it breaks; 0: the cube root of its volume"
    )


LOSS_CONSTANTS = (
    "viscosity",  # [Pa s]
    "relaxation",  # [s]
    "viscous_noise",  # mean square thermal force in a step over force per rate [N m/s]
    "viscous_key",  # of its random numbers
    "bridge",  # 1.0 if there can be a liquid bridge
    "bridge_pull",  # its force as tip and sample touch [N]
    "bridge_spread2",  # V / (pi R) [m^2]
    "bridge_begin",  # [m]
    "bridge_end",  # [m]
)


def loss_constants(parameters: Tree, h: float) -> Numbers:
    """Values of LOSS_CONSTANTS for a step h [s]."""
    plant = parameters.plant
    R = plant.cantilever_numbers.tip_radius
    return {
        "viscosity": plant.viscosity,
        "relaxation": plant.relaxation,
        "viscous_noise": 2.0 * BOLTZMANN * plant.temperature / h,
        "viscous_key": key_of(plant.seed, THERMAL_CONTACT),
        "bridge": float(plant.bridge_volume > 0.0),
        "bridge_pull": 4.0 * math.pi * R * plant.bridge_tension,
        "bridge_spread2": plant.bridge_volume / (math.pi * R),
        "bridge_begin": plant.bridge_begin,
        "bridge_end": breaks_at(plant),
    }


def breaks_at(plant: Tree) -> float:
    """Distance at which the bridge breaks [m]: of a wetting liquid V^(1/3), Lian, Thornton, Adams (1993),
    doi:10.1006/jcis.1993.1452.
    """
    return float(plant.bridge_end or (cbrt(plant.bridge_volume) if plant.bridge_volume else 0.0))


def check_losses(parameters: Tree) -> None:
    """Raise ValueError for what is impossible, or has no effect."""
    plant = parameters.plant
    for name, of in (("relaxation", "viscosity"), ("bridge_begin", "bridge_volume"), ("bridge_end", "bridge_volume")):
        if getattr(plant, name) != 0.0 and getattr(plant, of) == 0.0:
            raise ValueError(
                f"plant.{name} = {getattr(plant, name):g} has no effect with plant.{of} = 0: leave it out, or give both"
            )
    if plant.bridge_volume > 0.0 and not breaks_at(plant) > plant.bridge_begin:
        raise ValueError(
            f"plant.bridge_begin = {plant.bridge_begin:g} m is not allowed: the bridge breaks at "
            f"{breaks_at(plant):.4g} m, and must form nearer than that"
        )
    for name in ("viscosity", "bridge_volume"):
        if getattr(plant, name) != 0.0 and lattice_of(parameters) is not None:
            raise ValueError(
                f"plant.{name} = {getattr(plant, name):g} is not allowed with sample.kind = {parameters.sample.kind}: "
                f"on a lattice the normal contact takes no energy, leave it out"
            )


def loss_warnings(parameters: Tree) -> list[str]:
    """What is implausible of the losses, a sentence each."""
    plant, told = parameters.plant, []
    for name, value, low, high, unit in (
        ("viscosity", plant.viscosity, 1e-3, 1e6, "Pa s"),
        ("bridge_volume", plant.bridge_volume, 1e-29, 1e-21, "m^3"),
        ("bridge_tension", plant.bridge_tension, 5e-3, 0.6, "N/m"),
    ):
        if value > 0.0 and not low <= value <= high:
            told.append(f"plant.{name} = {value:.3g} {unit} is implausible: usual are {low:g} to {high:g} {unit}")
    R = plant.cantilever_numbers.tip_radius
    if plant.bridge_volume > 0.25 * math.pi * R * R * R:
        told.append(
            f"plant.bridge_volume = {plant.bridge_volume:.3g} m^3 is implausible: the bridge is wider than the tip of "
            f"plant.tip_radius = {R:g} m, and its force is that of a narrow one"
        )
    return told
