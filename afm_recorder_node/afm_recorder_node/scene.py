"""Cantilever, tip and sample in space, moved by the signals of a run; drawn when it ends.

What is drawn does not grow with the run: some hundred poses, evenly spaced over the run. The size of the scene
is that of the path of the tip over the sample, or of its image; heights and deflection are enlarged by the same
factor, which is written next to it. The shape of cantilever and tip is no one's.
"""

import math
from collections.abc import Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from afm_model.core.prefix import text
from afm_model.microscope.raster import Raster

from . import layout
from .canvas import Canvas
from .diagram import round_step

POSES = 600
"""At most, over the whole run."""
EYE, TARGET = (1.45, -2.3, 1.25), (-0.3, 0.0, 0.0)
"""Where the viewer stands, and what it looks at: the sample goes from -1 to 1, the tip is near the middle."""
SAMPLE, CANTILEVER = f"{layout.SCENE}/sample", f"{layout.SCENE}/cantilever"
_SHARE, _AS_IT_IS = 0.35, (0.1, 0.7)
"""Heights of the sample are drawn so high, in half widths of the sample, or up to 2.5 times less; between these as
they are."""
_AWAY = 0.5
"""Distance at which a tip that is further away is drawn, in half widths."""
_NEAR = 0.5
"""Part of the range of distances in which the tip is taken to be at the sample."""
_MESH = 64
"""Vertices of the sample along an edge, at most."""
_STRAIGHT = 0.05
"""A path that is so many times less wide than long is taken for a line."""
_LENGTH, _BEAM, _TILT = 2.2, (0.16, 0.03), 0.12
"""Cantilever: length, half width and thickness, rise towards its base for a unit of length."""
_TIP, _RADIUS, _SIDES = 0.4, 0.12, 16
_SAND, _STEEL, _DARK, _WORDS = (214, 190, 140), (140, 160, 185), (70, 80, 95), (110, 110, 110)

_Array = NDArray[np.float64]


class _Spread:
    """Rows of a signal, evenly spaced over all that come; not more than some."""

    def __init__(self) -> None:
        self._times: list[NDArray[np.int64]] = []
        self._values: list[_Array] = []
        self._seen, self._every = 0, 1

    def put(self, times: NDArray[np.int64], values: _Array) -> None:
        kept = slice(-self._seen % self._every, None, self._every)
        self._seen += len(times)
        self._times.append(times[kept].copy())
        self._values.append(values[kept].copy())
        while sum(map(len, self._times)) > 2 * POSES:
            every = [np.concatenate(self._times)[::2]], [np.concatenate(self._values)[::2]]
            (self._times, self._values), self._every = every, 2 * self._every

    def rows(self) -> tuple[NDArray[np.int64], _Array]:
        if not self._times:
            return np.empty(0, np.int64), np.empty((0, 3))
        times, values = np.concatenate(self._times), np.concatenate(self._values)
        order = np.argsort(times, kind="stable")  # those of a file that another tool has written may come in any
        return times[order], values[order]


Surface = tuple[Raster, _Array]
"""Heights of an image (rows, columns) [nm] as they are drawn, the first row at the largest y; and where it is."""


class Scene:
    """Collects what is to be drawn while the run is drawn."""

    def __init__(self) -> None:
        self._rows = {signal.entity: _Spread() for signal in (layout.POSITION, layout.REFERENCE, layout.ERROR)}

    def put(self, entity: str, times: NDArray[np.int64], values: _Array) -> None:
        """Rows of an entity: times (n,) [ns], values (n, width) as they are drawn."""
        if entity in self._rows:
            self._rows[entity].put(times, values)

    def send(self, canvas: Canvas, scanned: Surface | None) -> None:
        """Draw the scene; nothing if the height of the tip is not known, or nothing has moved.

        Parameters
        ----------
        canvas : Canvas
        scanned : (Raster, ndarray), optional
            Last image of the sample.
        """
        times, position, tip = self._poses()
        if len(times) < 2:
            return
        # By the definition of the indentation: over the place (x, y) of the sample the tip is at tip - z.
        over = tip - position[:, 2]
        low, high = float(over.min()), float(over.max())
        contact = over <= low + _NEAR * (high - low) if self._far(over) else np.full(len(over), True)
        level = float(np.median(over[contact]))
        path = np.column_stack([position[contact, :2], over[contact]])
        image, line = _image(scanned, level), _along(path)
        surface = line if image is None else image
        found = path if surface is None else surface.reshape(-1, 3)
        middle = 0.5 * (found[:, :2].min(axis=0) + found[:, :2].max(axis=0))
        half = float(np.ptp(found[:, :2], axis=0).max()) / 2.0
        heights = max(float(np.ptp(found[:, 2])), 0.5 * float(np.ptp(tip)))
        if surface is None:
            # A force curve goes nowhere: its place moves by the noise of the sensors.
            half = max(half, 2.0 * heights)
        if not half > 0.0:
            return
        larger = (
            1.0
            if heights == 0.0 or _AS_IT_IS[0] <= heights / half <= _AS_IT_IS[1]
            else 1.0 / round_step(heights / (_SHARE * half))
        )
        if surface is None:
            surface = _plate(middle, half, level)

        def placed(points: _Array) -> _Array:
            return np.concatenate([points[..., :2] - middle, larger * (points[..., 2:] - level)], axis=-1) / half

        up = larger * (tip - np.median(tip)) / half
        distance = np.minimum(larger * (over - level) / half, _AWAY)
        _mesh(canvas, f"{SAMPLE}/surface", *_sheet(placed(surface)), _SAND)
        if image is None and line is not None:
            track = placed(path) + np.array([0.0, 0.0, 0.01])
            canvas.static(f"{SAMPLE}/path", rr.LineStrips3D([track], colors=[_DARK], radii=[-0.6]))
        _mesh(canvas, f"{CANTILEVER}/beam", *_beam(), _STEEL)
        _mesh(canvas, f"{CANTILEVER}/tip", *_cone(), _DARK)
        about = f"{text(2e-9 * half, 'm', 3)} wide, heights and deflection x {larger:g}"
        words = rr.Points3D([[0.0, -1.15, -0.35]], labels=[about], colors=[_WORDS], radii=[-0.1], show_labels=True)
        canvas.static(f"{layout.SCENE}/words", words)
        moved = np.column_stack([(middle - position[:, :2]) / half, up - distance])
        canvas.rows(SAMPLE, times, rr.Transform3D.columns(translation=moved))
        # A small deflection of the end bends the beam by so much everywhere: nobody sees the curvature.
        sheared = np.tile(np.eye(3), (len(times), 1, 1))
        sheared[:, 2, 0] = up / _LENGTH
        base = np.tile([-_LENGTH, 0.0, 0.0], (len(times), 1))
        canvas.rows(CANTILEVER, times, rr.Transform3D.columns(translation=base, mat3x3=sheared))

    def _poses(self) -> tuple[NDArray[np.int64], _Array, _Array]:
        """Times [ns], positions (n, 3) [nm] and heights of the tip [nm], of ticks of which all is known."""
        (times, position), (others, reference), (third, error) = (each.rows() for each in self._rows.values())
        common, at, _ = np.intersect1d(times, np.intersect1d(others, third), return_indices=True)
        tip = reference[np.searchsorted(others, common), 2] + error[np.searchsorted(third, common), 2]
        known = np.isfinite(tip) & np.isfinite(position[at]).all(axis=1)
        kept = np.flatnonzero(known)[:: -(-int(known.sum()) // POSES) or 1]
        return common[kept], position[at][kept], tip[kept]

    @staticmethod
    def _far(over: _Array) -> bool:
        """Whether the tip was away from the sample: its distance is then far larger than what it mostly is."""
        low, middle, high = np.quantile(over, (0.0, 0.5, 1.0))
        return bool(high - low > 4.0 * (middle - low) or high - low > 4.0 * (high - middle))


def _image(scanned: Surface | None, level: float) -> _Array | None:
    """Points of the surface by the last image (rows, columns, 3) [nm]; None without one."""
    if scanned is None:
        return None
    scan, drawn = scanned
    heights = drawn[::-1]
    every = -(-max(heights.shape) // _MESH)
    heights = heights[::every, ::every]
    rows, columns = heights.shape
    along = 1e9 * scan.size_x * ((np.arange(columns) + 0.5) / columns - 0.5)
    across = 1e9 * scan.height * ((np.arange(rows) + 0.5) / rows - 0.5)
    x, y = np.meshgrid(along, across)
    c, s = math.cos(scan.angle), math.sin(scan.angle)
    centre = 1e9 * scan.centre_x, 1e9 * scan.centre_y
    return np.stack(
        [centre[0] + c * x - s * y, centre[1] + s * x + c * y, heights - np.median(heights) + level], axis=-1
    )


def _along(path: _Array) -> _Array | None:
    """Return the sample as the tip has met it along a straight line, extended across it; None for another path."""
    if len(path) < 3:
        return None
    centred = path[:, :2] - path[:, :2].mean(axis=0)
    _, sizes, ways = np.linalg.svd(centred, full_matrices=False)
    if not sizes[0] > 0.0 or sizes[1] > _STRAIGHT * sizes[0]:
        return None
    place = centred @ ways[0]
    edges = np.linspace(place.min(), place.max(), _MESH + 1)
    inside = np.clip(np.digitize(place, edges) - 1, 0, _MESH - 1)
    counts = np.bincount(inside, minlength=_MESH)
    with np.errstate(invalid="ignore"):
        means = np.bincount(inside, path[:, 2], _MESH) / counts
    there = counts > 0
    middles = 0.5 * (edges[:-1] + edges[1:])
    heights = np.interp(middles, middles[there], means[there])
    width = 0.5 * float(np.ptp(place)) * np.array([-1.0, 1.0])
    line = path[:, :2].mean(axis=0) + middles[:, np.newaxis] * ways[0]
    sides = line[np.newaxis] + width[:, np.newaxis, np.newaxis] * ways[1]
    return np.concatenate([sides, np.broadcast_to(heights, (2, _MESH))[..., np.newaxis]], axis=-1)


def _plate(middle: _Array, half: float, level: float) -> _Array:
    corners = [[[middle[0] + half * i, middle[1] + half * j, level] for i in (-1.0, 1.0)] for j in (-1.0, 1.0)]
    return np.array(corners)


# Shapes: vertices (n, 3) and triangles (m, 3).


def _sheet(points: _Array) -> tuple[_Array, NDArray[np.int64]]:
    rows, columns, _ = points.shape
    corner = (np.arange(rows - 1)[:, np.newaxis] * columns + np.arange(columns - 1)).ravel()
    first = np.column_stack([corner, corner + 1, corner + columns])
    second = np.column_stack([corner + 1, corner + columns + 1, corner + columns])
    return points.reshape(-1, 3), np.concatenate([first, second])


def _beam() -> tuple[_Array, NDArray[np.int64]]:
    half, thick = _BEAM
    ends = [(x, _TIP + _TILT * (_LENGTH - x)) for x in (0.0, _LENGTH + half)]
    vertices = [[x, y, z + t] for x, z in ends for y in (-half, half) for t in (0.0, thick)]
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3), (0, 2, 6, 4))
    return np.array(vertices), np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def _cone() -> tuple[_Array, NDArray[np.int64]]:
    angles = 2.0 * np.pi * np.arange(_SIDES) / _SIDES
    ring = np.column_stack([_LENGTH + _RADIUS * np.cos(angles), _RADIUS * np.sin(angles), np.full(_SIDES, _TIP)])
    apex = _SIDES
    number = np.arange(_SIDES)
    return np.vstack([ring, [_LENGTH, 0.0, 0.0]]), np.column_stack(
        [number, (number + 1) % _SIDES, np.full(_SIDES, apex)]
    )


def _mesh(canvas: Canvas, entity: str, vertices: _Array, triangles: NDArray[np.int64], color: Sequence[int]) -> None:
    normals = np.zeros_like(vertices)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    for k in range(3):
        np.add.at(normals, triangles[:, k], np.cross(b - a, c - a))
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    mesh = rr.Mesh3D(
        vertex_positions=vertices,
        triangle_indices=triangles,
        vertex_normals=normals / np.where(lengths > 0.0, lengths, 1.0),
        albedo_factor=color,
    )
    canvas.static(entity, mesh)
