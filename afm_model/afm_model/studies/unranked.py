"""Which runs count for nothing, in a comparison and over wrong models alike."""

import math

from ..core import registry
from ..core.elementary import square
from ..instrument import ScoreSummary
from ..instrument.validity import doubts
from ..parameters import ControllerParameters, SimParameters

_LARGEST = 4.0
"""Largest error along z over that in the mean square: a tip that is thrown for a moment still counts."""
_PULL = 0.1
"""Part of the pull-off force by which the load may be off on any sample: friction changes little by that."""


def height_limit(sim: SimParameters) -> float:
    """Error along z, rms, that is allowed [m]: what a tip has at most that is held at one height over the sample.

    Friction falls where a tip is pulled, so that one held high above the setpoint has an easier task along x and y. On
    a sample without height: where the load has an error of a tenth of the pull-off force.
    """
    cantilever = sim.cantilever
    stiffness = cantilever.m_c * square(2.0 * math.pi * cantilever.f_c)
    height = registry.find("sample", sim.sample.kind).height(sim)
    return max(float(height), _PULL * sim.contact.pull_off_force / stiffness)


def unranked(sim: SimParameters, score: ScoreSummary, controller: ControllerParameters | None = None) -> str:
    """Why a run counts for nothing, however small its error along x and y is; "" if it counts.

    Parameters
    ----------
    sim : SimParameters
    score : ScoreSummary
    controller : ControllerParameters, optional
        Of a law that is a part.
    """
    if score.contact_fraction < 1.0:
        return f"the tip was on the sample for {100.0 * score.contact_fraction:.3g} % of the time"
    if found := doubts(sim, score, controller):
        return found[0]
    allowed, rms, largest = height_limit(sim), float(score.rms[2]), float(score.max[2])
    if rms > allowed or largest > _LARGEST * allowed:
        return (
            f"the tip was off the height that was asked by {1e9 * rms:.3g} nm rms, {1e9 * largest:.3g} nm at most: "
            f"{1e9 * allowed:.3g} and {1e9 * _LARGEST * allowed:.3g} nm are allowed"
        )
    return ""
