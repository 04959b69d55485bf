"""Claims about records: arrays of any length are read by the address that stands in one."""

import numpy as np

from afm_model.core.jit import kernel
from afm_model.core.records import numbers_at, record, record_at, size

CURVE = record("address", "count", integers=("address", "count"))
POINT = record("x", "y")


@kernel
def _sum(block, out):
    c = record_at(block, 0, CURVE)
    numbers = numbers_at(c.address, 2 * c.count)
    out[0] = 0.0
    for i in range(c.count):
        point = record_at(numbers, 2 * i, POINT)
        out[0] += point.x * point.y
        numbers[2 * i] = -1.0


def test_kernel_reads_and_writes_an_array_of_any_length_by_its_address():
    for called in (_sum, getattr(_sum, "py_func", _sum)):
        for count in (1, 7, 1000):
            curve = np.arange(2.0 * count)
            expected = float(curve[0::2] @ curve[1::2])
            block, out = np.zeros(size(CURVE)), np.zeros(1)
            record_at(block, 0, CURVE).address = curve.ctypes.data
            record_at(block, 0, CURVE).count = count
            called(block, out)
            assert out[0] == expected
            assert (curve[0::2] == -1.0).all()
