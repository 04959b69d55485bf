"""What makes a score doubtful: the run went where the equations, or their integration, do not hold."""

import math
from functools import lru_cache
from typing import Any

from ..compiled.jit import kernel
from ..compiled.records import Block
from ..contact.jkr import effective_radius_ratio
from ..core import registry
from ..core.elementary import cbrt, hypot
from ..parameters import ControllerParameters, InstrumentParameters
from ..parts.dispatch import surface
from ..plant.steps import resolved_load
from .block import Layout
from .score import ScoreSummary

_RESTS, _REST_STEPS = 20, 10.0
"""From so many rests on that last fewer steps than this on average, steps of half the length give another score."""
_PLACES = 512
"""Places along x and along y at which the sample is looked at: eight and more a bump for the motion of section 4.1."""


def doubts(
    parameters: InstrumentParameters, score: ScoreSummary, controller: ControllerParameters | None = None
) -> list[str]:
    """Sentences, each with its numbers, on why a score may not be true; none for a run that all of this holds for.

    Parameters
    ----------
    parameters : InstrumentParameters
    score : ScoreSummary
        Of a run of that instrument; one in which nothing was scored leaves no doubt.
    controller : ControllerParameters, optional
        The law that closed the loop, where it is known.
    """
    if score.ticks == 0:
        return []
    plant: Any = parameters.plant
    found = []
    least, largest = score.normal_force
    weakest, resolved = valid_forces(parameters)
    if largest > resolved:
        found.append(
            f"the normal force rose to {largest:.3g} N: steps of plant.dt = {plant.dt:g} s resolve the contact up to "
            f"{resolved:.3g} N only"
        )
    if score.stick_phases >= _RESTS:
        steps = score.stick_fraction * score.ticks * plant.control_period / plant.dt / score.stick_phases
        if steps < _REST_STEPS:
            found.append(
                f"the tip came to rest {score.stick_phases} times, for {steps:.2g} steps of plant.dt = {plant.dt:g} s "
                f"on average: rests begin and end with a step, so that these depend on it, and with them tracking "
                f"error and friction: compare with a run at a fifth of plant.dt"
            )
    if plant.kind == "paper":
        if least <= weakest:
            found.append(
                f"the normal force fell to {least:.4g} N, beyond the pull-off force of {weakest:.4g} N: the contact "
                f"would be lost, which the paper's plant does not know"
            )
        elif plant.z == "computed":
            gain = load_gain(parameters, least, float(score.extent[0]), float(score.extent[1]))
            if gain >= 1.0:
                found.append(
                    f"friction and load depend on each other with a gain of {gain:.3g} at a normal force of "
                    f"{least:.3g} N, which must be < 1 (docs/theory.md (43)): the equations of the paper's plant "
                    f"may have no solution, or several"
                )
        law: Any = controller.law if controller is not None else None
        # Other laws have no z_rate; the open loop feeds nothing back.
        closed = law is not None and law.kind != "open_loop"
        if plant.z == "uniform" and closed and getattr(law, "z_rate", "") == "sample":
            found.append(
                "with plant.z = uniform the law must feed back the rate of the tip, law.z_rate = tip: with that of the "
                "sample the error along z does not follow docs/theory.md (29)"
            )
    return found


@lru_cache(maxsize=64)  # Many laws run on one instrument.
def valid_forces(parameters: InstrumentParameters) -> tuple[float, float]:
    """Least and largest normal force [N] between which the plant, or its integration, holds; infinite: any.

    Above, steps of plant.dt do not resolve the contact. Below, the contact would be lost, which the paper's plant does
    not know.
    """
    low = -_least_pull_off_force(parameters) if parameters.plant.kind == "paper" else -math.inf
    return low, resolved_load(parameters)


def load_gain(parameters: InstrumentParameters, load: float, reach_x: float, reach_y: float) -> float:
    """Gain of the loop from load through friction back to load, docs/theory.md (43), at the steepest place.

    Parameters
    ----------
    parameters : InstrumentParameters
    load : float [N]
        Normal force, above the pull-off force; the gain falls with it.
    reach_x, reach_y : float [m]
        The scanner moves within +- these.
    """
    layout = Layout(parameters)
    block, scales = layout.make(parameters), parameters.scales
    constants = layout.record(block, "plant_constants")
    load /= parameters.units.normal_force
    return float(_steepest_gain(block, constants, load, reach_x / scales.x0, reach_y / scales.x0))


def _least_pull_off_force(parameters: InstrumentParameters) -> float:
    """[N], on the sharpest top of the sample, docs/theory.md (18)."""
    curvature = registry.find("sample", parameters.sample.kind).curvature(parameters)
    contact = parameters.contact
    return contact.pull_off_force / (1.0 + curvature * contact.R / parameters.scales.z0)


@kernel
def _steepest_gain(m: Block, p: Any, load: float, reach_x: float, reach_y: float) -> float:
    """Largest df/dN |grad H| / (1 + 1/mu), with df/dN from docs/theory.md (13), over the places within reach [x0]."""
    largest = 0.0
    for i in range(_PLACES):
        x = reach_x * (2.0 * i / (_PLACES - 1) - 1.0)
        for j in range(_PLACES):
            H = surface(x, reach_y * (2.0 * j / (_PLACES - 1) - 1.0), m)
            rho = effective_radius_ratio(H, p.r)
            root = math.sqrt(1.0 + load / (p.L_s * rho))
            rate = p.f_s * H.strength * cbrt(rho * (1.0 + root)) / (1.5 * root * p.L_s)
            slope = hypot(H.slope_x, H.slope_y)
            largest = max(largest, rate * slope / (1.0 + 1.0 / p.mu))
    return largest
