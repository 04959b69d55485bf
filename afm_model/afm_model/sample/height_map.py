"""Make a sample from a height map in a file, with a map of materials in addition."""

import math
from functools import lru_cache
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ..core.schema import NonNegative, Positive, Unit
from ..parts.groups import SampleParameters
from ..parts.part import Tree
from .map_files import file_stamp, read_field
from .mapped import MapScales, Relief, map_sample, relief


class HeightMap(SampleParameters):
    """Heights from a file. The middle of the map is at x = y = 0."""

    kind: str = Field("map", description="the sample")
    file: str = Field("", description="height map: .npy, .gsf, .gwy, .sxm or an image")
    width: Annotated[NonNegative, Unit("m")] = Field(0.0, description="size along x; 0: that of the file")
    length: Annotated[NonNegative, Unit("m")] = Field(0.0, description="size along y; 0: that of the file, or as x")
    height_unit: Annotated[Positive, Unit("m")] = Field(
        1.0, description="height of one unit of the file; of an image, of white over black"
    )
    border: Literal["mirror", "wrap"] = Field("mirror", description="continuation beyond the map")
    dilate: bool = Field(True, description="dilate by the tip; else a surface sharper than the tip is refused")
    strength_file: str = Field("", description="map of the friction strength over that of the plant; none: 1")
    adhesion_file: str = Field("", description="map of the work of adhesion over that of the plant; none: 1")
    modulus_file: str = Field("", description="map of the elastic modulus over that of the plant; none: 1")


_MATERIALS = ("strength_file", "adhesion_file", "modulus_file")


def _of(parameters: Tree) -> Relief:
    sample, scales = parameters.sample, parameters.scales
    files = (sample.file, *(getattr(sample, name) for name in _MATERIALS))
    if not sample.file:
        raise ValueError(
            "sample.file is not given: sample.kind = map needs a height map (.npy, .gsf, .gwy, .sxm, image)"
        )
    changed = tuple(file_stamp(path) if path else 0 for path in files)
    return _made(sample, parameters.plant.radius_of_tip(parameters), scales.x0, scales.z0, changed)


@lru_cache(maxsize=4)
def _made(sample: HeightMap, R: float, x0: float, z0: float, changed: tuple[int, ...]) -> Relief:
    field = read_field(sample.file)
    rows, columns = field.values.shape
    width = sample.width or field.width
    length = sample.length or (field.height if not sample.width else 0.0) or width * rows / columns
    if width <= 0.0:
        raise ValueError(f"sample.width is not given, and {sample.file} does not contain its size")
    materials = None
    if any(getattr(sample, name) for name in _MATERIALS):
        found = []
        for name in _MATERIALS:
            path = getattr(sample, name)
            values = read_field(path).values if path else np.ones((rows, columns))
            if values.shape != (rows, columns):
                raise ValueError(
                    f"sample.{name} = {path} is {values.shape} and must be {(rows, columns)}, as the heights"
                )
            if values.min() < 0.0 or (name != "strength_file" and values.min() == 0.0) or values.max() > 1e6:
                raise ValueError(
                    f"sample.{name} = {path} holds {values.min():g} to {values.max():g}: a ratio must be positive, "
                    "and at most 1e6"
                )
            found.append(values)
        materials = tuple(found)
    for what, pixel in (("x", width / columns), ("y", length / rows)):
        if not 1e-13 <= pixel <= 1e-3:
            raise ValueError(
                f"{sample.file}: a pixel of {pixel:.3g} m along {what} is not allowed: it must be 0.1 pm to 1 mm"
            )
    highest = float(np.abs(field.values).max()) * sample.height_unit
    if not highest <= 1e-2:
        raise ValueError(
            f"{sample.file}: a height of {highest:.3g} m is not allowed: it must be at most 10 mm; sample.height_unit "
            "is the height of one unit of the file"
        )
    heights = field.values * sample.height_unit
    return relief(
        heights - math.fsum(heights.ravel()) / heights.size,
        width,
        length,
        wrap=sample.border == "wrap",
        dilate=sample.dilate,
        R=R,
        scales=MapScales(x0, z0),
        materials=materials,
    )


def _check(parameters: Tree) -> None:
    _of(parameters)


MAP = map_sample("map", HeightMap, _of, _check)
