"""Roughness of an image."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike


class Roughness(NamedTuple):
    """Of heights over their mean plane (ISO 25178-2, without filters), in the unit of the heights."""

    Sa: float  # mean of the absolute heights
    Sq: float  # root of the mean square
    Sz: float  # from the lowest to the highest


def roughness(heights: ArrayLike) -> Roughness:
    """Roughness of an image, its mean plane taken off.

    Parameters
    ----------
    heights : array_like (lines, pixels) [m]
        What was not measured is NaN and does not count.

    Raises
    ------
    ValueError
        If fewer than four pixels are there.
    """
    image = np.asarray(heights, np.float64)
    if image.ndim != 2:
        raise ValueError(f"an image has lines and pixels: this one has the shape {image.shape}")
    i, j = np.nonzero(np.isfinite(image))
    if i.size < 4:
        raise ValueError(f"a plane takes at least four pixels: {i.size} are there")
    columns = np.stack([np.ones(i.size), i / image.shape[0], j / image.shape[1]], axis=1)
    z = image[i, j]
    left = z - columns @ np.linalg.lstsq(columns, z, rcond=None)[0]
    return Roughness(float(np.abs(left).mean()), math.sqrt(float(np.mean(left**2))), float(np.ptp(left)))
