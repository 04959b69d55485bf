"""Calling a part's function by its address: how compiled code reaches a part that it was not compiled with.

Our own parts are chosen by a number and compiled into the loop; a part of somebody else's is an address. Choosing by
address costs a few nanoseconds a call and, unlike functions handed over as values or closures over them, leaves the
compiled loop and its cache as they are (measured: docs/architecture.md).
"""

import ctypes
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir as _ir
from numba import types as _types
from numba.core import cgutils as _cgutils
from numba.extending import intrinsic, overload

from . import jit
from .records import record_at, size

ir: Any = _ir
types: Any = _types
cgutils: Any = _cgutils

NUMBER = "number"
"""An argument that is one float64."""
POINTER = "pointer"
"""An argument that is an array of float64, of a length that the part knows."""
Argument = np.dtype[Any] | str
"""What a family hands to a function: NUMBER, POINTER, or the type of a record."""

_PLAIN: dict[int, Callable[..., None]] = {}
"""Functions by address where nothing is compiled (NUMBA_DISABLE_JIT)."""


def call(address: int, arguments: tuple[Any, ...]) -> None:
    """Call the function at `address` (from `Function`)."""
    _PLAIN[address](*arguments)


def _call(typing_context: Any, address: Any, arguments: Any) -> Any:
    """Type and code of `call`: records and arrays go as pointers, numbers as they are."""

    def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        place, packed = given
        values = [builder.extract_value(packed, i) for i in range(len(arguments))]
        values = [
            builder.bitcast(value, cgutils.voidptr_t) if isinstance(value.type, ir.PointerType) else value
            for value in values
        ]
        kind = ir.FunctionType(ir.VoidType(), [value.type for value in values])
        builder.call(builder.inttoptr(place, kind.as_pointer()), values)
        return context.get_dummy_value()

    return types.void(types.int64, arguments), generate


_call_compiled: Any = intrinsic(_call)


@overload(call, jit_options={"forceinline": True})
def _compiled(address, arguments):  # type: ignore[no-untyped-def]  # numba compares this with the implementation
    return lambda address, arguments: _call_compiled(address, arguments)


class Function:
    """A part's function, to be called from compiled code.

    A function made with `afm_model.core.jit.kernel` (or `numba.njit`) is compiled for these arguments. Any other
    callable is called as it is, in Python: a microsecond or more a call, and every means of Python.

    Parameters
    ----------
    function : callable
    arguments : tuple
        What it is called with, in order.

    Raises
    ------
    TypeError
        If it cannot be compiled; the message tells why in one line.
    """

    def __init__(self, function: Callable[..., Any], arguments: tuple[Argument, ...]) -> None:
        self.error: Exception | None = None
        """What a function in Python has raised; nothing can be raised through compiled code."""
        self._arguments = arguments
        self._records: dict[int, Any] = {}
        self._function = function
        if jit.config.DISABLE_JIT:
            self._keep: Any = self._from_arrays
            self.address = id(self)
            _PLAIN[self.address] = self._from_arrays
        elif jit.is_compiled(function):
            self._keep = self._compile(function)
            self.address = int(self._keep.address)
        else:
            kinds = [ctypes.c_double if kind is NUMBER else ctypes.c_void_p for kind in arguments]
            self._keep = ctypes.CFUNCTYPE(None, *kinds)(self._from_pointers)
            self.address = int(ctypes.cast(self._keep, ctypes.c_void_p).value or 0)

    def _compile(self, function: Any) -> Any:
        kinds = {NUMBER: types.float64, POINTER: types.CPointer(types.float64)}
        signature = types.void(*(kinds[a] if isinstance(a, str) else numba.from_dtype(a) for a in self._arguments))
        try:
            return jit.callback(signature, function.py_func)
        # Besides its own errors numba lets some of Python's through, such as a KeyError for a field that is not there.
        except Exception as error:
            lines = [line.strip() for line in str(error).splitlines() if line.strip()]
            told = lines[1] if isinstance(error, numba.core.errors.NumbaError) and len(lines) > 1 else " ".join(lines)
            raise TypeError(f"it cannot be compiled: {type(error).__name__}: {told}") from error

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
                record_at(value, 0, kind) if isinstance(value, np.ndarray) and isinstance(kind, np.dtype) else value
                for kind, value in zip(self._arguments, given, strict=True)
            )
        )

    def _from_pointers(self, *given: Any) -> None:
        self._guarded(*(self._argument(kind, value) for kind, value in zip(self._arguments, given, strict=True)))

    def _argument(self, kind: Argument, value: Any) -> Any:
        if kind is NUMBER:
            return value
        if kind is POINTER:
            return ctypes.cast(value, ctypes.POINTER(ctypes.c_double))
        assert isinstance(kind, np.dtype)
        if not size(kind):
            return None
        # The arrays of an instrument stay where they are: a record is made once.
        known = self._records.get(value)
        if known is None or known.dtype != kind:
            numbers = np.ctypeslib.as_array((ctypes.c_double * size(kind)).from_address(value))
            known = self._records[value] = numbers.view(kind)[0]
        return known
