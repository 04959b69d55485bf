"""A rough surface by its spectrum and a seed: self-affine with a roll-off, periodic."""

import math
from functools import lru_cache
from typing import Annotated

import numpy as np
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray
from pydantic import Field

from ..core.elementary import power_each, square
from ..core.fourier import filtered
from ..core.random_numbers import RandomStream
from ..core.schema import Positive, Unit
from ..parts.groups import SampleParameters
from ..parts.part import Tree
from .mapped import MapScales, Relief, map_sample, relief

_HEIGHTS = 2000
"""Stream of the random numbers of heights."""


class Rough(SampleParameters):
    """Random heights of power spectral density (1 + (q xi)^2)^-(1 + H), cut off at the shortest wave."""

    kind: str = Field("rough", description="the sample")
    rms: Annotated[Positive, Unit("m")] = Field(1e-9, description="rms height")
    correlation: Annotated[Positive, Unit("m")] = Field(50e-9, description="correlation length xi")
    hurst: Annotated[float, Gt(0), Le(1)] = Field(0.8, description="Hurst exponent H")
    shortest: Annotated[Positive, Unit("m")] = Field(20e-9, description="shortest wave; it must span 4 pixels")
    size: Annotated[Positive, Unit("m")] = Field(1e-6, description="side of the square, after which it repeats")
    pixels: Annotated[int, Ge(16), Le(2048)] = Field(256, description="pixels along a side")
    surface_seed: Annotated[int, Ge(0)] = Field(1, description="seed of the heights")
    dilate: bool = Field(True, description="dilate by the tip; else a surface sharper than the tip is refused")


def heights(sample: Rough) -> NDArray[np.float64]:
    """Heights (pixels, pixels) [m]."""
    n = sample.pixels
    white = RandomStream(sample.surface_seed, _HEIGHTS).standard_normal((n, n))
    waves = np.arange(n)
    q = 2.0 * np.pi / sample.size * np.minimum(waves, n - waves)
    q2 = square(q)[:, None] + square(q)[None, :]
    amplitude = power_each((1.0 + q2 * square(sample.correlation)).ravel(), -0.5 * (1.0 + sample.hurst)).reshape(n, n)
    amplitude[(q2 == 0.0) | (q2 > square(2.0 * np.pi / sample.shortest))] = 0.0
    z = filtered(white, amplitude)
    return np.asarray(z * (sample.rms / math.sqrt(math.fsum(square(z).ravel()) / z.size)))


def _of(parameters: Tree) -> Relief:
    scales = parameters.scales
    return _made(parameters.sample, parameters.plant.radius_of_tip(parameters), scales.x0, scales.z0)


@lru_cache(maxsize=4)
def _made(sample: Rough, R: float, x0: float, z0: float) -> Relief:
    return relief(
        heights(sample), sample.size, sample.size, wrap=True, dilate=sample.dilate, R=R, scales=MapScales(x0, z0)
    )


def _check(parameters: Tree) -> None:
    sample = parameters.sample
    if sample.shortest < 4.0 * sample.size / sample.pixels:
        raise ValueError(
            f"sample.shortest = {sample.shortest:g} m is not allowed: it must span 4 pixels of "
            f"sample.size / sample.pixels = {sample.size / sample.pixels:.3g} m"
        )
    if sample.shortest > sample.size:
        raise ValueError(f"sample.shortest = {sample.shortest:g} m is not allowed: it must be <= sample.size")
    _of(parameters)


ROUGH = map_sample("rough", Rough, _of, _check)
