"""Settings that are stored and given back: the rows of the table that are used or kept."""

import math
import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from .table import STORED, CommandRow, Field


def _stays(field: Field, value: Any) -> bool:
    """Whether a value leaves the setting as it is."""
    if field.flag and value == 0:
        return True
    if isinstance(field.keep, float) and math.isnan(field.keep):
        return isinstance(value, float) and math.isnan(value)
    return field.keep is not None and value == field.keep


def _given_back(field: Field, value: Any) -> Any:
    """A value as the Get has it."""
    if field.flag == "!":
        return int(value == 1)
    return value - 1 if field.flag == "<" else value


def merged(fields: Sequence[Field], old: Sequence[Any], new: Sequence[Any]) -> list[Any]:
    """Values after a Set: what is left out, or says so, stays."""
    found = list(old)
    for number, (field, value) in enumerate(zip(fields, new, strict=False)):
        if not _stays(field, value):
            found[number] = _given_back(field, value)
    return found


class Settings:
    """What is stored, by name of the setting and index."""

    def __init__(self) -> None:
        self._values: dict[tuple[Any, ...], list[Any]] = {}
        self._lock = threading.Lock()

    def of(self, command: CommandRow, indices: Sequence[Any] = ()) -> list[Any]:
        """Values of a setting."""
        with self._lock:
            return list(self._values.get((command.setting, *indices), command.before))

    def serve(self, command: CommandRow, arguments: Sequence[Any]) -> list[Any]:
        """Do a Set or Get of the table; what the Get returns."""
        assert command.how in STORED
        count = sum(field.index for field in command.arguments)
        # A client that leaves out the index means the first one.
        indices = [*arguments[:count], *[1] * (count - len(arguments[:count]))]
        if command.sets:
            fields = command.arguments[count:]
            new = merged(fields, self.of(command, indices), arguments[count:])
            with self._lock:
                self._values[(command.setting, *indices)] = new
            return []
        values = self.of(command, indices)
        # A Set may have more than its Get gives back.
        return values[: len(command.returns)]


def single(value: float) -> float:
    """Round a number as it goes over the wire."""
    return float(np.float32(value))
