"""Faults to order: a list of faults, each with its kind, begin, duration, signal, size and seed.

Not one is there by default, and then nothing is computed. More can be put in force while the instrument runs.
"""

from typing import Any, ClassVar

from pydantic import Field

from ..parts.groups import FaultParameters
from ..parts.part import Fault
from ..schema import Group
from .entry import DRIVES, KINDS, MESSAGES, SENSORS, TARGETS, Entry, problem
from .memory import CONSTANTS, MEMORY, MOST
from .none import untouched


class Schedule(FaultParameters):
    """Faults by names of one's own: `fault.NAME.kind`, `fault.NAME.start` and the others of `Entry`."""

    entries: ClassVar[type[Group] | None] = Entry

    kind: str = Field("scheduled", description="faults: those of a schedule, fault.NAME.kind, or a part of your own")

    @property
    def faults(self) -> dict[str, Entry]:
        """Every fault by its name, sorted: they act in this order."""
        return {name: getattr(self, name) for name in sorted(type(self).model_fields) if name != "kind"}


def faults_of(parameters: Any) -> dict[str, Entry]:
    """Faults of an instrument's parameters by name; none if its fault is no schedule."""
    return parameters.fault.faults if isinstance(parameters.fault, Schedule) else {}


def check(parameters: Any) -> None:
    """Raise ValueError for what is not allowed, a sentence for each fault."""
    faults = faults_of(parameters)
    period = parameters.plant.control_period
    problems = [problem(f"fault.{name}", entry, period) for name, entry in faults.items()]
    if len(faults) > MOST:
        problems.append(f"{len(faults)} faults are too many: {MOST} are the most, those that are over included")
    if told := "; ".join(filter(None, problems)):
        raise ValueError(told)


def values(parameters: Any) -> dict[str, Any]:
    """The table of faults."""
    entries = list(faults_of(parameters).values())
    kinds = list(KINDS)
    rows = [
        (kinds.index(each.kind) + 1, TARGETS.index(each.signal), *each.ticks(parameters.plant.control_period))
        for each in entries
    ]
    rest = [0] * (MOST - len(entries))

    def count(*targets: str) -> int:
        return sum(each.signal in targets for each in entries)

    columns = zip(*rows, strict=True) if rows else [()] * 4
    table = dict(zip(("kind", "target", "first", "last"), ([*column, *rest] for column in columns), strict=True))
    detector, scales = parameters.detector, parameters.scales
    return {
        "count": len(entries),
        "on_sensors": count(*SENSORS),
        "on_drives": count(*DRIVES),
        "on_measurements": count(MESSAGES[0]),
        "on_commands": count(MESSAGES[1]),
        "on_sample": sum(each.of_the_sample for each in entries),
        **table,
        "seed": [*(each.seed for each in entries), *rest],
        "size": [*(each.size for each in entries), *rest],
        "control_period": parameters.plant.control_period,
        "dac_period": parameters.piezo.dac_period or parameters.plant.control_period,
        "deflection_sensitivity": detector.deflection_sensitivity,
        "lateral_sensitivity": detector.lateral_sensitivity,
        "x0": scales.x0,
        "z0": scales.z0,
    }


SCHEDULED = Fault(
    name="scheduled",
    parameters=Schedule,
    constants=CONSTANTS,
    memory=MEMORY,
    values=values,
    check=check,
    # These are for a part that is called by address; this one is compiled into the loop (`fault/__init__.py`).
    on_measurement=untouched,
    on_drive=untouched,
)
