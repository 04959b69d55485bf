"""Samples that are maps: heights as cubic B-splines, so that slopes and curvatures are consistent, and materials.

A surface sharper than the tip is dilated first, that is replaced by the path of the apex of a spherical tip that rolls
over it; or it is refused, with the place.
"""

import math
from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import kernel, plain
from ..compiled.records import Block, Record
from ..core.elementary import square
from ..core.splines import b_spline_coefficients, weighted
from ..parts.groups import SampleParameters
from ..parts.part import Sample, Tree
from ..parts.signals import Surface
from .dilation import dilated, offsets_under

_Array = NDArray[np.float64]
FINER = 3
"""Dilation is done on a grid so much finer: curvatures are then right to some percent of that of the tip."""
_MOST_WORK = 4e10
"""Comparisons for a dilation: a minute of processor time."""
LEAST_RADIUS, LARGEST_RADIUS = 0.25, 4.0
"""Bounds of R_e / R on a dilated map: in a kink the tip touches at two places, which is no contact of one radius."""


_THERE = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)
"""Weights of a cubic B-spline's coefficients for its value at a node."""


class Constants(Record):
    columns: int
    rows: int
    pitch_x: Annotated[float, "m"]
    pitch_y: Annotated[float, "m"]
    wrap: float  # 1.0: the map is repeated; 0.0: mirrored at its borders
    materials: float  # 1.0: strengths, adhesions and moduli follow the heights
    dilated: float
    R: Annotated[float, "m"]  # radius of the tip
    x0: Annotated[float, "m"]
    z0: Annotated[float, "m"]


class MapScales(NamedTuple):
    """Of the sample's coordinates, to be part of the key of a cache."""

    x0: float
    z0: float


class Relief(NamedTuple):
    """A map ready for the kernel."""

    numbers: _Array  # spline coefficients of heights [m]; strengths; adhesions; moduli
    constants: dict[str, float]
    amplitude: float  # half of the range of heights [m]
    curvature: float  # largest |mean curvature| [1/m]
    contrast: tuple[float, float]  # least and largest (w/w_0)^2 R_e/R (K_0/K)^2


def relief(
    heights: _Array,
    width: float,
    length: float,
    *,
    wrap: bool,
    dilate: bool,
    R: float,
    scales: Any,
    materials: tuple[_Array, ...] | None = None,
) -> Relief:
    """A map for the kernel.

    Parameters
    ----------
    heights : ndarray (rows, columns) [m]
        The middle of the map is at x = y = 0; rows go along y.
    width, length : float [m]
        Along x and y.
    wrap : bool
        Repeat it; else mirror it at its borders.
    dilate : bool
        By a tip of radius R.
    materials : (ndarray, ndarray, ndarray), optional
        Friction strength, work of adhesion and modulus over those of the plant, of the same shape.

    Raises
    ------
    ValueError
        If the tip would touch a surface that is not to be dilated in more than one point.
    """
    rows, columns = heights.shape
    pitch_x, pitch_y = width / columns, length / rows
    if dilate:
        heights = _dilated(heights, pitch_x, pitch_y, R, wrap)
    coefficients = b_spline_coefficients(heights, wrap)
    # Second derivatives of the spline at its nodes.
    bend = (1.0, -2.0, 1.0)
    second_x = weighted(coefficients, _THERE, bend, wrap) / square(pitch_x)
    second_y = weighted(coefficients, bend, _THERE, wrap) / square(pitch_y)
    curvature = -0.5 * (second_x + second_y)
    if dilate:
        ratio = np.clip(1.0 - curvature * R, LEAST_RADIUS, LARGEST_RADIUS)
    else:
        if (worst := float(curvature.min())) * R <= -1.0:
            row, column = (int(index) for index in np.unravel_index(int(curvature.argmin()), curvature.shape))
            raise ValueError(
                f"the sample is sharper than the tip at x = {(column - columns // 2) * pitch_x:.4g} m, y = "
                f"{(row - rows // 2) * pitch_y:.4g} m: its radius of curvature there is {-1.0 / worst:.3g} m and must "
                f"be > {R:.3g} m: take a sharper tip, or sample.dilate"
            )
        ratio = 1.0 / (1.0 + curvature * R)
    material = materials[1] / materials[2] if materials is not None else np.ones((1, 1))
    low, high = float(ratio.min()) * square(float(material.min())), float(ratio.max()) * square(float(material.max()))
    constants = {
        "columns": columns,
        "rows": rows,
        "pitch_x": pitch_x,
        "pitch_y": pitch_y,
        "wrap": float(wrap),
        "materials": float(materials is not None),
        "dilated": float(dilate),
        "R": R,
        "x0": scales.x0,
        "z0": scales.z0,
    }
    parts = [coefficients, *(materials or ())]
    return Relief(
        numbers=np.concatenate([np.asarray(part, np.float64).ravel() for part in parts]),
        constants=constants,
        amplitude=0.5 * float(np.ptp(heights)),
        curvature=float(np.abs(1.0 / ratio - 1.0).max()) / R,
        contrast=(min(low, 1.0), max(high, 1.0)),
    )


def _dilated(heights: _Array, pitch_x: float, pitch_y: float, R: float, wrap: bool) -> _Array:
    """Largest height of the surface plus tip over all places under the tip, on a finer grid."""
    # Centres of fine pixels: the middle one of each coarse pixel is its centre.
    coefficients = b_spline_coefficients(heights, wrap)
    fine = np.empty((FINER * heights.shape[0], FINER * heights.shape[1]))
    places = [plain(_weights)((i - FINER // 2) / FINER % 1.0) for i in range(FINER)]
    for i, along_y in enumerate(places):
        for j, along_x in enumerate(places):
            low_y, low_x = i < FINER // 2, j < FINER // 2
            fine[i::FINER, j::FINER] = weighted(coefficients, _about(along_y, low_y), _about(along_x, low_x), wrap)
    step_x, step_y = pitch_x / FINER, pitch_y / FINER
    offsets, ball = offsets_under(R, float(np.ptp(fine)), step_x, step_y)
    if (work := len(ball) * heights.size) > _MOST_WORK:
        raise ValueError(
            f"a map of {heights.shape[1]} x {heights.shape[0]} values of {pitch_x:.3g} x {pitch_y:.3g} m is too fine "
            f"to be dilated by a tip of {R:.3g} m ({work:.2g} comparisons, {_MOST_WORK:.0e} are allowed): "
            "give it fewer values, or sample.dilate = false"
        )
    return dilated(fine, FINER, offsets, ball, wrap)


def _about(weights: tuple[float, ...], low: bool) -> tuple[float, ...]:
    """Of five neighbours about a pixel; the four weights begin one below it, or two if the place is `low`."""
    return (*weights, 0.0) if low else (0.0, *weights)


@kernel
def _index(i: int, n: int, wrap: float) -> int:
    """Pixel i of a map of n that is repeated, or mirrored at its first and last pixel."""
    if wrap != 0.0:
        return i % n
    i = abs(i) % (2 * (n - 1))
    return i if i < n else 2 * (n - 1) - i


@kernel
def _weights(f: float) -> tuple[float, float, float, float]:
    """Of four neighbours at fraction f between the middle two."""
    g = 1.0 - f
    f2, g2 = f * f, g * g
    return g2 * g / 6.0, 2.0 / 3.0 - f2 + 0.5 * f2 * f, 2.0 / 3.0 - g2 + 0.5 * g2 * g, f2 * f / 6.0


@kernel
def surface(x: float, y: float, h: Surface, p: Constants, values: Block) -> None:
    """See `afm_model.parts.Sample`."""
    u = x * p.x0 / p.pitch_x + p.columns // 2
    v = y * p.x0 / p.pitch_y + p.rows // 2
    i, j = math.floor(u), math.floor(v)
    f, g = u - i, v - j
    a0, a1, a2, a3 = _weights(f)
    b0, b1, b2, b3 = -0.5 * square(1.0 - f), -2.0 * f + 1.5 * f * f, 0.0, 0.5 * f * f
    b2 = -(b0 + b1 + b3)
    c0, c1, c2, c3 = 1.0 - f, 3.0 * f - 2.0, 1.0 - 3.0 * f, f
    i0, i1 = _index(i - 1, p.columns, p.wrap), _index(i, p.columns, p.wrap)
    i2, i3 = _index(i + 1, p.columns, p.wrap), _index(i + 2, p.columns, p.wrap)
    w0, w1, w2, w3 = _weights(g)
    height = slope_x = slope_y = curved_x = curved_y = twist = 0.0
    for n in range(4):
        # Weights along y of this row, for value, slope and curvature.
        if n == 0:
            w, s, c = w0, -0.5 * square(1.0 - g), 1.0 - g
        elif n == 1:
            w, s, c = w1, -2.0 * g + 1.5 * g * g, 3.0 * g - 2.0
        elif n == 2:
            w, s, c = w2, 2.0 * (1.0 - g) - 1.5 * square(1.0 - g), 1.0 - 3.0 * g
        else:
            w, s, c = w3, 0.5 * g * g, g
        row = _index(j - 1 + n, p.rows, p.wrap) * p.columns
        z0, z1, z2, z3 = values[row + i0], values[row + i1], values[row + i2], values[row + i3]
        value = a0 * z0 + a1 * z1 + a2 * z2 + a3 * z3
        rise = b0 * z0 + b1 * z1 + b2 * z2 + b3 * z3
        height += w * value
        slope_x += w * rise
        slope_y += s * value
        curved_x += w * (c0 * z0 + c1 * z1 + c2 * z2 + c3 * z3)
        curved_y += c * value
        twist += s * rise
    curved_x /= p.pitch_x * p.pitch_x
    curved_y /= p.pitch_y * p.pitch_y
    mean = -0.5 * (curved_x + curved_y)
    if p.dilated != 0.0:
        # Of the path of the apex: R_e = R (1 - mean R), told as the curvature of which docs/lever.md (8) makes it.
        ratio = min(max(1.0 - mean * p.R, LEAST_RADIUS), LARGEST_RADIUS)
        mean = (1.0 / ratio - 1.0) / p.R
    lateral, scale = p.x0 / p.z0, p.x0 * p.x0 / p.z0
    h.height = height / p.z0
    h.slope_x, h.slope_y = slope_x / p.pitch_x * lateral, slope_y / p.pitch_y * lateral
    h.curvature = mean * scale
    h.curvature_xx, h.curvature_yy = curved_x * scale, curved_y * scale
    h.curvature_xy = twist / (p.pitch_x * p.pitch_y) * scale
    h.strength = 1.0
    if p.materials != 0.0:
        # The material is that of the nearest pixel.
        pixel = _index(math.floor(v + 0.5), p.rows, p.wrap) * p.columns
        pixel += _index(math.floor(u + 0.5), p.columns, p.wrap)
        size = p.rows * p.columns
        h.strength = values[size + pixel]
        h.adhesion = values[2 * size + pixel]
        h.modulus = values[3 * size + pixel]


def _materials(relief: Relief) -> tuple[tuple[float, float], ...]:
    """Work of adhesion and modulus of each material over those of the plant."""
    if not relief.constants["materials"]:
        return ((1.0, 1.0),)
    _, _, adhesions, moduli = relief.numbers.reshape(4, -1)
    return tuple((float(a), float(m)) for a, m in np.unique(np.stack([adhesions, moduli]), axis=1).T)


def map_sample(
    name: str, parameters: type[SampleParameters], of: Callable[[Tree], Relief], check: Callable[[Tree], None]
) -> Sample:
    """A sample that is a map.

    Parameters
    ----------
    name, parameters
        As of `Sample`.
    of : callable
        Parameters of the instrument -> Relief; called again and again, so that it keeps what it has made.
    check : callable
        As of `Sample`.
    """
    return Sample(
        name=name,
        parameters=parameters,
        constants=Constants,
        values=lambda parameters: of(parameters).constants,
        check=check,
        map=lambda parameters: of(parameters).numbers,
        height=lambda parameters: of(parameters).amplitude,
        curvature=lambda parameters: of(parameters).curvature * square(parameters.scales.x0) / parameters.scales.z0,
        contrast=lambda parameters: of(parameters).contrast,
        materials=lambda parameters: _materials(of(parameters)),
        surface=surface,
    )
