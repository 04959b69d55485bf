"""The 64 bits of a float64 as an integer and back, for kernels and for Python."""

import struct
from typing import Any

from llvmlite import ir as _ir
from numba import types as _types
from numba.extending import intrinsic, overload

from .pieces import INLINED

ir: Any = _ir
types: Any = _types


def bits_of(x: float) -> int:
    """Return the 64 bits of a number as a signed integer."""
    return int(struct.unpack("<q", struct.pack("<d", x))[0])


def from_bits(i: int) -> float:
    """Return the number that has these bits."""
    return float(struct.unpack("<d", struct.pack("<Q", i & 0xFFFFFFFFFFFFFFFF))[0])


def _cast(to: Any, of: Any, code: Any) -> Any:
    """Make an intrinsic that takes the bits of one type as another."""

    def typed(typing_context: Any, value: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.bitcast(arguments[0], code)

        return to(of), generate

    return intrinsic(typed)


_to_integer: Any = _cast(types.int64, types.float64, ir.IntType(64))
_to_float: Any = _cast(types.float64, types.int64, ir.DoubleType())


@overload(bits_of, jit_options=INLINED)
def _compiled_bits(x):  # type: ignore[no-untyped-def]  # numba compares this signature with that of the implementation
    return lambda x: _to_integer(x)


@overload(from_bits, jit_options=INLINED)
def _compiled_from_bits(i):  # type: ignore[no-untyped-def]  # as above
    return lambda i: _to_float(i)
