"""What a tick of a recording takes, and what is new in it: the table of docs/recording.md.

    python tools/measure_sizes.py out/demo/recording.rrd

Bytes a tick of each kind of column: plain; under LZ4, as rerun writes a file; under zstd; and under zstd after the step
of lowest size among differences of order 0 to 3 of the numbers as whole ones, their bytes sorted by place.
"""

import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from afm_recorder_node import layout
from afm_recorder_node.complete import chunks, series

_LZ4, _ZSTD = pa.Codec("lz4_raw"), pa.Codec("zstd", 3)


def size(codec: pa.Codec, content: bytes) -> int:
    """Of the content under a codec [bytes]."""
    return len(codec.compress(content, asbytes=True))


def predicted(values: NDArray[np.float64]) -> int:
    """Size of one column when each number is told by those before it [bytes]."""
    found, whole = [], values.view(np.int64)
    for _ in range(4):
        # Small ones of either sign become small ones without a sign.
        places = ((whole << 1) ^ (whole >> 63)).view(np.uint8).reshape(-1, 8).T
        found.append(size(_ZSTD, np.ascontiguousarray(places).tobytes()))
        whole = np.diff(whole, prepend=np.int64(0))
    return min(found)


def main() -> None:
    """Print the table."""
    ticks, sums = 0, defaultdict[str, list[int]](lambda: [0, 0, 0, 0])

    def add(kind: str, content: bytes, least: int = 0) -> None:
        for place, number in enumerate((len(content), size(_LZ4, content), size(_ZSTD, content), least)):
            sums[kind][place] += number

    for chunk in chunks(Path(sys.argv[1])):
        batch = chunk.to_record_batch()
        rows = None if chunk.is_static else series(batch)
        if rows is None or chunk.entity_path.startswith(layout.PARAMETERS):
            continue
        times, values = rows
        width = len(values) // len(times)
        columns = values.reshape(-1, width).T
        tick = chunk.entity_path in {signal.entity for signal in layout.TICKS}
        ticks += len(times) if chunk.entity_path == layout.ROUND_TRIP.entity else 0
        add("numbers of the tick" if tick else "samples", values.tobytes(), sum(predicted(c.copy()) for c in columns))
        add("times", times.tobytes())
        add("identifiers", b"".join(each.as_py() for each in batch.column("rerun.controls.RowId")))
        add("offsets", np.arange(0, len(values) + 1, width, dtype=np.int32).tobytes())
    for kind, found in sums.items():
        print(f"{kind:20s}", *(f"{each / ticks:8.1f}" for each in found))
    print(f"{'all':20s}", *(f"{sum(found) / ticks:8.1f}" for found in zip(*sums.values(), strict=True)))


if __name__ == "__main__":
    main()
