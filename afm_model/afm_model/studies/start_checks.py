"""What can be said before a run: what is implausible, whether a law can work at this rate and delay."""

import numpy as np

from ..core.errors import ParameterError, PartError
from ..core.registry import find
from ..law import PaperLaw, timing_disagreements
from ..parameters import ControllerParameters, SimParameters
from ..plant.steps import contact_of
from .linear import inside_drives_z, is_stable, largest, linearise
from .linear_model import LinearError

_MOST_PERIODS = 64
"""Fractions of the control period that are tried for a limit."""


def implausible(sim: SimParameters) -> list[str]:
    """What is implausible in plant, onboard loop, piezo, detector and drift, a sentence each."""
    parts = (("plant", sim.plant), ("onboard", sim.onboard), ("piezo", sim.piezo), ("detector", sim.detector))
    of_parts = [sentence for family, group in parts for sentence in find(family, group.kind).warnings(sim)]
    return [*of_parts, *sim.drift.warnings()]


def start_warnings(sim: SimParameters, controller: ControllerParameters) -> list[str]:
    """What is implausible in the instrument, and why a loop cannot work as it is set up: a sentence each, with its
    limit.

    Of the loop: what the law itself reports about its rate; whether it is made for this period and delay; whether the
    linearised loop is stable, and up to which period or delay it would be.
    """
    plant = sim.plant
    told = implausible(sim)
    of_law = find("law", controller.law.kind).warnings(controller, plant.control_period)
    # What the law answers along z has no effect where a loop inside the instrument drives z.
    told += [sentence for sentence in of_law if not (inside_drives_z(sim) and sentence.startswith("along z "))]
    others = timing_disagreements(controller.law, sim)
    # Limits of a law that is made for something else tell nothing; those of the paper's laws without delay are known
    # exactly, and told by themselves.
    of_the_paper = isinstance(controller.law, PaperLaw) and plant.delay_ticks == 0
    if others or of_the_paper or any("diverges" in sentence for sentence in told):
        return told + others
    return told + _unstable(sim, controller)


def _unstable(sim: SimParameters, controller: ControllerParameters) -> list[str]:
    plant = sim.plant
    if not contact_of(sim):
        # How the tip is held is not known: a linear model would be a guess.
        return []
    try:
        loop = linearise(sim, controller)
    except (LinearError, ParameterError, PartError, ArithmeticError, np.linalg.LinAlgError):
        # What has no linear model, or cannot be made, is told elsewhere or not at all.
        return []
    if loop.stable:
        return []
    step = sim.detector.sample_period
    whole = round(plant.control_period / step)
    # As fine as the period allows, and no finer than is of use.
    unit = max(1, whole // _MOST_PERIODS)
    periods = unit * largest(
        lambda n: (n > 0 and is_stable(sim, controller, n * unit * step, plant.delay_ticks)) or n == 0, whole // unit
    )
    ticks = largest(lambda n: is_stable(sim, controller, plant.control_period, n), plant.delay_ticks)
    limits = [
        f"with this delay in ticks up to plant.control_period = {periods * step:g} s"
        if periods > 0
        else "with this delay in ticks at no period",
        f"at this period up to plant.delay_ticks = {ticks}" if ticks >= 0 else "at this period with no delay either",
    ]
    return [
        f"along {loop.axis} the loop cannot be stable: sliding steadily, its linear model grows by "
        f"{loop.radius:.3g} in each control period, and may by <= 1 (law {controller.law.kind}, plant.control_period = "
        f"{plant.control_period:g} s, plant.delay_ticks = {loop.delay_ticks}); it is stable {', and '.join(limits)}"
    ]
