"""Numbers by name: records that are laid into one float64 array, for kernels and for Python alike.

A record is declared once, as a class:

    class State(Record):
        integral: Annotated[float, "m"]
        position: Annotated[Vector, "m"]  # three numbers
        sequence: int
        horizon: Annotated[Array, (512, 3), "V"]

Every number takes 8 bytes. `record_at` reads a record in place at an index of the array: no copy, no offset written by
hand, and in compiled code no more than a pointer. No object of the class is ever made: it stands for the type, and
numba takes it for its `dtype`.
"""

import ctypes
import inspect
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar, get_args

import numba
import numpy as np
from llvmlite import ir as _ir
from numba import types as _types
from numba.extending import intrinsic, overload, typeof_impl
from numpy.typing import NDArray

from .pieces import INLINED

ir: Any = _ir
types: Any = _types

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Vector = Annotated[Array, (3,)]
"""Three numbers: x, y, z."""
Block = Array
"""An array in which records stand."""


class _RecordType(type):
    """Makes the numpy type of a record from its annotations, after those of its bases."""

    dtype: np.dtype[Any]

    def __init__(cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any]) -> None:
        super().__init__(name, bases, namespace)
        cls.fields: dict[str, tuple[type, tuple[int, ...], str]] = {}
        """Of each field: int64 or float64, its shape, its unit."""
        for base in bases:
            cls.fields |= getattr(base, "fields", {})
        for field, annotation in inspect.get_annotations(cls, eval_str=True).items():
            kind, *described = get_args(annotation) if hasattr(annotation, "__metadata__") else (annotation,)
            shape = next((each for each in described if isinstance(each, tuple)), ())
            unit = next((each for each in described if isinstance(each, str)), "")
            cls.fields[field] = (np.int64 if kind in (int, Integers) else np.float64, shape, unit)
        # In plain Python (NUMBA_DISABLE_JIT) numpy would give its own attribute in place of the field.
        if hidden := [field for field in cls.fields if hasattr(np.record, field)]:
            raise TypeError(f"record {name}: {', '.join(hidden)} cannot be a field: numpy's records have it")
        cls.dtype = np.dtype((np.record, [(field, kind, shape) for field, (kind, shape, _) in cls.fields.items()]))

    @property
    def names(cls) -> tuple[str, ...]:
        """Of the fields, in the order in which they stand."""
        return tuple(cls.fields)


class Record(metaclass=_RecordType):
    """Base of records; by itself that of a part without constants, or without a state."""

    handed_over = False
    """Set in a base of states of laws: if one such law takes the place of another in a run, these fields go on."""

    if TYPE_CHECKING:  # What numpy's records offer besides their fields.

        def copy(self) -> Self:
            """Return a separate record with the same numbers."""

        def __getitem__(self, field: str) -> Any: ...

        def __setitem__(self, field: str, value: Any) -> None: ...


_R = TypeVar("_R", bound=Record)


@typeof_impl.register(_RecordType)
def _typeof(value: _RecordType, context: Any) -> Any:
    return types.DType(numba.from_dtype(value.dtype))


def size(record: type[Record]) -> int:
    """How many places of a float64 array a record takes."""
    return record.dtype.itemsize // 8


def place(record: type[Record], field: str) -> int:
    """Where in a record a field begins, in places of a float64 array."""
    fields: Any = record.dtype.fields
    return int(fields[field][1]) // 8


def record_at(block: Block | Integers, index: int, record: type[_R]) -> _R:
    """The record that begins at `block[index]`: reading and writing its fields is reading and writing the array."""
    found: Any = block[index : index + size(record)].view(record.dtype) if record.fields else np.zeros(1, record.dtype)
    return found[0]


def data_pointer(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Where the numbers of an array stand; a pointer is there already."""
    return context.make_array(kind)(context, builder, value).data if isinstance(kind, types.Array) else value


def _at(typing_context: Any, block: Any, index: Any, record: Any) -> Any:
    """Type and code of `record_at`, as numba wants them."""
    kind = record.dtype

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values, at, _ = arguments
        place = builder.gep(data_pointer(context, builder, block, values), [at], inbounds=True)
        return builder.bitcast(place, context.get_value_type(kind))

    return kind(block, types.intp, record), generate


_record_at: Any = intrinsic(_at)


@overload(record_at, jit_options=INLINED)
def _compiled(block, index, record):  # type: ignore[no-untyped-def]  # numba compares this with the implementation
    return lambda block, index, record: _record_at(block, index, record)


def pointer_at(block: Block, index: int) -> Block:
    """The numbers from `block[index]` on, as a kernel of a part takes them."""
    return block[index:]


def _pointer(typing_context: Any, block: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values, at = arguments
        return builder.gep(data_pointer(context, builder, block, values), [at], inbounds=True)

    return types.CPointer(types.float64)(block, types.intp), generate


_pointer_at: Any = intrinsic(_pointer)


@overload(pointer_at, jit_options=INLINED)
def _compiled_pointer(block, index):  # type: ignore[no-untyped-def]
    return lambda block, index: _pointer_at(block, index)


def numbers_of(record: Any) -> Block:
    """The numbers of a record, in place."""
    return np.asarray(record).reshape(1).view(np.float64)


def _of_record(typing_context: Any, record: Any) -> Any:
    pointer = types.CPointer(types.float64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.bitcast(arguments[0], context.get_value_type(pointer))

    return pointer(record), generate


_numbers_of: Any = intrinsic(_of_record)


@overload(numbers_of, jit_options=INLINED)
def _compiled_numbers_of(record):  # type: ignore[no-untyped-def]
    return lambda record: _numbers_of(record)


def address_at(block: Block, index: int) -> int:
    """Address of `block[index]`, for `numbers_at`."""
    return block[index:].ctypes.data


def _address(typing_context: Any, block: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values, at = arguments
        place = builder.gep(data_pointer(context, builder, block, values), [at], inbounds=True)
        return builder.ptrtoint(place, context.get_value_type(types.int64))

    return types.int64(block, types.intp), generate


_address_at: Any = intrinsic(_address)


@overload(address_at, jit_options=INLINED)
def _compiled_address(block, index):  # type: ignore[no-untyped-def]
    return lambda block, index: _address_at(block, index)


def numbers_at(address: int, count: int) -> Block:
    """The `count` float64 numbers at an address: an array of any length that is kept outside a block.

    Its address (`array.ctypes.data`) stands in an integer field of a record. Whoever puts it there keeps the array
    alive, and where it is, for as long as a kernel may read it. Compiled, this is the pointer alone, to be indexed or
    handed to `record_at` and `pointer_at`; nothing checks `count`.
    """
    return np.ctypeslib.as_array((ctypes.c_double * count).from_address(int(address)))


def _numbers(typing_context: Any, address: Any) -> Any:
    kind = types.CPointer(types.float64)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(kind))

    return kind(types.int64), generate


_numbers_at: Any = intrinsic(_numbers)


@overload(numbers_at, jit_options=INLINED)
def _compiled_numbers(address, count):  # type: ignore[no-untyped-def]
    return lambda address, count: _numbers_at(address)
