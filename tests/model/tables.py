"""Records as plain arrays, for tests that compute with several fields at once."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]


def columns(records: Any, *names: str) -> _Array:
    """Some fields side by side: of n records (n, fields), of one record (fields,)."""
    return np.stack([records[name] for name in names], axis=-1)


def numbers(records: Any) -> _Array:
    """All numbers of n records, (n, numbers of a record)."""
    return np.asarray(records).view(np.float64).reshape(len(records), records.dtype.itemsize // 8)


def record_of(dtype: Any, **values: Any) -> Any:
    """A record with these values, and zero in its other fields."""
    made = np.zeros(1, dtype)[0]
    for name, value in values.items():
        made[name] = value
    return made


def array_of(record: Any) -> _Array:
    """The numbers of one record, as the interfaces of the model take it; writing one writes the other."""
    return np.asarray(record).reshape(1).view(np.float64)


def negated(records: Any, *names: str) -> Any:
    """A copy with the sign of some fields turned."""
    other = records.copy()
    for name in names:
        other[name] = -records[name]
    return other
