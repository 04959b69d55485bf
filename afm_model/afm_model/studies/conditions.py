"""Under what laws are compared: rate, delay, noise, friction and reference of the instrument; what each law is told."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..core.errors import ParameterError
from ..parameters import ControllerParameters, SimParameters, Value, build, flatten
from ..parameters.scenario import Scenario, law_timing
from .contender import Contender

CONDITIONS = ("period", "delay_ticks", "noise", "friction", "reference")
"""What varies besides the law: control period [s], delay, noise, true over nominal friction, reference."""
NOISE: dict[str, float] = {"detector.noise": 1e-3, "detector.position_noise": 5e-11}
"""Noise of level 1: photodetector [V], position sensors [m]; with any noise the ADC has 16 bits."""


@dataclass(frozen=True)
class Common:
    """What all runs of a comparison have in common."""

    scenario: Scenario
    cycles: float  # length of a run in periods of the reference


def instrument_under(common: Common, conditions: Mapping[str, Any]) -> SimParameters:
    """The instrument under some conditions.

    Raises
    ------
    ParameterError
        If a condition is not allowed.
    """
    shape, _, omega = str(conditions["reference"]).partition(" ")
    try:
        speed = float(omega)
        cycle = 2.0 * math.pi / speed
    except (ValueError, ZeroDivisionError):
        raise ParameterError(
            f"reference {conditions['reference']} is not allowed: it must be a shape and an angular frequency > 0 in "
            f"rad/s, such as sine 50"
        ) from None
    level, base = float(conditions["noise"]), flatten(common.scenario.sim)
    changed: dict[str, Value] = {
        "plant.control_period": conditions["period"],
        "plant.delay_ticks": conditions["delay_ticks"],
        "contact.tau": common.scenario.sim.contact.tau * conditions["friction"],
        "reference.shape_x": shape,
        "reference.shape_y": shape,
        "reference.omega_x": speed,
        "reference.omega_y": speed,
        "run.duration": common.cycles * cycle,
        "score.start": 0.5 * cycle,
    }
    if level != 0.0:
        changed |= {name: level * value for name, value in NOISE.items()} | {"detector.adc_bits": 16}
    return build(SimParameters, base | changed)


def law_under(common: Common, law: Contender, conditions: Mapping[str, Any]) -> ControllerParameters:
    """A law under some conditions: told period and delay if it asks for them, and nothing of noise and true friction.

    Raises
    ------
    ParameterError
        If the law refuses its rate.
    """
    given = flatten(common.scenario.controller)
    if common.scenario.controller.law.kind != law.kind:
        given = {name: value for name, value in given.items() if not name.startswith("law.")}
    own: dict[str, Value] = {"law.kind": law.kind, **{f"law.{name}": value for name, value in law.values.items()}}
    return build(ControllerParameters, given | law_timing(own, instrument_under(common, conditions)) | own)
