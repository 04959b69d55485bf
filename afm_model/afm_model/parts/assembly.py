"""Putting parts together: the functions of a part by address, its records in a block."""

from collections.abc import Callable
from typing import Any

from ..compiled.calls import Function
from ..compiled.records import Block, Record, record_at, size
from ..core import registry
from ..core.errors import ParameterError, PartError
from ..core.schema import specified
from .part import Numbers, Part


class Assembled:
    """A part with its functions ready to be called, and a name for messages.

    Parameters
    ----------
    part : Part
    kind : str
        By which it was chosen.

    Raises
    ------
    PartError
        If a function of it cannot be compiled.
    """

    def __init__(self, part: Part, kind: str) -> None:
        self.part = part
        self.title = f"{part.family} {kind}"
        self.functions: dict[str, Function] = {}
        for name in part.functions:
            if (function := getattr(part, name)) is not None:
                try:
                    self.functions[name] = Function(function, part.arguments(name))
                except TypeError as error:
                    raise PartError(f"{self.title}: {name}: {error}") from None
        self.in_python = any(not function.compiled for function in self.functions.values())
        """Whether a function of it may raise something."""

    @property
    def places(self) -> dict[str, int]:
        """Fields of a header: the addresses of the functions, 0 if a function is missing."""
        addresses = {name: function.address for name, function in self.functions.items()}
        return {f"{self.part.family}_{name}": addresses.get(name, 0) for name in self.part.functions}

    def fill_constants(self, block: Block, index: int, parameters: Any) -> None:
        """Make the constants from the parameters: by `values`, or from the parameter of the same name and unit.

        Raises
        ------
        ParameterError
            If they cannot be computed.
        PartError
            If the part gives values that are not those of its record.
        """
        values = {**self._of_same_name(parameters), **self._made(self.part.values, parameters)}
        self._fill(block, index, self.part.constants, values, "constants")

    def fill_start(self, block: Block, index: int, parameters: Any) -> None:
        """Put the state to its start."""
        state = block[index : index + size(self.part.state)]
        # Untouched memory takes no pages: do not write zeros.
        if state.any():
            state[:] = 0.0
        if self.part.start is not None:
            self._fill(block, index, self.part.state, self._made(self.part.start, parameters), "state")

    def _of_same_name(self, parameters: Any) -> dict[str, Any]:
        """Constants that are a parameter of the part, or a scale of the equations."""
        found: dict[str, Any] = {}
        for group in (parameters.scales, *(group for _, group in parameters if group.family == self.part.family)):
            model: Any = type(group)
            known = specified(model)
            for name, (_, _, unit) in self.part.constants.fields.items():
                if name in known and known[name].kind is not str and known[name].unit == (unit or "1"):
                    found[name] = getattr(group, name)
        return found

    def _made(self, make: Callable[[Any], Numbers], parameters: Any) -> Numbers:
        try:
            return make(parameters)
        except (ArithmeticError, ValueError) as error:
            raise ParameterError(
                f"some parameter of {self.title} is too large or too small to compute with ({error})"
            ) from None

    def _fill(self, block: Block, index: int, record: type[Record], values: Numbers, what: str) -> None:
        names = record.names
        if set(values) != set(names):
            odd = ", ".join(sorted(set(values) ^ set(names)))
            raise PartError(f"{self.title}: the values of its {what} and the fields of the record differ: {odd}")
        if names:
            target = record_at(block, index, record)
            for name in names:
                target[name] = values[name]

    def raise_errors(self) -> None:
        """Raise what a function of the part has raised in Python.

        Raises
        ------
        PartError
        """
        for name, function in self.functions.items():
            if function.error is not None:
                error, function.error = function.error, None
                raise PartError(f"{self.title}: {name}: {type(error).__name__}: {error}") from error


def assembled(family: str, kind: str) -> Assembled:
    """The part of `family` called `kind`."""
    return Assembled(registry.find(family, kind), kind)
