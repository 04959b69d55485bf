"""Motions of verbs: lines of a scan in whole samples, paths with rounded corners. SI units."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from ..core.elementary import hypot, sincos
from ..core.errors import VerbError
from ..program.orders import Lines, Polynomial
from .raster import Raster
from .view import InstrumentView

_Place = tuple[float, float]
_LONGEST = 1e6
"""Of the image part of a line [s]; samples beyond it could not be counted."""
_TURN = 1.0
"""A turn takes at least so many periods of the scanner's resonance, and so does a rounded corner."""


@dataclass(frozen=True)
class LinePlan:
    """Lines of a scan in samples of the virtual ADC."""

    motion: Lines
    pixels: int  # in a line
    per_pixel: int  # samples
    line_rate: float  # reached [Hz]
    begin: _Place  # where the lead-in begins [m]
    corners: tuple[_Place, ...]  # of what the scanner is asked for, turns included [m]


def lines(scan: Raster, view: InstrumentView) -> LinePlan:
    """The lines of a scan: a pixel is a whole number of samples, a line of control ticks.

    Raises
    ------
    VerbError
        If a pixel would be less than a sample, or the turns are too fast for the scanner.
    """
    sample, each = view.sample_period, view.samples_per_tick
    image_time = 0.5 / (scan.line_rate * (1.0 + scan.overscan))
    if not image_time < _LONGEST:
        raise VerbError(f"line_rate = {scan.line_rate:g} Hz is not allowed: it must be > {0.5 / _LONGEST:g} Hz")
    per_pixel = round(image_time / (scan.pixels * sample))
    most = 0.5 / (scan.pixels * sample * (1.0 + scan.overscan))
    if per_pixel < 1:
        raise VerbError(
            f"line_rate = {scan.line_rate:g} Hz is not allowed with pixels = {scan.pixels}: a pixel would be less than "
            f"a sample of {sample:g} s; it must be <= {most:.4g} Hz"
        )
    turn_time = scan.overscan * image_time
    if turn_time < _TURN / view.resonance:
        most = 0.5 * scan.overscan / (1.0 + scan.overscan) * view.resonance / _TURN
        raise VerbError(
            f"line_rate = {scan.line_rate:g} Hz is not allowed with overscan = {scan.overscan:g}: a turn would be "
            f"shorter than a period of the scanner's resonance of {view.resonance:g} Hz; it must be <= {most:.4g} Hz"
        )
    image = per_pixel * scan.pixels
    # Both directions of a line are of one length, a whole number of control ticks.
    turn = each * math.ceil((image + scan.overscan * image) / each - 1e-9) - image
    step = scan.height / scan.lines if scan.slow_axis else 0.0
    first = step * (0.5 - 0.5 * scan.lines)
    if scan.direction == "down":
        first, step = -first, -step
    motion = Lines(scan.centre_x, scan.centre_y, scan.angle, scan.size_x, first, step, scan.lines, image, turn)
    speed = scan.size_x / image
    out = 0.5 * scan.size_x + 0.5 * speed * turn
    bounds = [(sign * out, edge) for sign in (-1.0, 1.0) for edge in (first, -first if scan.slow_axis else first)]
    corners = tuple(_rotated(scan, place) for place in bounds)
    rate = 1.0 / (2.0 * (image + turn) * sample)
    return LinePlan(motion, scan.pixels, per_pixel, rate, corners[0], corners)


def _rotated(scan: Raster, place: _Place) -> _Place:
    s, c = sincos(scan.angle)
    return scan.centre_x + c * place[0] - s * place[1], scan.centre_y + s * place[0] + c * place[1]


def distance(one: _Place, other: _Place) -> float:
    """Return the distance between two places [m]."""
    return hypot(other[0] - one[0], other[1] - one[1])


def path(places: Sequence[_Place], speed: float, view: InstrumentView) -> Iterator[tuple[int, Polynomial]]:
    """Straight lines at even speed from rest to rest, with rounded corners: at which place each piece begins, and it.

    A corner is rounded within a period of the scanner's resonance, or over half of a line that takes less.
    """
    period = view.control_period
    ways = [distance(a, b) for a, b in pairwise(places)]
    rounding = speed * _TURN / view.resonance
    # Half of the way that is rounded, at each place.
    halves = [0.5 * min(rounding, *ways[max(i - 1, 0) : i + 1]) for i in range(len(places))]
    before: _Place = (0.0, 0.0)
    for i, place in enumerate(places):
        after: _Place = (0.0, 0.0)
        if i + 1 < len(places):
            to = places[i + 1]
            after = speed * ((to[0] - place[0]) / ways[i]), speed * ((to[1] - place[1]) / ways[i])
        half = halves[i]
        # At the ends the whole of it lies on one side.
        enter = (place[0] - half * before[0] / speed, place[1] - half * before[1] / speed)
        leave = (place[0] + half * after[0] / speed, place[1] + half * after[1] / speed)
        yield i, view.between(max(1, round(2.0 * half / speed / period)), (enter, before), (leave, after))
        if i + 1 < len(places):
            rest = ways[i] - half - halves[i + 1]
            ticks = round(rest / speed / period)
            if ticks > 0:
                end = (leave[0] + after[0] / speed * rest, leave[1] + after[1] / speed * rest)
                yield i, Polynomial((leave[0], end[0] - leave[0]), (leave[1], end[1] - leave[1]), ticks)
        before = after
