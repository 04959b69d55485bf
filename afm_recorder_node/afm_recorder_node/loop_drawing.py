"""The friction loop of a run: lateral force against position along x, drawn when it ends.

The viewer plots over time only. So the loop is a drawing in a plane, with its ends written next to it.
The numbers are those of position and lateral force.
"""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from . import layout
from .canvas import Canvas

WIDTH, HEIGHT = 4.0, 3.0
ROWS = 200_000
"""Rows of each signal that count, the last ones: a long run is not one drawing."""
POINTS = 50_000
"""Points that are drawn at most."""
_FRAME, _LOOP, _TEXT, _ASIDE = (150, 150, 150), (160, 120, 220), 0.12, 0.75


class _Tail:
    """The last rows of a signal."""

    def __init__(self) -> None:
        self._kept: list[tuple[NDArray[np.int64], NDArray[np.float64]]] = []

    def put(self, times: NDArray[np.int64], values: NDArray[np.float64]) -> None:
        """Keep rows, and let those go that are no longer among the last."""
        self._kept.append((times, values))
        while sum(len(times) for times, _ in self._kept[1:]) >= ROWS:
            self._kept.pop(0)

    def rows(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Times and values, sorted."""
        if not self._kept:
            return np.empty(0, np.int64), np.empty(0)
        times, values = (np.concatenate(column)[-ROWS:] for column in zip(*self._kept, strict=True))
        order = np.argsort(times, kind="stable")
        return times[order], values[order]


class LoopPoints:
    """Collects the points of the loop while the run is drawn."""

    def __init__(self) -> None:
        self._position, self._force = _Tail(), _Tail()

    def put(self, entity: str, times: NDArray[np.int64], values: NDArray[np.float64]) -> None:
        """Rows of an entity: times (n,) [ns], values (n, width) as they are drawn."""
        if entity == layout.POSITION.entity:
            self._position.put(times, values[:, 0].copy())
        elif entity == layout.LATERAL_FORCE.entity:
            self._force.put(times, values[:, 0].copy())

    def points(self) -> NDArray[np.float64]:
        """Position [nm] and lateral force [nN] at the last control ticks, (n, 2); none if one of the two is missing."""
        times, position = self._position.rows()
        force_times, force = self._force.rows()
        if not len(force):
            return np.empty((0, 2))
        inside = (times >= force_times[0]) & (times <= force_times[-1])
        points = np.column_stack([position[inside], np.interp(times[inside], force_times, force)])
        points = points[np.isfinite(points).all(axis=1)]
        return points[:: -(-len(points) // POINTS) or 1]

    def send(self, canvas: Canvas) -> None:
        """Draw the loop, if there is one."""
        points = self.points()
        if len(points) < 2:
            return
        (left, low), (right, high) = points.min(axis=0), points.max(axis=0)
        if not (right > left and high > low):
            return
        # Downwards is positive in a plane of the viewer.
        drawn = np.column_stack(
            [WIDTH * (points[:, 0] - left) / (right - left), HEIGHT * (high - points[:, 1]) / (high - low)]
        )
        canvas.static(layout.FRICTION_LOOP, rr.LineStrips2D([drawn], colors=[_LOOP], radii=[-0.7]))
        frame = np.array([[0, 0], [WIDTH, 0], [WIDTH, HEIGHT], [0, HEIGHT], [0, 0]])
        canvas.static(f"{layout.FRICTION_LOOP}/frame", rr.LineStrips2D([frame], colors=[_FRAME], radii=[-0.5]))
        # A label hangs from its place, some 1.2 wide and .5 high on a laptop: none covers another, or the loop.
        places = [[0, HEIGHT + _TEXT], [WIDTH, HEIGHT + _TEXT], [-_ASIDE, HEIGHT - 5 * _TEXT], [-_ASIDE, -_TEXT]]
        ends = [f"{left:.3g} nm", f"{right:.3g} nm", f"{low:.3g} nN", f"{high:.3g} nN"]
        labels = rr.Points2D(places, labels=ends, colors=[_FRAME], radii=[-0.5], show_labels=True)
        canvas.static(f"{layout.FRICTION_LOOP}/ends", labels)
