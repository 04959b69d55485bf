"""Curves over another quantity than time, in a plane with axes: the viewer plots over time only. Needs no ROS."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from afm_model.core.prefix import prefixed

Color = tuple[int, int, int]
_Array = NDArray[np.float64]

WIDTH, HEIGHT = 8.0, 5.0
"""Of the frame; the plane has no units, and downwards is positive."""
POINTS = 4_000
"""Of a curve that are drawn at most."""
BLUE, ORANGE, GREY = (31, 119, 180), (230, 120, 20), (120, 120, 120)
_GRID = (222, 222, 222)
_TICKS = 6
"""Numbers at an axis, more or less."""
_MARGIN = 0.04
"""Part of the frame that is left free above and below the curves."""
# A label hangs some 0.1 below its place, at its middle, on a laptop.
_UP, _LEFT, _BELOW, _ABOVE = 0.12, 0.45, 0.08, 0.55


@dataclass(frozen=True)
class DiagramLine:
    """One line of a diagram, in SI units."""

    x: _Array
    y: _Array
    name: str
    color: Color


@dataclass(frozen=True)
class Axis:
    """What is along one edge of a diagram."""

    name: str
    unit: str
    """SI."""


@dataclass(frozen=True)
class Diagram:
    """Curves with one pair of axes."""

    x: Axis
    y: Axis
    curves: Sequence[DiagramLine]

    def draw(self) -> dict[str, rr.ComponentColumnList]:
        """What is drawn, by names below the entity of the diagram, one row each; nothing if there is no point.

        Returns
        -------
        dict of str to columns
            `grid`, `curves`, `words`.
        """
        lines = [(curve, points) for curve in self.curves if len(points := _finite(curve))]
        if not lines:
            return {}
        every = np.concatenate([points for _, points in lines])
        across, up = (_Scale.over(every[:, k], axis) for k, axis in enumerate((self.x, self.y)))

        def place(x: _Array, y: _Array) -> _Array:
            return np.column_stack([WIDTH * across.part(x), HEIGHT * (1.0 - up.part(y))])

        frame = np.array([[0.0, 0.0], [WIDTH, 0.0], [WIDTH, HEIGHT], [0.0, HEIGHT], [0.0, 0.0]])
        upright = [np.array([[p, 0.0], [p, HEIGHT]]) for p in WIDTH * across.part(across.ticks)]
        level = [np.array([[0.0, p], [WIDTH, p]]) for p in HEIGHT * (1.0 - up.part(up.ticks))]
        grid = [*upright, *level, frame]
        colors = [_GRID] * (len(grid) - 1) + [GREY]
        words = [([WIDTH * float(across.part(t)), HEIGHT + _BELOW], across.text(t), GREY) for t in across.ticks]
        words += [([-_LEFT, HEIGHT * (1.0 - float(up.part(t))) - _UP], up.text(t), GREY) for t in up.ticks]
        words.append(([0.5 * WIDTH, HEIGHT + _ABOVE], f"{self.x.name} [{across.unit}]", GREY))
        words.append(([0.1 * WIDTH, -_ABOVE], f"{self.y.name} [{up.unit}]", GREY))
        named = {curve.name: curve.color for curve, _ in lines}
        words += [
            ([WIDTH * (0.95 - 0.2 * k), -_ABOVE], name, color)
            for k, (name, color) in enumerate(reversed(named.items()))
        ]
        return {
            "grid": _strips(grid, colors, 0.4),
            "curves": _strips([place(*points.T) for _, points in lines], [curve.color for curve, _ in lines], 0.8),
            "words": _words(words),
        }


@dataclass(frozen=True)
class _Scale:
    """From numbers in SI units to a part of an edge of the frame."""

    low: float
    high: float
    step: float
    """Between two numbers at the axis."""
    factor: float
    unit: str
    """In which they are written."""

    @classmethod
    def over(cls, values: _Array, axis: Axis) -> "_Scale":
        low, high = float(values.min()), float(values.max())
        if not high > low:
            # A line that is level has a place in the middle.
            low, high = low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0)
        margin = _MARGIN * (high - low)
        low, high = low - margin, high + margin
        factor, unit = prefixed(axis.unit, low, high)
        return cls(low, high, round_step(factor * (high - low) / _TICKS) / factor, factor, unit or "1")

    @property
    def ticks(self) -> _Array:
        """Where numbers are written."""
        first, last = math.ceil(self.low / self.step), math.floor(self.high / self.step)
        return self.step * np.arange(first, last + 1, dtype=np.float64)

    def part(self, values: _Array) -> _Array:
        """0 at the low end, 1 at the high one."""
        return (values - self.low) / (self.high - self.low)

    def text(self, value: float) -> str:
        """A number as it is written at the axis."""
        return f"{self.factor * value:.6g}" if abs(value) > 1e-9 * self.step else "0"


def round_step(about: float) -> float:
    """1, 2 or 5 times a power of ten, the least that is not smaller."""
    power = 10.0 ** math.floor(math.log10(about))  # no part of a run
    return power * next(each for each in (1.0, 2.0, 5.0, 10.0) if each * power >= about * (1.0 - 1e-9))


def _finite(curve: DiagramLine) -> _Array:
    """Points of a curve that are numbers, (n, 2)."""
    every = np.column_stack([curve.x, curve.y])
    points: _Array = every[np.isfinite(every).all(axis=1)]
    return points[:: -(-len(points) // POINTS) or 1]


def _strips(strips: Sequence[_Array], colors: Sequence[Color], radius: float) -> rr.ComponentColumnList:
    count = len(strips)
    # Negative: in points of the screen.
    made = rr.LineStrips2D.columns(strips=strips, colors=list(colors), radii=[-radius] * count)
    return made.partition([count])


def _words(words: Sequence[tuple[list[float], str, Color]]) -> rr.ComponentColumnList:
    places, texts, colors = zip(*words, strict=True)
    count = len(words)
    made = rr.Points2D.columns(
        positions=list(places),
        labels=list(texts),
        colors=list(colors),
        radii=[-0.3] * count,
        show_labels=[True] * count,
    )
    return made.partition([count])
