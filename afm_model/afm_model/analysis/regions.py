"""Numbers from an image: roughness, and the contrast between two regions, such as two materials in a friction image."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .estimate import Estimate, correlated_mean

_Array = NDArray[np.float64]
_Mask = NDArray[np.bool_]
_SEPARATE = 0.8
"""Part of the variance that a split must explain: a normal distribution cut in the middle gives 0.64, an even one 0.75,
two equal levels four times their noise apart 0.8."""
_BINS = 256


class Contrast(NamedTuple):
    """Two regions of an image, in its unit."""

    first: Estimate  # mean
    second: Estimate
    ratio: Estimate  # second over first
    lines: int  # lines in which there are both


def two_levels(image: ArrayLike, margin: int = 3, smooth: float = 2.0) -> tuple[_Mask, _Mask]:
    """Masks of the low and the high region of an image, split where their variance is least (Otsu 1979).

    Parameters
    ----------
    image : array_like (lines, pixels)
        Lines that were not measured are NaN, and belong to none of both.
    margin : int
        Pixels next to the other region that are left out of both.
    smooth : float [pixel]
        Width of the Gaussian by which the image is smoothed for the split, so that noise does not choose the region of
        a pixel; 0: not at all.

    Raises
    ------
    ValueError
        If the image has not two levels, or `margin` leaves nothing of one.
    """
    from scipy.ndimage import binary_erosion, gaussian_filter  # here: no recorder needs them

    split: _Array = _image(image)
    there = np.isfinite(split)
    if smooth > 0.0 and there.any():
        weight = gaussian_filter(there.astype(float), smooth)
        split = gaussian_filter(np.where(there, split, 0.0), smooth) / np.where(there, weight, 1.0)
    values = split[there]
    if values.size < 4 or values.min() == values.max():
        raise ValueError("the image has not two levels: all of its values are equal")
    counts, edges = np.histogram(values, _BINS)
    middles = 0.5 * (edges[1:] + edges[:-1])
    below, total = np.cumsum(counts)[:-1], counts.sum()
    sums = np.cumsum(counts * middles)
    part = below / total
    # Variance between the classes for each place of the cut, over the whole variance.
    between = (sums[-1] * part - sums[:-1]) ** 2 / np.maximum(part * (1.0 - part), 1e-12) / total**2
    best = float(between.max())
    # Between two far levels every cut is as good: the middle one is taken.
    cuts = np.flatnonzero(between >= best * (1.0 - 1e-9))
    cut = 0.5 * (edges[cuts[0] + 1] + edges[cuts[-1] + 1])
    explained = best / float(np.sum(counts * (middles - sums[-1] / total) ** 2) / total)
    if explained < _SEPARATE:
        raise ValueError(
            f"the image has not two levels: a split explains {100.0 * explained:.0f} % of its variance, and must "
            f"explain {100.0 * _SEPARATE:.0f} %; give masks"
        )
    masks = []
    for side in (there & (split <= cut), there & (split > cut)):
        # The image is continued beyond its borders, and beyond missing lines, by its value there.
        inside = side if margin < 1 else binary_erosion(side | ~there, iterations=margin, border_value=1) & there
        if not inside.any():
            raise ValueError(f"margin = {margin} leaves nothing of one region: take less")
        masks.append(inside)
    return masks[0], masks[1]


def contrast(image: ArrayLike, first: ArrayLike, second: ArrayLike) -> Contrast:
    """Means of two regions and their ratio.

    Noise along a line is correlated. So the mean of a region in a line counts as one value, and values of successive
    lines by their own correlation. Both are of the same lines: what is common to a line, as a drift of the zero, is in
    both, and the uncertainty of the ratio is that of the ratio line by line.

    Parameters
    ----------
    image : array_like (lines, pixels)
        Friction, that is half the difference of trace and retrace: a zero that is wrong makes a wrong ratio.
    first, second : array_like of bool (lines, pixels)
        Masks, as from `two_levels`.

    Raises
    ------
    ValueError
        If shapes do not agree, a region is empty, or no line has both.
    """
    image = _image(image)
    masks = [np.asarray(each, bool) for each in (first, second)]
    if any(each.shape != image.shape for each in masks):
        raise ValueError(f"image {image.shape} and masks {masks[0].shape}, {masks[1].shape} must have the same shape")
    masks = [each & np.isfinite(image) for each in masks]
    both = masks[0].any(axis=1) & masks[1].any(axis=1)
    if not both.any():
        raise ValueError("no line has both regions: turn the image, or give other masks")
    of_line = [np.array([image[i, each[i]].mean() for i in np.flatnonzero(both)]) for each in masks]
    one, two = (correlated_mean(each) for each in of_line)
    # Of the ratio r of the means: mean of (second - r first) / first.
    r = two.value / one.value
    left = correlated_mean((of_line[1] - r * of_line[0]) / one.value)
    return Contrast(one, two, Estimate(r, left.uncertainty), int(both.sum()))


def _image(image: ArrayLike) -> _Array:
    made = np.asarray(image, np.float64)
    if made.ndim != 2:
        raise ValueError(f"an image has lines and pixels: this one has the shape {made.shape}")
    return made


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
    image = _image(heights)
    i, j = np.nonzero(np.isfinite(image))
    if i.size < 4:
        raise ValueError(f"a plane needs at least four pixels: there are {i.size}")
    columns = np.stack([np.ones(i.size), i / image.shape[0], j / image.shape[1]], axis=1)
    z = image[i, j]
    left = z - columns @ np.linalg.lstsq(columns, z, rcond=None)[0]
    return Roughness(float(np.abs(left).mean()), math.sqrt(float(np.mean(left**2))), float(np.ptp(left)))
