"""The score of a run as plain values for JSON and tables: one layout for all kinds of runs."""

import math
from typing import Any

from . import ScoreSummary

AXES = ("x", "y", "z")


def number(value: float) -> float | None:
    """A number with six digits; None for NaN and infinities, which JSON does not know."""
    return float(f"{value:.6g}") if math.isfinite(value) else None


def scorecard(score: ScoreSummary) -> dict[str, Any]:
    """What was scored, in SI units; None where there is nothing to score. z is that of the tip.

    Parameters
    ----------
    score : ScoreSummary

    Returns
    -------
    dict
        Of plain numbers, texts and dicts.
    """
    return {
        "scored_ticks": score.ticks,
        "tracking": {
            axis: {
                "rms_m": number(score.rms[i]),
                "max_m": number(score.max[i]),
                "max_percent": number(score.max_percent[i]),
            }
            for i, axis in enumerate(AXES)
        },
        "drive_total_variation_per_s": {axis: number(score.drive_total_variation[i]) for i, axis in enumerate(AXES)},
        "stick": {"phases": score.stick_phases, "time_fraction": number(score.stick_fraction)},
        "contact_fraction": number(score.contact_fraction),
        "extent_m": {axis: number(score.extent[i]) for i, axis in enumerate(AXES)},
        "friction_n": {"min": number(score.friction[0]), "max": number(score.friction[1])},
        "normal_force_n": {"min": number(score.normal_force[0]), "max": number(score.normal_force[1])},
    }
