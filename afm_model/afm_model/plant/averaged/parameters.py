"""Parameters of the plant `averaged`: those of the plant `lever`, of which what it leaves out is refused."""

from typing import Annotated

from pydantic import Field

from ...core import registry
from ...core.schema import Positive, Unit
from ...parts.part import Tree
from ..lever.check import RESOLVED_SCANNER, implausible, refuse_of_other_plants, require_step
from ..lever.loss import check_losses, loss_warnings
from ..lever.parameters import LeverGroup
from .force_table import MATERIALS, materials

LEAST_Q = 100.0
"""Quality factor from which on amplitude and phase change little in a cycle."""
BAND = 0.1
"""Of a drive: how far it may be from the first resonance, over that."""
_NONE = {
    "torsion": ("static", "torsion does not move"),
    "temperature": (0.0, "there is no heat"),
    "relaxation": (0.0, "the force of the viscosity does not relax"),
    "bridge_volume": (0.0, "there is no liquid bridge"),
    "strengthening": (0.0, "there is no friction"),
    "apex_stiffness": (0.0, "there is no lattice"),
    "apex_mass": (0.0, "there is no lattice"),
    "apex_damping": (0.0, "there is no lattice"),
}
"""Of the lever's parameters those that must be as they are by default, and why."""


class AveragedGroup(LeverGroup):
    """A scanner and a cantilever that taps, averaged over the cycle: amplitude and phase are its states."""

    kind: str = Field("averaged", description="equations of motion")
    dt: Annotated[Positive, Unit("s")] = Field(2e-6, description="integration step")
    control_period: Annotated[Positive, Unit("s")] = Field(100e-6, description="control period, a multiple of dt")


def check(parameters: Tree) -> None:
    """Raise ValueError for what this plant leaves out, and where an average over the cycle does not hold."""
    plant, onboard = parameters.plant, parameters.onboard
    refuse_of_other_plants(parameters)
    check_losses(parameters)
    for name, (value, why) in _NONE.items():
        if (given := getattr(plant, name)) != value:
            raise ValueError(
                f"plant.{name} = {given} is not allowed with plant.kind = averaged, where {why}: leave it out, or take "
                f"plant.kind = lever"
            )
    c, s = plant.cantilever_numbers, plant.scanner_numbers
    if c.Q < LEAST_Q:
        raise ValueError(
            f"plant.Q = {c.Q:g} is not allowed with plant.kind = averaged: the amplitude must change little in a "
            f"cycle, take >= {LEAST_Q:g}, or plant.kind = lever"
        )
    require_step(plant.dt, max(s.f_x, s.f_y, s.f_z), RESOLVED_SCANNER, "the scanner")
    if plant.gap == 0.0:
        raise ValueError(
            "plant.gap = 0 m is not allowed with plant.kind = averaged: the tip begins off the sample, give one > 0"
        )
    if not registry.find("onboard", onboard.kind).excites:
        raise ValueError(
            f"onboard.kind = {onboard.kind} is not allowed with plant.kind = averaged: it drives no cantilever, take "
            f"onboard.kind = dynamic, or plant.kind = lever"
        )
    _check_drive(onboard, c.f0)
    pressed = getattr(onboard, "regulate", "") == "deflection"
    if pressed and (onboard.feedback == "on" or parameters.reference.kind == "verbs"):
        raise ValueError(
            "onboard.regulate = deflection is not allowed with plant.kind = averaged, which knows a tip that taps, not "
            "one that is pressed: take amplitude, or plant.kind = lever"
        )
    if not materials(parameters) or len(materials(parameters)) > MATERIALS:
        raise ValueError(
            f"sample.kind = {parameters.sample.kind} is not allowed with plant.kind = averaged: it must be of at most "
            f"{MATERIALS} materials; take plant.kind = lever"
        )


def _check_drive(onboard: Tree, f0: float) -> None:
    """Of an onboard part that says how it drives: what the average knows."""
    for name, allowed in (("drive", ("base", "tip")), ("lock_in", ("deflection",)), ("harmonic", (1,))):
        given = getattr(onboard, name, allowed[0])
        if given not in allowed:
            raise ValueError(
                f"onboard.{name} = {given} is not allowed with plant.kind = averaged, which knows bending at the "
                f"frequency of the drive: take {' or '.join(map(str, allowed))}, or plant.kind = lever"
            )
    f = getattr(onboard, "drive_frequency", 0.0) or f0
    if abs(f / f0 - 1.0) > BAND:
        raise ValueError(
            f"onboard.drive_frequency = {f:g} Hz is not allowed with plant.kind = averaged: it must be within "
            f"{BAND:.0%} of the first resonance, {f0:g} Hz"
        )


def warnings(parameters: Tree) -> list[str]:
    """What is implausible, a sentence each."""
    return implausible(parameters) + loss_warnings(parameters)
