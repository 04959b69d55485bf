"""Sine and cosine of one angle by one call of the C library.

A C compiler makes this call out of `sin` and `cos` of the same argument; numba makes two. The values are the same, to
the last bit: where the C library has no such function, and without compilation, they come from `math`.
"""

import ctypes
import math
from typing import Any

from numba import types as _types
from numba.core import cgutils as _cgutils
from numba.core import funcdesc as _funcdesc
from numba.extending import intrinsic, overload

types: Any = _types
cgutils: Any = _cgutils
funcdesc: Any = _funcdesc
_PAIR = types.UniTuple(types.float64, 2)
_POINTER = types.CPointer(types.float64)
_SINCOS = funcdesc.ExternalFunctionDescriptor("sincos", types.void, (types.float64, _POINTER, _POINTER))


def sincos(x: float) -> tuple[float, float]:
    """(sin x, cos x)."""
    return math.sin(x), math.cos(x)


def _call(typing_context: Any, x: Any) -> Any:
    """Type and code of the call, as numba wants them."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double = context.get_value_type(types.float64)
        sine, cosine = cgutils.alloca_once(builder, double), cgutils.alloca_once(builder, double)
        function = context.declare_external_function(builder.module, _SINCOS)
        context.call_external_function(builder, function, _SINCOS.argtypes, [arguments[0], sine, cosine])
        return context.make_tuple(builder, _PAIR, [builder.load(sine), builder.load(cosine)])

    return _PAIR(types.float64), generate


_sincos: Any = intrinsic(_call)


@overload(sincos)
def _compiled(x):  # type: ignore[no-untyped-def]  # numba compares this signature with that of the implementation
    if hasattr(ctypes.CDLL(None), "sincos"):
        return lambda x: _sincos(x)
    return lambda x: (math.sin(x), math.cos(x))
