"""What the friction-predicting law cannot be made for, and where it cannot hold what it promises."""

import math

from ...parts.part import Tree
from .constants import INTERVALS, LONGEST_DELAY, SLOTS, SURFACES, longest
from .gains import grid


def check(parameters: Tree) -> None:
    """Raise ValueError for parameters that are not allowed together."""
    law, w0 = parameters.law, parameters.scales.w0
    if law.surface == "known" and parameters.sample.kind != "paper":
        raise ValueError(
            f"law.surface = known is not allowed with sample.kind = {parameters.sample.kind}: the law knows the sample "
            f"paper alone; it must be one of {', '.join(list(SURFACES)[1:])}"
        )
    if law.delay_ticks > LONGEST_DELAY:
        raise ValueError(f"law.delay_ticks = {law.delay_ticks} is not allowed: it must be <= {LONGEST_DELAY}")
    slots = longest(parameters)
    if slots > SLOTS:
        raise ValueError(
            f"law.packet = {law.packet} with law.delay_ticks = {law.delay_ticks}, law.spare = {law.spare} and "
            f"law.reserve = {law.reserve} is not allowed: law.packet (law.delay_ticks + 1 + law.spare) + law.reserve = "
            f"{slots} must be <= {SLOTS}"
        )
    division = grid(law.period * w0 / law.packet, law.response * w0)
    at_once = max(law.packet * (1 + law.spare), law.packet + 1 if law.reserve else 0)
    ahead = division.fine * (division.holds + at_once - 1)
    if ahead > INTERVALS:
        raise ValueError(
            f"law.period = {law.period:g} s is not allowed with law.packet = {law.packet}, law.response = "
            f"{law.response:g} s: the law would look {ahead} intervals ahead and must not look farther than "
            f"{INTERVALS}; raise law.packet or lower law.response"
        )


def warnings(parameters: Tree, control_period: float) -> list[str]:
    """Axes whose resonance is too fast for a held drive: beyond half a period of it the scanner swings in between."""
    law, scanner = parameters.law, parameters.scanner
    slot = control_period / law.packet
    told = []
    if law.feedback == "measured" and law.surface != "known" and law.packet > 1:
        told.append(
            f"x and y will not be tracked: with law.feedback = measured and law.packet = {law.packet} law.surface must"
            f" be known, it is {law.surface}; take law.packet = 1 (docs/laws.md)"
        )
    return told + [
        f"along {axis} the scanner swings between two drives: 2 pi scanner.f_{axis} plant.control_period / law.packet "
        f"= {2.0 * math.pi * f * slot:.3g} should be < 3.14 (scanner.f_{axis} = {f:g} Hz, plant.control_period = "
        f"{control_period:g} s, law.packet = {law.packet})"
        for axis, f in (("x", scanner.f_x), ("y", scanner.f_y), ("z", scanner.f_z))
        if 2.0 * f * slot >= 1.0
    ]
