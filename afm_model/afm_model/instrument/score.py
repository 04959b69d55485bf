"""The score of a run: running sums kept by the compiled loop, and the one list of what a score holds."""

from dataclasses import dataclass, fields
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import kernel
from ..compiled.records import Block, Record, Vector, record_at
from ..core import registry
from ..parameters import InstrumentParameters
from ..parts.signals import Setpoint, Truth

_Array = NDArray[np.float64]


class ScoreSums(Record):
    ticks: float
    steps: float
    stuck_steps: float
    phases: float
    was_stuck: float
    lost_steps: float
    square: Annotated[Vector, "m^2"]  # sum of squared errors
    largest: Annotated[Vector, "m"]  # largest error
    variation: Annotated[Vector, "V"]  # total variation of the drive
    extent: Annotated[Vector, "m"]  # largest position
    friction_low: Annotated[float, "N"]
    friction_high: Annotated[float, "N"]
    normal_low: Annotated[float, "N"]
    normal_high: Annotated[float, "N"]


@kernel
def count_drive(t: ScoreSums, du_x: float, du_y: float, du_z: float) -> None:
    """Count a change of the drive into the sums t [V]."""
    # The first scored drive starts the variation.
    if t.ticks > 0.0:
        t.variation[0] += abs(du_x)
        t.variation[1] += abs(du_y)
        t.variation[2] += abs(du_z)


@kernel
def between(a: Setpoint, b: Setpoint, axis: int, f: float, period: float) -> float:
    """Reference between two control ticks, f = 0 ... 1 of a period after the first: the cubic through the positions and
    velocities of both [m].

    A corner of a triangle between the two is rounded by an eighth of a period at most.
    """
    g = 1.0 - f
    ends = g * g * (1.0 + 2.0 * f) * a.position[axis] + f * f * (1.0 + 2.0 * g) * b.position[axis]
    return ends + f * g * period * (g * a.velocity[axis] - f * b.velocity[axis])


@kernel
def count_error(t: ScoreSums, axis: int, position: float, asked: float) -> None:
    """Count the true tracking error along one axis at the end of an integration step [m]."""
    e = position - asked
    t.square[axis] += e * e
    t.largest[axis] = max(t.largest[axis], abs(e))
    t.extent[axis] = max(t.extent[axis], abs(position))


@kernel
def count_step(t: ScoreSums, o: Truth, a: Setpoint, b: Setpoint, f: float, period: float) -> None:
    """Count one integration step into the sums t: tracking error, stick, contact, ranges of friction and normal force.

    Parameters
    ----------
    t, o : records of ScoreSums and Truth
    a, b : records of Setpoint
        At the control ticks before and after.
    f, period : float
        Part of the control period that has passed at the end of the step; the control period [s].
    """
    count_error(t, 0, o.position[0], between(a, b, 0, f, period))
    count_error(t, 1, o.position[1], between(a, b, 1, f, period))
    count_error(t, 2, o.tip_height, between(a, b, 2, f, period))
    if o.stuck != 0.0:
        t.stuck_steps += 1.0
        if t.was_stuck == 0.0:
            t.phases += 1.0
    t.was_stuck = o.stuck
    if o.contact == 0.0:
        t.lost_steps += 1.0
    if t.steps == 0.0:
        t.friction_low = t.friction_high = o.friction_bound
        t.normal_low = t.normal_high = o.normal_force
    t.friction_low = min(t.friction_low, o.friction_bound)
    t.friction_high = max(t.friction_high, o.friction_bound)
    t.normal_low = min(t.normal_low, o.normal_force)
    t.normal_high = max(t.normal_high, o.normal_force)
    t.steps += 1.0


@dataclass(frozen=True)
class ScoreSummary:
    """The scored part of a run, SI units. Arrays of three are x, y, z; NaN where there is no value.

    Names and order are those of afm_msgs/Score.
    """

    ticks: int
    rms: _Array  # tracking error, over every integration step [m]
    max: _Array  # [m]
    max_percent: _Array  # the same as a percentage of the reference's amplitude, z: of the sample's
    drive_total_variation: _Array  # [V/s]
    extent: _Array  # largest |position| of x, y and of the tip height [m]
    stick_phases: int
    stick_fraction: float
    contact_fraction: float
    friction: tuple[float, float]  # range of the friction bound [N]
    normal_force: tuple[float, float]  # [N]


VECTORS = tuple(each.name for each in fields(ScoreSummary) if each.type in ("_Array", _Array))
"""Fields that are x, y, z."""
RANGES = tuple(each.name for each in fields(ScoreSummary) if str(each.type).startswith("tuple"))
"""Fields that are least and largest."""
COUNTS = tuple(each.name for each in fields(ScoreSummary) if each.type in ("int", int))
"""Fields that are whole numbers."""


def columns() -> list[str]:
    """Names of a score's numbers in a flat table: vectors as `rms_x`, ranges as `friction_low`."""
    names: list[str] = []
    for each in fields(ScoreSummary):
        if each.name in VECTORS:
            names += [f"{each.name}_{axis}" for axis in "xyz"]
        elif each.name in RANGES:
            names += [f"{each.name}_{end}" for end in ("low", "high")]
        else:
            names.append(each.name)
    return names


def row(score: ScoreSummary) -> dict[str, float | int]:
    """The numbers of a score by the names of `columns`."""
    values: list[float | int] = []
    for each in fields(ScoreSummary):
        value = getattr(score, each.name)
        values += [float(number) for number in value] if each.name in (*VECTORS, *RANGES) else [value]
    return dict(zip(columns(), values, strict=True))


def summarize(block: Block, index: int, parameters: InstrumentParameters) -> ScoreSummary:
    """Score of a run from its running sums, which stand at `block[index]`."""
    t = record_at(block, index, ScoreSums).copy()
    height = registry.find("sample", parameters.sample.kind).height(parameters)
    amplitude = np.abs([*parameters.reference.amplitude, height])
    ticks, steps = np.float64(t.ticks), np.float64(t.steps)
    with np.errstate(divide="ignore", invalid="ignore"):
        # What nothing was counted for is not zero but not known.
        if not ticks:
            for name in ScoreSums.names:
                t[name] = np.nan
            t.phases = 0.0
        largest = np.array(t.largest)
        return ScoreSummary(
            ticks=int(ticks),
            rms=np.sqrt(t.square / steps),
            max=largest,
            max_percent=np.where(amplitude > 0.0, 100.0 * largest / amplitude, np.nan),
            drive_total_variation=t.variation / (ticks * parameters.plant.control_period),
            extent=np.array(t.extent),
            stick_phases=int(t.phases),
            stick_fraction=float(t.stuck_steps / steps),
            contact_fraction=float(1.0 - t.lost_steps / steps),
            friction=(float(t.friction_low), float(t.friction_high)),
            normal_force=(float(t.normal_low), float(t.normal_high)),
        )
