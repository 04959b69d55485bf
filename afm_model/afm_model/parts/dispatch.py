"""How compiled code reaches the parts: each function of a family, called by its address in the header of a block.

The compiled loop knows no part, so that it and its cache are the same whatever parts are chosen. What that costs a step
is in docs/architecture.md.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir as _ir
from numba import types as _types
from numba.core import cgutils as _cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic, overload

from ..core.call import INTEGER, NUMBER, PLAIN, Argument
from ..core.jit import kernel
from ..core.pieces import INLINED
from ..core.records import Block, data_pointer, place, record_at
from .header import BlockHeader, LawHeader
from .loop import Onboard
from .part import CONSTANTS, MAP, STATE, WHOLE, Detector, Fault, Law, Part, Piezo, Plant, Program, Sample
from .signals import Displacement, Surface

ir: Any = _ir
types: Any = _types
cgutils: Any = _cgutils
_WORD = ir.IntType(64)
_NUMBERS: dict[Argument, Any] = {NUMBER: types.float64, INTEGER: types.int64}


def dispatcher(family: type[Part], name: str) -> Callable[..., None]:
    """What calls the function `name` of the part of a family that a block holds.

    Called with the arguments of that function but those of the part (its constants, state, map), then the block. A
    part without this function is left alone.
    """
    kinds = family.functions[name]
    header = LawHeader if family is Law else BlockHeader
    address = place(header, f"{family.family}_{name}")
    places: dict[Argument, int | None] = {WHOLE: None}
    places |= {kind: place(header, f"{family.family}_{kind}") for kind in (CONSTANTS, STATE, MAP) if kind in kinds}

    def dispatched(*arguments: Any) -> None:
        *given, block = arguments
        words, rest = block.view(np.int64), iter(given)
        if words[address]:
            own = {kind: block if at is None else block[words[at] :] for kind, at in places.items()}
            PLAIN[int(words[address])](*(own[kind] if kind in own else next(rest) for kind in kinds))

    def called(typing_context: Any, arguments: Any) -> Any:
        if len(arguments) != len([kind for kind in kinds if kind not in places]) + 1:
            raise TypingError(f"{name} of a {family.family} takes other arguments")

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
                        if kind in _NUMBERS:
                            passed.append(context.cast(builder, value, typed, _NUMBERS[kind]))
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


reference, watch = dispatcher(Program, "reference"), dispatcher(Program, "watch")
control = dispatcher(Law, "control")
on_sample, on_command = dispatcher(Fault, "on_sample"), dispatcher(Fault, "on_command")
on_drive, on_measurement = dispatcher(Fault, "on_drive"), dispatcher(Fault, "on_measurement")
actuate = dispatcher(Piezo, "actuate")
regulate = dispatcher(Onboard, "regulate")
step, observe = dispatcher(Plant, "step"), dispatcher(Plant, "observe")
detect = dispatcher(Detector, "detect")
_surface = dispatcher(Sample, "surface")


@kernel
def _surface_of_block(x: float, y: float, m: Block) -> Any:
    g = record_at(m, 0, BlockHeader)
    h = record_at(m, g.surface, Surface)
    h.adhesion = h.modulus = h.viscosity = h.tension = 1.0
    d = record_at(m, g.displacement, Displacement)
    if d.there != 0:
        x -= d.x
        y -= d.y
    _surface(x, y, h, m)
    if d.there != 0:
        h.strength *= d.friction
        h.height += d.z
    return h


def surface_of(x: float, y: float, m: Block) -> Any:
    """See `surface`; a block of lanes (core/lanes.py) has another one."""
    return _surface_of_block(x, y, m)


@overload(surface_of, jit_options=INLINED)
def _compiled_surface(x, y, m):  # type: ignore[no-untyped-def]  # numba compares this with the implementation
    return (lambda x, y, m: _surface_of_block(x, y, m)) if isinstance(m, types.Array | types.CPointer) else None


@kernel
def surface(x: float, y: float, m: Block) -> Any:
    """The sample of the block m at (x, y) [x0], as a record of Surface that the next call writes over."""
    return surface_of(x, y, m)
