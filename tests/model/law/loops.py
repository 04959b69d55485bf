"""Closed loops of the sampled laws: one run of a given length, as numbers to claim something about."""

from typing import NamedTuple

import numpy as np

from afm_model import ControllerParameters, SimParameters, build
from afm_model.parameters.scenario import law_timing
from afm_model.run.simulation import run

PERIOD = 2.0 * np.pi / 50.0


class Figures(NamedTuple):
    """Of the worse of x and y, but for z and the tip."""

    largest: float  # error [% of 5 nm]
    rms: float
    z_rms: float  # [m]
    contact: float
    variation: float  # of the drive along x and y [V/s]


def closed_loop(kind: str, period: float, delay: int = 0, *, sim: dict[str, object] | None = None, **law) -> Figures:
    """One period of the sine of 50 rad/s; the first half is not scored."""
    parameters = build(
        SimParameters,
        {
            "plant.control_period": period,
            "plant.delay_ticks": delay,
            "run.duration": PERIOD,
            "score.start": 0.5 * PERIOD,
            **(sim or {}),
        },
    )
    own = {"law.kind": kind}
    own |= law_timing(own, parameters)
    controller = build(ControllerParameters, own | {f"law.{name}": value for name, value in law.items()})
    score = run(parameters, controller, block_ticks=512, hashed=False).score()
    return Figures(
        float(np.nanmax(score.max_percent[:2])),
        float(100.0 * np.max(score.rms[:2]) / 5e-9),
        float(score.rms[2]),
        score.contact_fraction,
        float(np.sum(score.drive_total_variation[:2])),
    )
