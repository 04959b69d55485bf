"""The verb ScanPath."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise, starmap
from typing import ClassVar

from pydantic import Field

from ...program.orders import Order
from ..arrays import Arrays, attributes
from ..execution import Execution, Task
from ..plan import distance, path
from ..quantities import Places, SampleRate, Speed
from ..results import MicroscopeState, TimeSeries
from ..verb import MOST_PLACES, Verb, outside, too_much
from ..view import InstrumentView
from .going import MoveTo

_CHANNELS = {"asked_x": "x", "asked_y": "y", "height": "height", "error": "error", "lateral": "lateral"}


@dataclass(frozen=True)
class PathRecord:
    """What was measured along a path."""

    verb: "ScanPath"
    record: TimeSeries
    """Channels `x`, `y` (as asked for) [m], `height` [m], `error` [V], `lateral` [N]."""
    lateral_sensitivity: float  # with which it was computed [N/V]

    def arrays(self) -> Arrays:
        """Its channels over time; the places of the path are the attributes `corners_x`, `corners_y`."""
        corners = {"corners_x": list(self.verb.x), "corners_y": list(self.verb.y)}
        given = attributes(self.verb, corners | {"lateral_sensitivity": self.lateral_sensitivity})
        # The names x and y are those of the places measured at.
        return self.record.arrays({name: value for name, value in given.items() if name not in ("x", "y")})


class ScanPath(Verb):
    """Measure along a path of straight lines, at even speed, with feedback."""

    returns: ClassVar = PathRecord
    on_sample: ClassVar = True
    slides: ClassVar = True

    x: Places = Field((), description="places in turn")
    y: Places = Field((), description="places in turn")
    speed: Speed = Field(1e-6, description="velocity along the path")
    sample_rate: SampleRate = Field(1e3, description="samples of the result; each is a mean over samples of the ADC")

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        if len(self.x) != len(self.y) or len(self.x) < 2:
            yield (
                f"a path of {len(self.x)} x and {len(self.y)} y is not allowed: there must be as many of both, 2 at "
                f"least"
            )
            return
        if len(self.x) > MOST_PLACES:
            yield f"a path of {len(self.x)} places is not allowed: {MOST_PLACES} are the most"
        places = list(zip(self.x, self.y, strict=True))
        for number, (one, other) in enumerate(pairwise(places)):
            if one == other:
                yield (
                    f"places {number} and {number + 1} of the path are the same, x = {one[0]:g} m, y = {one[1]:g} m, "
                    f"which is not allowed: leave one of them out"
                )
        yield from outside(view, "", places)
        way = math.fsum(starmap(distance, pairwise(places)))
        yield from too_much(
            len(_CHANNELS) * view.samples(way / self.speed, self.sample_rate), "this path at this speed"
        )
        most = min(view.resonance, self.sample_rate) * way
        if self.speed > most:
            yield (
                f"speed = {self.speed:g} m/s is not allowed on a path of {way:.4g} m: it would take less than a period "
                f"of the scanner's resonance or of sample_rate = {self.sample_rate:g} Hz; it must be <= {most:.4g} m/s"
            )

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        places, period = list(zip(self.x, self.y, strict=True)), run.view.control_period
        recorder = run.recorder(list(_CHANNELS), self.sample_rate)

        def result() -> PathRecord:
            record = recorder.record()
            channels = dict(zip(_CHANNELS.values(), record.channels.values(), strict=True))
            units = dict(zip(_CHANNELS.values(), record.units.values(), strict=True))
            return PathRecord(self, TimeSeries(record.time, channels, units), *recorder.factors("lateral"))

        run.result = result
        # At the ends the speed is not even.
        run.total = math.fsum(starmap(distance, pairwise(places))) / self.speed + 2.0 / run.view.resonance
        yield from run.going(*places[0], max(self.speed, MoveTo().speed))
        for place, piece in path(places, self.speed, run.view):
            yield Task(Order(piece), piece.ticks * period, f"at place {place + 1} of {len(places)}", recorder)
