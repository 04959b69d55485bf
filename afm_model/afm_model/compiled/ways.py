"""Kernels that go one way for an instrument alone and another in lanes (lanes.py), by the block m that they are given.

What is seldom and long is not computed in lanes. A lane that needs it is marked (`rare`). It goes on with numbers that
mean nothing, and writes none of them to what the next step begins with (`kept`): the routine of an instrument alone
makes its step.
"""

from collections.abc import Callable
from typing import Any

from llvmlite import ir as _ir
from numba import types as _types
from numba.extending import intrinsic, overload

from .jit import plain
from .lanes import KeptRecord, LaneBlock, LaneRecord
from .pieces import INLINED

ir: Any = _ir
types: Any = _types


def by_lane(alone: Callable[..., Any], in_lane: Callable[..., Any]) -> Any:
    """A function for kernels: `alone`, but where a block of lanes is among the arguments `in_lane`."""

    def chosen(*arguments: Any) -> Any:
        # Compiled, it would return a copy of a record in place of the record.
        return plain(alone)(*arguments)

    @overload(chosen, jit_options=INLINED)
    def _compiled(*arguments):  # type: ignore[no-untyped-def]  # numba compares this with the implementation
        kinds = arguments[0] if len(arguments) == 1 and isinstance(arguments[0], tuple) else arguments
        function = in_lane if any(isinstance(each, LaneBlock) for each in kinds) else alone
        return lambda *arguments: function(*arguments)

    return chosen


def where(condition: bool, one: Any, other: Any) -> Any:
    """One number or the other, both computed: no branch, round which the compiler would compute one alone."""
    return one if condition else other


def _select_of(typing_context: Any, condition: Any, one: Any, other: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.select(*arguments)

    kind = typing_context.unify_types(types.unliteral(one), types.unliteral(other))
    return kind(types.boolean, kind, kind), generate


_select: Any = intrinsic(_select_of)


@overload(where, jit_options=INLINED)
def _compiled_where(condition, one, other):  # type: ignore[no-untyped-def]  # as above
    return lambda condition, one, other: _select(condition, one, other)


def settled(index: int, m: Any) -> int:
    """The same index, to read from the block m with.

    A compiler for a processor that gathers slowly computes what an address is made of number by number, as far back as
    it finds it without a branch. In lanes there is one here, which is never taken and which it knows nothing about.
    """
    return index


def _settled_of(typing_context: Any, index: Any, address: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        value, whose = arguments
        nobody, before = builder.icmp_unsigned("==", whose, whose.type(0)), builder.block
        with builder.if_then(nobody):
            never = builder.block
        # Were it likely, it would become a choice without a branch.
        before.terminator.set_weights([1, 1000000])
        chosen = builder.phi(value.type)
        chosen.add_incoming(value, before)
        chosen.add_incoming(value.type(0), never)
        return chosen

    return types.int64(types.int64, types.int64), generate


_settled: Any = intrinsic(_settled_of)


@overload(settled, jit_options=INLINED)
def _compiled_settled(index, m):  # type: ignore[no-untyped-def]  # as above
    if isinstance(m, LaneBlock):
        return lambda index, m: _settled(index, m.own.address)
    return lambda index, m: index


def rare(condition: bool, m: Any) -> bool:
    """Whether a condition holds of the instrument m; in lanes False, and the lane in which it does hold is marked.

    For a condition that is False of a NaN, what follows has to mark the lane, or to be as that of an instrument alone.
    """
    return condition


@overload(rare, jit_options=INLINED)
def _compiled_rare(condition, m):  # type: ignore[no-untyped-def]  # as above
    if not isinstance(m, LaneBlock):
        return lambda condition, m: condition

    def marked(condition, m):  # type: ignore[no-untyped-def]
        own = m.own
        own.marked = where(condition, 1.0, own.marked)
        return False

    return marked


def kept(record: Any, m: Any) -> Any:
    """The same record to write to; in a lane that is marked by now, writing changes nothing."""
    return record


def _kept_of(typing_context: Any, record: Any, marked: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        made = ir.Constant(ir.LiteralStructType([arguments[0].type, ir.IntType(1)]), ir.Undefined)
        made = builder.insert_value(made, arguments[0], 0)
        return builder.insert_value(made, arguments[1], 1)

    return KeptRecord(record.lanes, record.what)(record, marked), generate


_kept: Any = intrinsic(_kept_of)


@overload(kept, jit_options=INLINED)
def _compiled_kept(record, m):  # type: ignore[no-untyped-def]  # as above
    if isinstance(record, LaneRecord):
        return lambda record, m: _kept(record, m.own.marked != 0.0)
    return lambda record, m: record
