"""What the sampled laws share: control period and delay they are made for, time constants by rule, the loop along z.

Along z the sample follows what the tip rides on: docs/laws.md (2.1).
"""

import math
import warnings
from collections.abc import Sequence
from typing import Annotated, Any

from annotated_types import Ge, Le
from pydantic import Field

from ..compiled.jit import kernel
from ..core.elementary import exp, square
from ..core.errors import ParameterError
from ..core.registry import find, shipped
from ..core.schema import NonNegative, Positive, Unit
from ..parts.groups import LawParameters, PlantParameters
from ..parts.part import RIGID, SPRING, Tree
from ..parts.signals import Measurement, PiezoDrive
from . import scanner
from .scanner import (
    HeldAxis,
    ScannerConstants,
    ScannerState,
    drive_between,
    free_axes,
    place_poles,
    position,
    predict,
    send,
)


class SampledLaw(LawParameters):
    """A law made for one control period and one delay. A scenario that leaves them out means those of its plant."""

    period: Annotated[Positive, Unit("s")] = Field(
        2e-6, description="control period that the law is made for; left out in a scenario: plant.control_period"
    )
    delay_ticks: Annotated[int, Ge(0), Le(100_000)] = Field(
        0, description="delay of the drive in control periods that the law is made for; left out: plant.delay_ticks"
    )

    def made_for_another(self, period: float) -> bool:
        """Whether the law is made for another control period than this one [s]."""
        return abs(self.period - period) > 1e-6 * period

    @property
    def drives_a_period(self) -> int:
        """How many drives an answer holds for one control period, each with its time."""
        return 1


class ContactWarning(UserWarning):
    """A model of friction, or a linear model, is used on a plant of one's own that does not declare this contact."""


class TimingWarning(UserWarning):
    """A law is made for another control period, delay or DAC than those of the plant."""


TIMING = ("period", "delay_ticks")
"""Names of the parameters of `SampledLaw`."""


def require_plant(controller: Tree, plant: PlantParameters) -> None:
    """Check that a law with a model of friction suits the contact of a plant; of a plant of one's own warn only.

    Raises
    ------
    ParameterError
        If a plant of this package has another contact.
    """
    law, contact = find("law", controller.law.kind), find("plant", plant.kind).contact
    if not law.models_contact or contact in (SPRING, RIGID):
        return
    what = "its model of friction is that of the parameters contact"
    if shipped("plant", plant.kind):
        raise ParameterError(
            f"law.kind = {law.name} is not allowed with plant.kind = {plant.kind}: {what}; choose a plant with it, as "
            f"compliant, or a law without a model of friction, such as load or pid"
        )
    why = "has another contact" if contact else "does not declare its contact"
    warnings.warn(
        f"law.kind = {law.name} with plant.kind = {plant.kind}: {what}, and this plant {why} (docs/extending.md)",
        ContactWarning,
        stacklevel=3,
    )


def timing_disagreements(law: LawParameters, instrument: Tree) -> list[str]:
    """Where a law is made for another period, delay or DAC than those of the plant, a sentence each.

    Parameters
    ----------
    law : LawParameters
        Of any law; one that is not made for a period has nothing to disagree.
    instrument : SimParameters
    """
    plant = instrument.plant
    control_period, delay_ticks = plant.control_period, plant.delay_ticks
    if not isinstance(law, SampledLaw):
        return []
    told = []
    if law.made_for_another(control_period):
        told.append(
            f"the law is made for another rate: law.period = {law.period:g} s should be plant.control_period = "
            f"{control_period:g} s"
        )
    if law.delay_ticks != delay_ticks:
        told.append(
            f"the law is made for another delay: law.delay_ticks = {law.delay_ticks} should be plant.delay_ticks = "
            f"{delay_ticks}"
        )
    slot, dac_period = control_period / law.drives_a_period, instrument.piezo.dac_period or control_period
    if dac_period > (1.0 + 1e-6) * slot:
        told.append(
            f"of the {law.drives_a_period} drives that the law sends for each control period not all are put in force: "
            f"piezo.dac_period should be {slot:g} s, it is {dac_period:g} s"
        )
    return told


def warn_of_timing(found: Sequence[str], of: str = "", stacklevel: int = 2) -> None:
    """Warn of `timing_disagreements`: the one warning of all that run a law on an instrument.

    Parameters
    ----------
    found : sequence of str
        As of `timing_disagreements`; of many sets the first of each set that has any.
    of : str
        For many sets: all of them, such as "12 sets". One warning counts them then, and names the first.
    stacklevel : int
        As of `warnings.warn`, seen from the caller of this function.
    """
    sentences = [f"in {len(found)} of {of} {found[0]}"] if of and found else found
    for sentence in sentences:
        warnings.warn(sentence, TimingWarning, stacklevel=stacklevel + 1)


class SampledConstants(ScannerConstants):
    """Those of the scanner, and of the loop along z."""

    k_z1: float  # feedback on height and rate of the sample
    k_z2: float
    alpha_h: float  # gains of the filter
    beta_h: float
    eta_c: Annotated[float, "w0"]  # the cantilever
    mu: Annotated[float, "1"]
    w: float  # load
    a: Annotated[float, "z0"]


class SampledState(ScannerState):
    """That of the scanner, and of the loop along z: another of these laws goes on with it."""

    handed_over = True
    surface: Annotated[float, "z0"]  # what the tip is above the sample's stage, Q - Z
    surface_rate: Annotated[float, "z0 w0"]


class FeedbackLaw(SampledLaw):
    """A sampled law with state feedback along x and y."""

    time_constant: Annotated[NonNegative, Unit("s")] = Field(
        0.0, description="of the tracking error along x and y; 0: (1 + law.delay_ticks) law.period"
    )


def time_constant(parameters: Tree) -> float:
    """Of the tracking error [1/w0]: as given, or one control period and the delay, docs/laws.md (6.1)."""
    law = parameters.law
    return float(parameters.scales.w0 * (law.time_constant or (1 + law.delay_ticks) * law.period))


def pole(parameters: Tree, axis: HeldAxis) -> float:
    """Eigenvalue of that time constant over the step of `axis`."""
    return exp(-axis.hold / time_constant(parameters))


def lateral_axes(parameters: Tree, periods: int = 1) -> list[HeldAxis]:
    """x and y of the free scanner over `periods` control periods."""
    return free_axes(parameters, periods)[:2]


def sampled_values(parameters: Tree) -> dict[str, Any]:
    """Values of SampledConstants.

    Along z the time constant of feedback and filter is one control period, and never below that of the cantilever's
    resonance: what is faster than that is the contact ringing, not the surface.
    """
    scales, cantilever = parameters.scales, parameters.cantilever
    axis = free_axes(parameters)[2]
    eta_c = 2.0 * math.pi * cantilever.f_c / scales.w0
    pole = exp(-axis.hold / max(axis.hold, 1.0 / eta_c))
    k_z1, k_z2 = place_poles(axis, pole, pole)
    return scanner.scanner_values(parameters) | {
        "k_z1": k_z1,
        "k_z2": k_z2,
        # Critically damped filter of second order with the same pole.
        "alpha_h": 1.0 - square(pole),
        "beta_h": square(1.0 - pole),
        "eta_c": eta_c,
        "mu": parameters.scanner.mass_ratio,
        "w": cantilever.W / (cantilever.m_c * square(scales.w0) * scales.z0),
        "a": cantilever.a / scales.z0,
    }


@kernel
def control_height(y: Measurement, u: PiezoDrive, p: SampledConstants, s: SampledState) -> None:
    """Write the drive of z: the tip to its setpoint, the surface going on as it has."""
    tip = p.a + y.deflection / p.length[2]
    above = tip - position(y, p, 2)
    if s.follows == 0.0:
        s.follows = 1.0
        s.surface, s.surface_rate = above, 0.0
    else:
        s.surface += p.hold * s.surface_rate
        miss = above - s.surface
        s.surface += p.alpha_h * miss
        s.surface_rate += p.beta_h * miss / p.hold
    # The cantilever presses on the scanner through the contact.
    load = (p.w + p.eta_c * p.eta_c * (tip - p.a)) / p.mu
    now = y.reference_position[2] / p.length[2] - s.surface - p.ahead * s.surface_rate
    then = now - p.hold * s.surface_rate
    z, z_rate = predict(y, p, s, 2, load)
    wanted = drive_between(p, 2, now, -s.surface_rate, then, -s.surface_rate) + load
    send(u, p, s, 2, wanted - p.k_z1 * (z - now) - p.k_z2 * (z_rate + s.surface_rate))
