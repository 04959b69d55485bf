"""Records of many instruments at once, for the same kernels: number i of lane l stands at [i * LANES + l] of one array.

A kernel that says `s.X += half * s.V_X` takes such a record in place of a pointer; compiled in a loop over the lanes it
becomes vector code. What LLVM needs for it: a constant number of lanes, one flat array, no call that is not inlined, no
integer division; and the information that no lane touches what another one writes.
"""

import operator
from typing import Any

import llvmlite.binding as _binding
import numpy as np
from llvmlite import ir as _ir
from numba import types as _types
from numba.core import cgutils as _cgutils
from numba.core.imputils import builtin_registry as _registry
from numba.core.typing import templates as _templates
from numba.extending import NativeValue as _NativeValue
from numba.extending import infer_getattr, intrinsic, models, overload, register_model, typeof_impl
from numba.extending import unbox as _unbox_of

from .pieces import INLINED
from .records import Record, data_pointer, size

ir: Any = _ir
types: Any = _types
registry: Any = _registry
binding: Any = _binding
templates: Any = _templates
cgutils: Any = _cgutils
native_value: Any = _NativeValue
_unbox: Any = _unbox_of

LANES = 32
"""In a block: with more, its numbers leave the first caches of a processor."""
AT_ONCE = 16
"""Lanes in vectors at a time: several vectors, so that divisions of one wait at the same time as those of another.
A kernel that marks lanes is long, and its numbers would not stay in the registers of a processor: half as many.
"""
_POINTER = ir.DoubleType().as_pointer()
_WORD = ir.IntType(64)
binding.set_option("", "-runtime-memory-check-threshold=512")


class Own(Record):
    """What a lane knows of the block of its instrument, where it knows it."""

    address: int  # of that block: element i of a LaneBlock is number i of it
    plant_map: int  # where in it the map of the plant begins
    marked: float  # 1.0: this step needs the routine of an instrument alone, see ways.py


class Lanes:
    """What a block of lanes holds, known when it is compiled for.

    Parameters
    ----------
    name : str
        Two that differ in what follows have different names.
    records : dict
        Record types by the name by which kernels find them, in the order in which they stand.
    functions : dict
        Kernels by the name by which other kernels find them: `m.plant_step(...)` of a block of lanes m.
    fixed : dict
        Fields `record.field` that are the same in all lanes, and their values: a choice between ways of computing
        takes no time then, and the way not taken is not compiled.
    marks : bool
        Whether kernels mark lanes, see ways.py.
    """

    def __init__(
        self,
        name: str,
        records: dict[str, type[Record]],
        functions: dict[str, Any],
        fixed: dict[str, float],
        marks: bool = False,
    ) -> None:
        self.name, self.records, self.functions, self.fixed = name, records, functions, fixed
        self.marks = marks
        self.at_once = 8 if marks else AT_ONCE
        self.places: dict[str, int] = {}
        end = 0
        for each, record in records.items():
            self.places[each] = end
            end += size(record)
        self.size = end
        """Numbers of a lane."""


class _Composition(types.Opaque):  # type: ignore[misc]
    def __init__(self, lanes: Lanes) -> None:
        self.lanes = lanes
        super().__init__(f"Lanes({lanes.name})")


class _Typed(types.Type):  # type: ignore[misc]
    """A pointer to a number of one lane; `lanes` and what else is known of it."""

    def __init__(self, lanes: Lanes, what: str = "") -> None:
        self.lanes, self.what = lanes, what
        super().__init__(f"{type(self).__name__}({lanes.name}, {what})")


class LaneBlock(_Typed):
    """All records of a lane."""


class LaneRecord(_Typed):
    """One of them, `what`."""


class LaneVector(_Typed):
    """A field of it that is a vector."""


class KeptRecord(_Typed):
    """A LaneRecord, and whether what is written to it changes nothing."""


class KeptVector(_Typed):
    """A field of it that is a vector."""


register_model(_Composition)(models.OpaqueModel)


@register_model(LaneBlock)
@register_model(LaneRecord)
@register_model(LaneVector)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        make: Any = super().__init__
        make(manager, kind, _POINTER)


@register_model(KeptRecord)
@register_model(KeptVector)
class _KeptModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        make: Any = super().__init__
        make(manager, kind, ir.LiteralStructType([_POINTER, ir.IntType(1)]))


@typeof_impl.register(Lanes)
def _typeof(value: Lanes, context: Any) -> Any:
    return _Composition(value)


def _unboxed(kind: Any, value: Any, c: Any) -> Any:
    return native_value(c.context.get_dummy_value())


_unbox(_Composition)(_unboxed)


def _moved(builder: Any, pointer: Any, places: int) -> Any:
    return builder.gep(pointer, [_WORD(places * LANES)], inbounds=True)


def _field(kind: Any, name: str) -> tuple[Any, int]:
    """Numpy type and place of a field."""
    found: Any = kind.lanes.records[kind.what].dtype.fields[name]
    return found[0], found[1] // 8


@infer_getattr
class _BlockAttributes(templates.AttributeTemplate):  # type: ignore[misc]
    key = LaneBlock

    def generic_resolve(self, kind: Any, name: str) -> Any:
        if name in kind.lanes.functions:
            return types.Dispatcher(kind.lanes.functions[name])
        return LaneRecord(kind.lanes, name) if name in kind.lanes.records else None


def _of_block(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    if name in kind.lanes.functions:
        return context.get_dummy_value()
    return _moved(builder, value, kind.lanes.places[name])


registry.lower_getattr_generic(LaneBlock)(_of_block)


@infer_getattr
class _CompositionAttributes(templates.AttributeTemplate):  # type: ignore[misc]
    key = _Composition

    def resolve_marks(self, kind: Any) -> Any:
        return types.boolean


def _marks(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    return context.get_constant(types.boolean, kind.lanes.marks)


registry.lower_getattr(_Composition, "marks")(_marks)


class _Attributes(templates.AttributeTemplate):  # type: ignore[misc]
    def generic_resolve(self, kind: Any, name: str) -> Any:
        if name not in kind.lanes.records[kind.what].names:
            return None
        numpy_type, _ = _field(kind, name)
        if numpy_type.shape:
            vector = KeptVector if isinstance(kind, KeptRecord) else LaneVector
            return vector(kind.lanes, f"{kind.what}.{name}")
        return types.int64 if numpy_type == np.int64 else types.float64


@infer_getattr
class _RecordAttributes(_Attributes):
    key = LaneRecord


@infer_getattr
class _KeptAttributes(_Attributes):
    key = KeptRecord


def _get(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    numpy_type, place = _field(kind, name)
    fixed = kind.lanes.fixed.get(f"{kind.what}.{name}")
    if fixed is not None:
        return _WORD(int(fixed)) if numpy_type == np.int64 else ir.Constant(ir.DoubleType(), fixed)
    at = _moved(builder, value, place)
    if numpy_type.shape:
        return at
    return builder.load(builder.bitcast(at, _WORD.as_pointer()) if numpy_type == np.int64 else at)


def _stored(context: Any, builder: Any, signature: Any, value: Any, base: Any, name: str) -> tuple[Any, Any]:
    """What is to be stored in a field of the record at `base`, and where."""
    kind, given = signature.args
    numpy_type, place = _field(kind, name)
    at = _moved(builder, base, place)
    if numpy_type == np.int64:
        return context.cast(builder, value, given, types.int64), builder.bitcast(at, _WORD.as_pointer())
    return context.cast(builder, value, given, types.float64), at


def _set(context: Any, builder: Any, signature: Any, arguments: Any, name: str) -> None:
    builder.store(*_stored(context, builder, signature, arguments[1], arguments[0], name))


def _get_kept(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    pointer = builder.extract_value(value, 0)
    found = _get(context, builder, kind, pointer, name)
    return builder.insert_value(value, found, 0) if _field(kind, name)[0].shape else found


def _set_kept(context: Any, builder: Any, signature: Any, arguments: Any, name: str) -> None:
    pointer = builder.extract_value(arguments[0], 0)
    _store_kept(builder, arguments[0], *_stored(context, builder, signature, arguments[1], pointer, name))


def _store_kept(builder: Any, kept: Any, value: Any, at: Any) -> None:
    builder.store(builder.select(builder.extract_value(kept, 1), builder.load(at), value), at)


registry.lower_getattr_generic(LaneRecord)(_get)
registry.lower_setattr_generic(LaneRecord)(_set)
registry.lower_getattr_generic(KeptRecord)(_get_kept)
registry.lower_setattr_generic(KeptRecord)(_set_kept)


def _element(builder: Any, vector: Any, index: Any) -> Any:
    return builder.gep(vector, [builder.mul(index, _WORD(LANES))], inbounds=True)


def _item_of(typing_context: Any, vector: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_element(builder, arguments[0], arguments[1]))

    return types.float64(vector, types.int64), generate


def _put_into(typing_context: Any, vector: Any, index: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[2], _element(builder, arguments[0], arguments[1]))
        return context.get_dummy_value()

    return types.void(vector, types.int64, types.float64), generate


def _kept_item_of(typing_context: Any, vector: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_element(builder, builder.extract_value(arguments[0], 0), arguments[1]))

    return types.float64(vector, types.int64), generate


def _put_into_kept(typing_context: Any, vector: Any, index: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        at = _element(builder, builder.extract_value(arguments[0], 0), arguments[1])
        _store_kept(builder, arguments[0], arguments[2], at)
        return context.get_dummy_value()

    return types.void(vector, types.int64, types.float64), generate


def _number_of(typing_context: Any, address: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer = builder.inttoptr(arguments[0], _POINTER)
        found = builder.load(builder.gep(pointer, [arguments[1]], inbounds=True))
        # Nothing in a loop over lanes writes to the block of an instrument.
        found.set_metadata("invariant.load", builder.module.add_metadata([]))
        return found

    return types.float64(types.int64, types.int64), generate


_item: Any = intrinsic(_item_of)
_put: Any = intrinsic(_put_into)
_kept_item: Any = intrinsic(_kept_item_of)
_kept_put: Any = intrinsic(_put_into_kept)
_number: Any = intrinsic(_number_of)


@overload(operator.getitem, jit_options=INLINED)
def _getitem(vector, index):  # type: ignore[no-untyped-def]  # numba compares this with the implementation
    if isinstance(vector, LaneBlock):
        return lambda vector, index: _number(vector.own.address, index)
    if isinstance(vector, KeptVector):
        return lambda vector, index: _kept_item(vector, index)
    return (lambda vector, index: _item(vector, index)) if isinstance(vector, LaneVector | LaneRecord) else None


@overload(operator.setitem, jit_options=INLINED)
def _setitem(vector, index, value):  # type: ignore[no-untyped-def]  # as above
    if isinstance(vector, KeptVector):
        return lambda vector, index, value: _kept_put(vector, index, value)
    return (lambda vector, index, value: _put(vector, index, value)) if isinstance(vector, LaneVector) else None


class _Distinct(ir.MDValue):  # type: ignore[misc]
    """A node of metadata that is equal to no other."""

    def descr(self, buffer: Any) -> None:
        buffer += ("distinct !{}", "\n")

    __eq__, __ne__, __hash__ = object.__eq__, object.__ne__, object.__hash__


def _of_no_other_lane(builder: Any, known: set[int]) -> Any:
    """Mark all accesses to memory but the known ones: no lane touches what another one writes."""
    module = builder.module
    group = _Distinct(module, (), str(len(module.metadata)))
    for block in builder.function.blocks:
        for each in block.instructions:
            if id(each) not in known and each.opname in ("call", "load", "store"):
                each.set_metadata("llvm.access.group", group)
    return module.add_metadata(["llvm.loop.parallel_accesses", group])


def for_lanes(body: Any) -> Any:
    """A function for compiled code that calls the kernel `body(m, i, f)` for each lane m of a block (size * LANES,):
    `each(lanes, block, i, f)`, i an int and f a float.

    The loop gives the compiler the number of lanes to take at once.
    """

    def each(typing_context: Any, lanes: Any, block: Any, i: Any, f: Any) -> Any:
        function = typing_context.resolve_value_type(body)
        called = function.get_call_type(typing_context, (LaneBlock(lanes.lanes), types.int64, types.float64), {})

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            pointer = data_pointer(context, builder, block, arguments[1])
            call = context.get_function(function, called)
            context.add_linking_libs(getattr(call, "libs", ()))
            known = {id(each) for block in builder.function.blocks for each in block.instructions}
            with cgutils.for_range(builder, _WORD(LANES)) as loop:
                call(builder, (builder.gep(pointer, [loop.index], inbounds=True), *arguments[2:]))
            # Where it cannot see that itself: numbers are read from the blocks of the instruments, too.
            apart = _of_no_other_lane(builder, known)
            module = builder.module
            hint = module.add_metadata(["llvm.loop.vectorize.width", ir.Constant(ir.IntType(32), lanes.lanes.at_once)])
            # Before the body is compiled into it the loop looks short enough to be written out.
            whole = module.add_metadata(["llvm.loop.unroll.disable"])
            loop_of = module.add_metadata([hint, whole, apart, builder.function.name])
            # What names a loop begins with itself.
            loop_of.operands = (loop_of, hint, whole, apart)
            latch = loop.index.incomings[-1][1]
            latch.terminator.set_metadata("llvm.loop", loop_of)
            return context.get_dummy_value()

        return types.void(lanes, block, types.int64, types.float64), generate

    return intrinsic(each)
