"""Claims about records: names of their fields; arrays of any length are read by the address that stands in one."""

import numpy as np
import pytest

from afm_model.compiled.jit import kernel
from afm_model.compiled.records import Record, numbers_at, record_at, size


class Curve(Record):
    address: int
    count: int


class Point(Record):
    x: float
    y: float


@kernel
def _sum(block, out):
    c = record_at(block, 0, Curve)
    numbers = numbers_at(c.address, 2 * c.count)
    out[0] = 0.0
    for i in range(c.count):
        point = record_at(numbers, 2 * i, Point)
        out[0] += point.x * point.y
        numbers[2 * i] = -1.0


def test_kernel_reads_and_writes_an_array_of_any_length_by_its_address():
    for called in (_sum, getattr(_sum, "py_func", _sum)):
        for count in (1, 7, 1000):
            curve = np.arange(2.0 * count)
            expected = float(curve[0::2] @ curve[1::2])
            block, out = np.zeros(size(Curve)), np.zeros(1)
            record_at(block, 0, Curve).address = curve.ctypes.data
            record_at(block, 0, Curve).count = count
            called(block, out)
            assert out[0] == expected
            assert (curve[0::2] == -1.0).all()


def test_field_that_numpy_would_hide_in_plain_python_is_refused():
    with pytest.raises(TypeError, match="record Sums: sum cannot be a field"):
        type("Sums", (Record,), {"__annotations__": {"count": int, "sum": float}})
