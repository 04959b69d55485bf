"""A part's function as a C function, to be called by its address: how compiled code reaches a part that it was not
compiled with (`afm_model.parts.dispatch`).
"""

import ctypes
import inspect
import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numba
import numpy as np
from llvmlite import ir as _ir
from numba import types as _types
from numba.core import cgutils as _cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic, overload

from . import jit
from .pieces import INLINED
from .records import Record, data_pointer, numbers_at, record_at, size

ir: Any = _ir
types: Any = _types
cgutils: Any = _cgutils
_WORD = ir.IntType(64)

NUMBER = "number"
"""An argument that is one float64."""
INTEGER = "integer"
"""One int64."""
POINTER = "pointer"
"""An array of float64, of a length that the part knows."""
Argument = type[Record] | str
"""What a family hands to a function: NUMBER, INTEGER, POINTER, or the type of a record."""
_CTYPES: dict[Argument, Any] = {NUMBER: ctypes.c_double, INTEGER: ctypes.c_int64}
_COMPILED_TYPES = {NUMBER: types.float64, INTEGER: types.int64, POINTER: types.CPointer(types.float64)}

PLAIN: dict[int, Callable[..., None]] = {}
"""Functions by address where nothing is compiled (NUMBA_DISABLE_JIT)."""
_COMPILED: dict[Any, Any] = {}
"""What this process has compiled or read from the disk, by function and arguments."""


class Function:
    """A part's function, to be called from compiled code.

    A function made with `afm_model.compiled.jit.kernel` (or `numba.njit`) is compiled for these arguments. Any other
    callable is called as it is, in Python: a microsecond or more a call, and every means of Python.

    Parameters
    ----------
    function : callable
    arguments : tuple
        What it is called with, in order.

    Raises
    ------
    TypeError
        If it cannot be compiled; the message says why in one line.
    """

    def __init__(self, function: Callable[..., Any], arguments: tuple[Argument, ...]) -> None:
        self.error: Exception | None = None
        """What a function in Python has raised; nothing can be raised through compiled code."""
        self._arguments = arguments
        self._records: dict[int, Any] = {}
        self._function = function
        self.compiled = not jit.config.DISABLE_JIT and jit.is_compiled(function)
        if jit.config.DISABLE_JIT:
            self._keep: Any = self._from_arrays
            self.address = id(self)
            PLAIN[self.address] = self._from_arrays
        elif self.compiled:
            self._keep = self._compile(function)
            self.address = int(self._keep.address)
        else:
            kinds = [_CTYPES.get(kind, ctypes.c_void_p) for kind in arguments]
            self._keep = ctypes.CFUNCTYPE(None, *kinds)(self._from_pointers)
            self.address = int(ctypes.cast(self._keep, ctypes.c_void_p).value or 0)

    def _compile(self, function: Any) -> Any:
        known = _COMPILED.get((function, self._arguments))
        if known is not None:
            return known
        kinds = (_COMPILED_TYPES[a] if isinstance(a, str) else numba.from_dtype(a.dtype) for a in self._arguments)
        try:
            made = jit.callback(types.void(*kinds), function.py_func)
        # Besides its own errors numba lets some of Python's through, such as a KeyError for a field that is not there.
        except Exception as error:
            if isinstance(error, KeyError):
                raise TypeError(_unknown_field(function.py_func, error.args[0])) from error
            lines = [line.strip() for line in str(error).splitlines() if line.strip()]
            reason = lines[1] if isinstance(error, numba.core.errors.NumbaError) and len(lines) > 1 else " ".join(lines)
            raise TypeError(f"it cannot be compiled: {type(error).__name__}: {reason}") from error
        _COMPILED[function, self._arguments] = made
        return made

    def _guarded(self, *arguments: Any) -> None:
        if self.error is None:
            try:
                self._function(*arguments)
            except Exception as error:
                self.error = error

    def _from_arrays(self, *given: Any) -> None:
        """Arguments as plain Python hands them over: records of a part as the array from their beginning on."""
        self._guarded(
            *(
                record_at(value, 0, kind) if isinstance(value, np.ndarray) and not isinstance(kind, str) else value
                for kind, value in zip(self._arguments, given, strict=True)
            )
        )

    def _from_pointers(self, *given: Any) -> None:
        self._guarded(*(self._argument(kind, value) for kind, value in zip(self._arguments, given, strict=True)))

    def _argument(self, kind: Argument, value: Any) -> Any:
        if isinstance(kind, str):
            return ctypes.cast(value, ctypes.POINTER(ctypes.c_double)) if kind is POINTER else value
        if not size(kind):
            return None
        # The arrays of an instrument stay where they are: a record is made once.
        known = self._records.get(value)
        if known is None or known.dtype != kind.dtype:
            known = self._records[value] = record_at(numbers_at(value, size(kind)), 0, kind)
        return known


def _unknown_field(function: Callable[..., Any], name: str) -> str:
    """Say that no record has a field of this name, and where the function uses it, as far as its source is there."""
    with suppress(OSError):
        lines, first = inspect.getsourcelines(function)
        for number, line in enumerate(lines, first):
            if re.search(rf"\.{name}\b", line):
                return f"there is no field {name}: {line.strip()} (line {number} of {inspect.getsourcefile(function)})"
    return f"there is no field {name}"


def by_address(
    title: str, kinds: tuple[Argument, ...], address: int, places: dict[Argument, int | None]
) -> Callable[..., None]:
    """Make a function for kernels that calls a part by the address in a block; nothing is called where that is 0.

    It is called with the arguments of the part but those in `places`, then the block.

    Parameters
    ----------
    title : str
        For messages.
    kinds : tuple
        What the part is called with, in order.
    address : int
        Place of its address in the block.
    places : dict
        Arguments that are in the block, by where in it the place of each stands; None: the block itself.
    """

    def dispatched(*arguments: Any) -> None:
        *given, block = arguments
        words, rest = block.view(np.int64), iter(given)
        if words[address]:
            own = {kind: block if at is None else block[words[at] :] for kind, at in places.items()}
            PLAIN[int(words[address])](*(own[kind] if kind in own else next(rest) for kind in kinds))

    def called(typing_context: Any, arguments: Any) -> Any:
        if len(arguments) != len([kind for kind in kinds if kind not in places]) + 1:
            raise TypingError(f"{title} takes other arguments")

        def generate(context: Any, builder: Any, signature: Any, packed: Any) -> Any:
            values = [builder.extract_value(packed[0], i) for i in range(len(arguments))]
            given = iter(zip(arguments, values, strict=True))
            block = data_pointer(context, builder, arguments[-1], values[-1])

            def word(at: int) -> Any:
                return builder.load(builder.bitcast(builder.gep(block, [_WORD(at)], inbounds=True), _WORD.as_pointer()))

            function, passed = word(address), []
            with builder.if_then(builder.icmp_unsigned("!=", function, _WORD(0))):
                for kind in kinds:
                    if kind in places:
                        at = places[kind]
                        value = block if at is None else builder.gep(block, [word(at)], inbounds=True)
                    else:
                        typed, value = next(given)
                        if kind in (NUMBER, INTEGER):
                            passed.append(context.cast(builder, value, typed, _COMPILED_TYPES[kind]))
                            continue
                        value = data_pointer(context, builder, typed, value)
                    passed.append(builder.bitcast(value, cgutils.voidptr_t))
                signature_of = ir.FunctionType(ir.VoidType(), [value.type for value in passed])
                builder.call(builder.inttoptr(function, signature_of.as_pointer()), passed)
            return context.get_dummy_value()

        return types.void(arguments), generate

    compiled: Any = intrinsic(called)

    @overload(dispatched, jit_options=INLINED)
    def _compiled(*arguments):  # type: ignore[no-untyped-def]  # numba compares this with the implementation
        return lambda *arguments: compiled(arguments)

    return dispatched
