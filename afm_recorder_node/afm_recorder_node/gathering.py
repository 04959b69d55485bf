"""Results of verbs, put together of the messages that bring their arrays. Needs no ROS."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from afm_model.microscope.arrays import Arrays, Variable


@dataclass(frozen=True)
class ResultArray:
    """One array of a result."""

    verb: str
    """Type of the verb, as ForceCurve."""
    number: int
    """Of the result, since the start of the instrument."""
    count: int
    """Arrays of this result."""
    time_ns: int
    status: str
    """complete, cancelled or failed."""
    name: str
    coordinate: bool
    variable: Variable
    attributes: Mapping[str, Any]
    """Of the result as a whole."""


@dataclass(frozen=True)
class Result:
    """What a verb has brought back."""

    verb: str
    time_ns: int
    status: str
    arrays: Arrays


class Gathering:
    """Puts results together of their parts."""

    def __init__(self) -> None:
        self._parts: dict[str, ResultArray] = {}

    def put(self, part: ResultArray) -> Result | None:
        """A part has come; the result if it is whole. Parts of a result before that are not whole are given up."""
        if any(each.number != part.number for each in self._parts.values()):
            self._parts.clear()
        self._parts[part.name] = part
        if len(self._parts) < part.count:
            return None
        parts, self._parts = self._parts, {}
        groups: tuple[dict[str, Variable], dict[str, Variable]] = ({}, {})
        for name, each in parts.items():
            groups[each.coordinate][name] = each.variable
        return Result(part.verb, part.time_ns, part.status, Arrays(*groups, part.attributes))
