"""Faults to order: a list of faults, each with its kind, begin, duration, signal, size and seed.

Not one is there by default, and then nothing is computed. More can be put in force while the instrument runs. The loop
has a table of a few places; a fault that is over leaves its place to another one, and takes it again after a reset.
"""

from dataclasses import dataclass
from itertools import accumulate
from typing import Any, ClassVar

from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Block
from ..core.schema import Group
from ..parts.groups import FaultParameters
from ..parts.part import Fault
from ..parts.signals import Delivery, Measurement
from .memory import MOST, Constants, Memory
from .message import delay_command, delay_measurement
from .schedule_entry import DRIVES, KINDS, MESSAGES, NEVER, SENSORS, TARGETS, Entry, problem
from .signal import spoil_drive, spoil_measurement
from .surface import disturb_sample


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
    if told := "; ".join(filter(None, problems)):
        raise ValueError(told)
    changes = sorted(
        change
        for begin, end in (_needed(entry, period) for entry in faults.values())
        if begin < end
        for change in ((begin, 1), (end, -1))
    )
    most = max(accumulate(change for _, change in changes), default=0)
    if most > MOST:
        raise ValueError(f"{most} faults at a time are too many: {MOST} are the most")


def _needed(entry: Entry, period: float) -> tuple[int, int]:
    """First tick at whose begin a fault must be in the table, and the first at which it need not any more."""
    first, last = entry.ticks(period)
    if first >= last:
        return 0, 0
    # The measurement of a tick is made at the end of the one before. What has drifted stays where it is.
    return first - 1, NEVER if entry.kind == "thermal" else last


@dataclass(frozen=True)
class Table:
    """The faults that the loop knows from some tick on."""

    names: list[str]
    """In the order of the table, which is that in which they act."""
    numbers: dict[str, Any]
    """As in Constants."""
    until: int
    """The tick before which it must be filled again: another fault needs a place."""


def table(parameters: Any, tick: int, places: int = MOST) -> Table:
    """The table from the begin of `tick` on: without those that are over, and with those that begin soonest."""
    faults, period = faults_of(parameters), parameters.plant.control_period
    waiting = sorted(
        (begin, name) for name, entry in faults.items() for begin, end in [_needed(entry, period)] if end > tick
    )
    names = sorted(name for _, name in waiting[:places])
    until = waiting[places][0] if len(waiting) > places else NEVER
    return Table(names, _numbers(parameters, [faults[name] for name in names]), until)


def values(parameters: Any) -> dict[str, Any]:
    """The table of faults at the start of a run."""
    return table(parameters, 0).numbers


def _numbers(parameters: Any, entries: list[Entry]) -> dict[str, Any]:
    kinds = list(KINDS)
    rows = [
        (kinds.index(each.kind) + 1, TARGETS.index(each.signal), *each.ticks(parameters.plant.control_period))
        for each in entries
    ]
    rest = [0] * (MOST - len(entries))

    def count(*targets: str) -> int:
        return sum(each.signal in targets for each in entries)

    columns = zip(*rows, strict=True) if rows else [()] * 4
    filled = dict(zip(("kind", "target", "first", "last"), ([*column, *rest] for column in columns), strict=True))
    detector = parameters.detector
    return {
        "count": len(entries),
        "on_sensors": count(*SENSORS),
        "on_drives": count(*DRIVES),
        "on_measurements": count(MESSAGES[0]),
        "on_commands": count(MESSAGES[1]),
        "on_sample": sum(each.of_the_sample for each in entries),
        **filled,
        "seed": [*(each.seed for each in entries), *rest],
        "magnitude": [*(each.size for each in entries), *rest],
        "control_period": parameters.plant.control_period,
        "dac_period": parameters.piezo.dac_period or parameters.plant.control_period,
        "deflection_sensitivity": detector.deflection_sensitivity,
        "lateral_sensitivity": detector.lateral_sensitivity,
    }


@kernel
def on_measurement(k: int, t: float, y: Measurement, e: Delivery, p: Constants, s: Memory, r: Block) -> None:
    """See `afm_model.parts.Fault`."""
    if p.on_sensors > 0:
        spoil_measurement(k, y, p, s)
    if p.on_measurements > 0:
        delay_measurement(k, y, e, p, s)


SCHEDULED = Fault(
    name="scheduled",
    parameters=Schedule,
    constants=Constants,
    state=Memory,
    recorded=False,
    values=values,
    check=check,
    # What has nothing to do is not called: `afm_model.instrument.faults`.
    on_sample=disturb_sample,
    on_command=delay_command,
    on_drive=spoil_drive,
    on_measurement=on_measurement,
)
