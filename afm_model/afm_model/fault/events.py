"""List the begin and end of faults, for reports about a run."""

from typing import Any

from .schedule import faults_of


def events(parameters: Any, begin: int, end: int) -> list[tuple[int, str]]:
    """What faults do from tick `begin` up to, without it, tick `end`: each with its tick, in order.

    Parameters
    ----------
    parameters : InstrumentParameters
    begin, end : int
    """
    told = []
    for name, entry in faults_of(parameters).items():
        first, last = entry.ticks(parameters.plant.control_period)
        if first < last:
            told += [(first, f"fault {name} begins: {entry.describe()}"), (last, f"fault {name} ends")]
    return sorted(event for event in told if begin <= event[0] < end)


def active(parameters: Any, tick: int) -> list[str]:
    """Names of the faults that act during a tick."""
    period = parameters.plant.control_period
    return [
        name for name, each in faults_of(parameters).items() if each.ticks(period)[0] <= tick < each.ticks(period)[1]
    ]


def acted(parameters: Any, ticks: int) -> list[str]:
    """Names of the faults that have acted in the first `ticks` ticks of a run."""
    period = parameters.plant.control_period
    return [
        name
        for name, each in faults_of(parameters).items()
        if each.ticks(period)[0] < min(ticks, each.ticks(period)[1])
    ]
