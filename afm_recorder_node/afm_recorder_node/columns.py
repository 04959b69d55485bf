"""Columns of a recording as arrays of numpy."""

from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray


def numbers(column: pa.Array) -> NDArray[Any]:
    """The numbers of a column, without a copy.

    pyarrow's own `to_numpy` imports pandas where that is installed, for half a second and 30 MB.

    Raises
    ------
    ValueError
        If one is missing.
    """
    if column.null_count:
        raise ValueError(f"{column.null_count} of {len(column)} numbers are missing")
    return np.from_dlpack(column)
