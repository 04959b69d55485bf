"""Layout of what the viewer shows: entities and units of the plots.

rerun plots the numbers as they are logged. They are therefore logged in nm, nN and us, with the unit in the name of the
series; a record holds SI units.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from afm_model.parts.channels import STANDARD

SCANS = "/scan"
"""Below it an image that grows for each channel and direction, and what is made of both directions."""

APPLICATION = "afm"
TIMELINE = "sim_time"
"""Simulated time, a duration since the start of the run."""
EVENTS = "/events"
PARAMETERS = "/parameters"
"""Text of all parameters as they were first seen (YAML); below it one entity for each number that has changed."""
RUN = "/run"
"""Title of the run, and its score as a table with units."""
FRICTION_LOOP = "/friction_loop"
"""Drawing of lateral force against position."""
RESULT = "/result"
"""What the last verb has brought back, as a table; below it its diagrams."""
SCENE = "/scene"
"""Cantilever, tip and sample in space."""

_PLOTTED = {"m": ("nm", 1e9), "N": ("nN", 1e9), "s": ("us", 1e6)}
Color = tuple[int, int, int]
# x red, y green, z blue; pale for the reference.
_COLORS: tuple[Color, ...] = ((214, 69, 65), (60, 150, 80), (58, 110, 200))
_PALE: tuple[Color, ...] = ((240, 160, 155), (150, 205, 160), (155, 185, 235))


@dataclass(frozen=True)
class PlotSignal:
    """One entity with one or three numbers a row, each `factor` times the SI value: that is a value in `unit`."""

    entity: str
    si_unit: str
    axes: tuple[str, ...] = ()
    colors: tuple[Color, ...] = (_COLORS[2],)

    @property
    def unit(self) -> str:
        """Unit of its plot."""
        return plotted(self.si_unit)[0]

    @property
    def factor(self) -> float:
        """From the SI value to that of the plot."""
        return plotted(self.si_unit)[1]

    @property
    def name(self) -> str:
        """As the topic is called."""
        return self.entity.removeprefix("/")

    @property
    def width(self) -> int:
        """Numbers in a row."""
        return max(len(self.axes), 1)

    @property
    def names(self) -> list[str]:
        """Names of the series, with the unit."""
        title = self.entity.rpartition("/")[2]
        return [f"{title} {axis} [{self.unit}]" for axis in self.axes] or [f"{title} [{self.unit}]"]


def plotted(si_unit: str) -> tuple[str, float]:
    """Unit of a plot, and the factor from `si_unit` to it."""
    return _PLOTTED.get(si_unit, (si_unit, 1.0))


DEFLECTION, LATERAL_FORCE, LATERAL_FORCE_Y, NORMAL_FORCE = CHANNELS = tuple(
    PlotSignal(f"/{channel.name}", channel.unit, colors=(color,))
    for channel, color in zip(STANDARD, (_COLORS[2], *_COLORS), strict=True)
)
"""Sampled at the full rate of the virtual ADC."""

_TIP = ("x", "y", "z of the tip")
POSITION = PlotSignal("/position", "m", ("x", "y", "z of the sample"), _COLORS)
REFERENCE = PlotSignal("/reference", "m", _TIP, _PALE)
ERROR = PlotSignal("/error", "m", _TIP, _COLORS)
DRIVE = PlotSignal("/drive", "V", ("x", "y", "z"), _COLORS)
ROUND_TRIP = PlotSignal("/round_trip", "s")
TICKS = (POSITION, REFERENCE, ERROR, DRIVE, ROUND_TRIP)
"""One row for each control tick."""
TICK_NAMES = frozenset(signal.name for signal in TICKS)
KNOWN = {signal.name: signal for signal in (*CHANNELS, *TICKS)}
"""By name."""


def instants(first: int, count: int, period: float) -> NDArray[np.int64]:
    """Simulated time [ns] of `count` samples from number `first` on.

    Computed from the number of each sample, so that blocks join without a gap and nothing drifts.

    Parameters
    ----------
    first, count : int
        Number of the first sample since the start of the run; how many.
    period : float [s]

    Returns
    -------
    ndarray (count,) [ns]
    """
    index = np.arange(first, first + count, dtype=np.int64)
    period_ns = period * 1e9
    whole = round(period_ns)
    # 2e-6 * 1e9 is 2000.0000000000002: whole nanoseconds are counted in integers, exact at any time.
    if abs(period_ns - whole) <= 1e-12 * period_ns:
        return index * whole
    return np.rint(index * period_ns).astype(np.int64)


def signal(name: str, si_unit: str) -> PlotSignal:
    """A signal by its name: one that is known, or a new channel in a unit that a plot can be read in."""
    return KNOWN.get(name) or PlotSignal(f"/{name}", si_unit)


def further(entities: Iterable[str]) -> list[str]:
    """Which of these entities are channels beyond those of CHANNELS."""
    others = {signal.entity for signal in (*CHANNELS, *TICKS)} | {EVENTS, PARAMETERS, RUN, FRICTION_LOOP, RESULT}
    below = tuple(f"{entity}/" for entity in (PARAMETERS, FRICTION_LOOP, RESULT, SCENE, SCANS))
    return sorted(e for e in entities if e not in others and not e.startswith((*below, "/__")))
