"""A sample of your own from a height map, sample.kind height_map:HEIGHT_MAP. Cubic B-splines, periodic."""

from typing import Annotated

import numpy as np
from scipy.ndimage import spline_filter

from afm_model.parts import Field, Record, Sample, SampleParameters, Unit, kernel


class HeightMap(SampleParameters):
    file: str = Field("map.npy", description="square array of heights [m], rows along y (.npy)")
    size: Annotated[float, Unit("m")] = Field(50e-9, gt=0, description="side of the map")


class Constants(Record):
    n: int
    pitch: Annotated[float, "x0"]


def load(parameters):
    return spline_filter(np.load(parameters.sample.file) / parameters.scales.z0, 3, mode="grid-wrap")


def values(parameters):
    n = len(np.load(parameters.sample.file, mmap_mode="r"))
    return {"n": n, "pitch": parameters.sample.size / n / parameters.scales.x0}


@kernel
def weights(f, order):
    """Of four neighbours, for the value (order 0), its slope (1) or curvature (2) at fraction f."""
    g = 1.0 - f
    if order == 0:
        return g**3 / 6.0, 2.0 / 3.0 - f * f + 0.5 * f**3, 2.0 / 3.0 - g * g + 0.5 * g**3, f**3 / 6.0
    if order == 1:
        return -0.5 * g * g, -2.0 * f + 1.5 * f * f, 2.0 * g - 1.5 * g * g, 0.5 * f * f
    return g, -2.0 + 3.0 * f, -2.0 + 3.0 * g, f


@kernel
def derivative(x, y, p, map, order_x, order_y):
    i, j = int(np.floor(x / p.pitch)), int(np.floor(y / p.pitch))
    w_x, w_y = weights(x / p.pitch - i, order_x), weights(y / p.pitch - j, order_y)
    total = 0.0
    for b in range(4):
        for a in range(4):
            total += w_y[b] * w_x[a] * map[((j - 1 + b) % p.n) * p.n + (i - 1 + a) % p.n]
    return total / p.pitch ** (order_x + order_y)


@kernel
def surface(x, y, h, p, map):
    h.height, h.curvature_xy, h.strength = derivative(x, y, p, map, 0, 0), derivative(x, y, p, map, 1, 1), 1.0
    h.slope_x, h.slope_y = derivative(x, y, p, map, 1, 0), derivative(x, y, p, map, 0, 1)
    h.curvature_xx, h.curvature_yy = derivative(x, y, p, map, 2, 0), derivative(x, y, p, map, 0, 2)
    h.curvature = -0.5 * (h.curvature_xx + h.curvature_yy)


HEIGHT_MAP = Sample(parameters=HeightMap, constants=Constants, values=values, map=load, surface=surface)
