"""Putting parts together: the functions of a part by address, its records in a block."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..core import registry
from ..core.call import Function
from ..core.errors import ParameterError, PartError
from ..core.records import Block, record_at, size
from .header import OTHER
from .part import Numbers, Part


def numbered(part: Part, own: tuple[Part, ...]) -> int:
    """Number by which compiled code chooses a part of this package, or OTHER."""
    return own.index(part) if part in own else OTHER


class Assembled:
    """A part with its functions ready to be called, and a name for messages.

    Parameters
    ----------
    part : Part
    kind : str
        By which it was chosen.
    own : tuple of Part
        Parts of its family that compiled code knows.

    Raises
    ------
    PartError
        If a function of it cannot be compiled.
    """

    def __init__(self, part: Part, kind: str, own: tuple[Part, ...]) -> None:
        self.part = part
        self.title = f"{part.family} {kind}"
        self.number = numbered(part, own)
        self.functions: dict[str, Function] = {}
        if self.number == OTHER:
            for name in part.functions:
                if getattr(part, name) is None:
                    continue
                try:
                    self.functions[name] = Function(getattr(part, name), part.arguments(name))
                except TypeError as error:
                    raise PartError(f"{self.title}: {name}: {error}") from None

    @property
    def places(self) -> dict[str, int]:
        """Fields of a header: the number, the addresses of the functions."""
        family = self.part.family
        addresses = {f"{family}_{name}": 0 for name in self.part.functions}
        addresses |= {f"{family}_{name}": function.address for name, function in self.functions.items()}
        return {family: self.number} | addresses

    def fill_constants(self, block: Block, index: int, parameters: Any) -> None:
        """Make the constants from the parameters.

        Raises
        ------
        ParameterError
            If they cannot be computed.
        PartError
            If the part gives values that are not those of its record.
        """
        self._fill(block, index, self.part.constants, self._made(self.part.values, parameters), "constants")

    def fill_start(self, block: Block, index: int, parameters: Any) -> None:
        """Put the state to its start."""
        block[index : index + size(self.part.state)] = 0.0
        if self.part.start is not None:
            self._fill(block, index, self.part.state, self._made(self.part.start, parameters), "state")

    def _made(self, make: Callable[[Any], Numbers], parameters: Any) -> Numbers:
        try:
            return make(parameters)
        except (ArithmeticError, ValueError) as error:
            raise ParameterError(
                f"some parameter of {self.title} is too large or too small to compute with ({error})"
            ) from None

    def _fill(self, block: Block, index: int, dtype: np.dtype[Any], values: Numbers, what: str) -> None:
        names = dtype.names or ()
        if set(values) != set(names):
            odd = ", ".join(sorted(set(values) ^ set(names)))
            raise PartError(f"{self.title}: the values of its {what} and the fields of the record differ: {odd}")
        if names:
            target = record_at(block, index, dtype)
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


def assembled(family: str, kind: str, own: Mapping[str, tuple[Part, ...]]) -> Assembled:
    """The part of `family` called `kind`; `own` are the parts that compiled code knows, by family."""
    return Assembled(registry.find(family, kind), kind, own[family])
