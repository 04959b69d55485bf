"""Statistics of the layers of a scan as a table, in text and as CSV."""

import csv
import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..core.prefix import prefixed
from ..microscope.image import Image, as_image
from . import level
from .layers import Layer, description, layers
from .result_files import replacing

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Figures:
    """Statistics of one layer, in its unit, over the measured pixels; NaN if no pixel is measured."""

    layer: str
    title: str
    unit: str
    measured: float  # part of the pixels, 0 to 1
    mean: float
    median: float
    least: float
    largest: float
    rms: float  # about the mean
    rms_levelled: float  # about the plane of least squares; of a height its roughness, Sq


def figures(image: "Image | xarray.Dataset") -> list[Figures]:
    """The figures of every layer of a scan."""
    return [_figures(each) for each in layers(image)]


def _figures(found: Layer) -> Figures:
    seen = found.values[found.measured]
    if not len(seen):
        return Figures(found.name, found.title, found.unit, 0.0, *(math.nan,) * 6)
    flat = level.plane(found.values)[found.measured]
    return Figures(
        found.name,
        found.title,
        found.unit,
        float(found.measured.mean()),
        float(seen.mean()),
        float(np.median(seen)),
        float(seen.min()),
        float(seen.max()),
        float(seen.std()),
        float(np.sqrt(np.mean(flat**2))),
    )


_COLUMNS = ("mean", "median", "least", "largest", "rms", "rms_levelled")


def text_table(image: "Image | xarray.Dataset") -> str:
    """The notes of a scan and its figures, to be read by people."""
    image = as_image(image)
    notes = description(image)
    wide = max(map(len, notes))
    rows = [["layer", "unit", "measured", *(name.replace("rms_levelled", "rms less plane") for name in _COLUMNS)]]
    for each in figures(image):
        numbers = [getattr(each, name) for name in _COLUMNS]
        factor, unit = prefixed(each.unit, *numbers)
        rows.append([each.title, unit, f"{each.measured:.1%}", *(f"{number * factor:.5g}" for number in numbers)])
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = [f"{name:<{wide}}  {value}" for name, value in notes.items()] + [""]
    for row in rows:
        first = [f"{cell:<{width}}" for cell, width in zip(row[:2], widths, strict=False)]
        rest = [f"{cell:>{width}}" for cell, width in zip(row[2:], widths[2:], strict=True)]
        lines.append("  ".join(first + rest).rstrip())
    return "\n".join(lines) + "\n"


def write_table(path: Path | str, image: "Image | xarray.Dataset") -> Path:
    """Write the figures of a scan: .csv with numbers in SI units, .txt as text to be read.

    Parameters
    ----------
    path : Path or str
        Ends with .csv or .txt. A file of this name is replaced once the new one is whole.
    image : Image, or its labelled arrays

    Raises
    ------
    ResultFileError
        If it cannot be written.
    """
    suffix = ".txt" if Path(path).suffix.lower() == ".txt" else ".csv"
    with replacing(path, suffix) as beside, beside.open("w", encoding="utf-8", newline="") as file:
        if suffix == ".txt":
            file.write(text_table(image))
        else:
            table = csv.DictWriter(file, [each.name for each in fields(Figures)])
            table.writeheader()
            table.writerows(asdict(each) for each in figures(image))
    return Path(path)
