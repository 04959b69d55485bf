"""The lines of scans, as they are recorded and as they make an image again. Needs no ROS."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr

from afm_model.microscope.image import Image, Line
from afm_model.microscope.verbs import Scan

from .columns import numbers


@dataclass(frozen=True)
class ScanLine:
    """One direction of one line, and the scan that it belongs to."""

    number: int
    """Of the scan, since the start of the instrument."""
    scan: Scan
    line: Line
    units: dict[str, str]
    """SI unit of each channel."""

    @property
    def time_ns(self) -> int:
        """Simulated time at which its first pixel began [ns]."""
        return round(self.line.time * 1e9)


def columns(line: ScanLine) -> list[rr.ComponentColumn]:
    """A line as one row of the recording, in SI units."""
    about = {
        "channels": line.units,
        "time": line.line.time,
        "scan": line.scan.model_dump(),
    }
    numbers = np.concatenate([np.asarray(line.line.channels[name], dtype=np.float64) for name in line.units])
    return [
        *rr.AnyValues.columns(
            scan=[line.number], index=[line.line.index], direction=[line.line.direction], about=[json.dumps(about)]
        ),
        *rr.AnyValues.columns(data=numbers).partition([len(numbers)]),
    ]


def images(batches: Iterable[pa.RecordBatch]) -> dict[int, Image]:
    """Images by the number of the scan, whole or as far as they came, from rows of `columns`."""
    made: dict[int, Image] = {}
    for line in sorted(_lines(batches), key=lambda line: (line.number, line.line.number)):
        if line.number not in made:
            made[line.number] = Image.empty(line.scan, line.units)
        made[line.number].put(line.line)
    for image in made.values():
        image.date()
    return made


def _lines(batches: Iterable[pa.RecordBatch]) -> Iterable[ScanLine]:
    for batch in batches:
        columns = [batch.column(name).to_pylist() for name in ("scan", "index", "direction", "about")]
        for *head, about, data in zip(*columns, batch.column("data"), strict=True):
            number, index, direction = (value[0] for value in head)
            told: dict[str, Any] = json.loads(about[0])
            units = dict(told["channels"])
            values = numbers(data.values).reshape(len(units), -1)
            line = Line(index, direction, told["time"], dict(zip(units, values, strict=True)))
            yield ScanLine(number, Scan(**told["scan"]), line, units)
