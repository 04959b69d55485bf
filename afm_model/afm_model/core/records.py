"""Numbers by name: records that are laid into one float64 array, for kernels and for Python alike.

A record type is a list of names; each is one number of 8 bytes, or a few in a row. `record_at` reads it in place at an
index of the array: no copy, no offset written by hand, and in compiled code no more than a pointer.
"""

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np
from llvmlite import ir as _ir
from numba import types as _types
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

ir: Any = _ir
types: Any = _types

Block = NDArray[np.float64]


def record(
    *fields: str,
    vectors: tuple[str, ...] = (),
    integers: tuple[str, ...] = (),
    arrays: Mapping[str, tuple[int, ...]] | None = None,
) -> np.dtype[Any]:
    """Type of a record.

    Parameters
    ----------
    *fields : str
        Names, in the order in which they stand.
    vectors, integers : tuple of str
        Those that are three numbers (x, y, z), and those that are whole numbers.
    arrays : mapping of str to tuple of int, optional
        Shapes of those that are arrays.

    Returns
    -------
    dtype
        Every number takes 8 bytes.

    Raises
    ------
    ValueError
        If a name stands twice, or is given as a vector, an integer or an array only.
    """
    shapes = {name: (3,) for name in vectors} | dict(arrays or {})
    if unknown := [name for name in (*shapes, *integers) if name not in fields]:
        raise ValueError(f"{', '.join(unknown)} must also be one of the fields {', '.join(fields)}")
    described: list[Any] = []
    for name in fields:
        kind = np.int64 if name in integers else np.float64
        described.append((name, kind, shapes[name]) if name in shapes else (name, kind))
    return np.dtype((np.record, described))


EMPTY = np.dtype((np.record, []))
"""The record of a part that has no constants, or no state."""


def size(dtype: np.dtype[Any]) -> int:
    """How many places of a float64 array a record takes."""
    return dtype.itemsize // 8


def place(dtype: np.dtype[Any], field: str) -> int:
    """Where in a record a field begins, in places of a float64 array."""
    fields: Any = dtype.fields or {}
    return int(fields[field][1]) // 8


def record_at(block: Block, index: int, dtype: np.dtype[Any]) -> Any:
    """The record of type `dtype` that begins at `block[index]`: reading and writing its fields is reading and writing
    the array.
    """
    if not dtype.names:
        return np.zeros((), dtype)[()]
    return block[index : index + size(dtype)].view(dtype)[0]


def data_pointer(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Where the numbers of an array stand; a pointer is there already."""
    return context.make_array(kind)(context, builder, value).data if isinstance(kind, types.Array) else value


def _at(typing_context: Any, block: Any, index: Any, dtype: Any) -> Any:
    """Type and code of `record_at`, as numba wants them."""
    kind = dtype.dtype

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values, at, _ = arguments
        place = builder.gep(data_pointer(context, builder, block, values), [at], inbounds=True)
        return builder.bitcast(place, context.get_value_type(kind))

    return kind(block, types.intp, dtype), generate


_record_at: Any = intrinsic(_at)


@overload(record_at, jit_options={"forceinline": True})
def _compiled(block, index, dtype):  # type: ignore[no-untyped-def]  # numba compares this with the implementation
    return lambda block, index, dtype: _record_at(block, index, dtype)


def pointer_at(block: Block, index: int) -> Block:
    """The numbers from `block[index]` on, as a kernel of a part takes them."""
    return block[index:]


def _pointer(typing_context: Any, block: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values, at = arguments
        return builder.gep(data_pointer(context, builder, block, values), [at], inbounds=True)

    return types.CPointer(types.float64)(block, types.intp), generate


_pointer_at: Any = intrinsic(_pointer)


@overload(pointer_at, jit_options={"forceinline": True})
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


@overload(numbers_of, jit_options={"forceinline": True})
def _compiled_numbers_of(record):  # type: ignore[no-untyped-def]
    return lambda record: _numbers_of(record)


def address_at(block: Block, index: int) -> int:
    """Where in memory `block[index]` stands, for `numbers_at`."""
    return block[index:].ctypes.data


def _address(typing_context: Any, block: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values, at = arguments
        place = builder.gep(data_pointer(context, builder, block, values), [at], inbounds=True)
        return builder.ptrtoint(place, context.get_value_type(types.int64))

    return types.int64(block, types.intp), generate


_address_at: Any = intrinsic(_address)


@overload(address_at, jit_options={"forceinline": True})
def _compiled_address(block, index):  # type: ignore[no-untyped-def]
    return lambda block, index: _address_at(block, index)


def numbers_at(address: int, count: int) -> Block:
    """The `count` float64 numbers at an address: an array of any length that is kept beside a block.

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


@overload(numbers_at, jit_options={"forceinline": True})
def _compiled_numbers(address, count):  # type: ignore[no-untyped-def]
    return lambda address, count: _numbers_at(address)
