"""A part's function as a C function, to be called by its address: how compiled code reaches a part that it was not
compiled with (`afm_model.parts.dispatch`).
"""

import ctypes
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba import types as _types

from . import jit
from .records import Record, numbers_at, record_at, size

types: Any = _types

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
