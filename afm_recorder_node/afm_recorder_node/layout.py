"""Layout of a recording: entities, units of the plots, and the arrangement of the viewer.

Recordings are made to be looked at, and rerun plots the numbers as they are logged. They are therefore logged in nm, nN
and us, with the unit in the name of the series; `afm_recorder_node.reader` gives SI units back.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from afm_model.parts import Channel, channels

from .pictures import SCANS, view

APPLICATION = "afm"
TIMELINE = "sim_time"
"""Simulated time, a duration since the start of the run."""
SCALARS = "Scalars:scalars"
EVENTS = "/events"
PARAMETERS = "/parameters"
"""Text of all parameters as they were first seen (YAML); below it one entity for each number that has changed."""

SCORE = "/score"
"""Text of the score (YAML), when the run has one."""
RUN = "/run"
"""Title of the run, and its score as a table with units."""
FRICTION_LOOP = "/friction_loop"
"""Drawing of lateral force against position, in a complete recording."""

_PLOTTED = {"m": ("nm", 1e9), "N": ("nN", 1e9), "s": ("us", 1e6)}

# x red, y green, z blue; pale for the reference.
_COLORS = ((214, 69, 65), (60, 150, 80), (58, 110, 200))
_PALE = ((240, 160, 155), (150, 205, 160), (155, 185, 235))


@dataclass(frozen=True)
class Signal:
    """One entity with one or three numbers a row.

    A row holds `factor` times the SI value, which makes it a value in `unit`.
    """

    entity: str
    unit: str
    factor: float
    si_unit: str
    axes: tuple[str, ...] = ()
    colors: tuple[tuple[int, int, int], ...] = (_COLORS[2],)

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


def _vector(
    entity: str,
    unit: str,
    factor: float,
    si_unit: str,
    z: str = "z",
    colors: tuple[tuple[int, int, int], ...] = _COLORS,
) -> Signal:
    return Signal(entity, unit, factor, si_unit, ("x", "y", z), colors)


def _sampled(channel: Channel, color: tuple[int, int, int] = _COLORS[2]) -> Signal:
    """A channel of the instrument."""
    return Signal(f"/{channel.name}", *_PLOTTED[channel.unit], channel.unit, colors=(color,))


DEFLECTION = _sampled(channels.DEFLECTION)
LATERAL_FORCE = _sampled(channels.LATERAL_FORCE, _COLORS[0])
LATERAL_FORCE_Y = _sampled(channels.LATERAL_FORCE_Y, _COLORS[1])
NORMAL_FORCE = _sampled(channels.NORMAL_FORCE)
CHANNELS = (DEFLECTION, LATERAL_FORCE, LATERAL_FORCE_Y, NORMAL_FORCE)
"""Sampled at the full rate of the virtual ADC."""

POSITION = _vector("/position", "nm", 1e9, "m", "z of the sample")
REFERENCE = _vector("/reference", "nm", 1e9, "m", "z of the tip", _PALE)
ERROR = _vector("/error", "nm", 1e9, "m", "z of the tip")
DRIVE = _vector("/drive", "V", 1.0, "V")
ROUND_TRIP = Signal("/round_trip", "us", 1e6, "s")
TICKS = (POSITION, REFERENCE, ERROR, DRIVE, ROUND_TRIP)
"""One row for each control tick."""
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


def plotted(si_unit: str) -> tuple[str, float]:
    """Unit of a plot, and the factor from `si_unit` to it."""
    return _PLOTTED.get(si_unit, (si_unit, 1.0))


def signal(name: str, si_unit: str) -> Signal:
    """A signal by its name: one that is known, or a new channel in a unit that a plot can be read in."""
    return KNOWN.get(name) or Signal(f"/{name}", *plotted(si_unit), si_unit)


def further(entities: Iterable[str]) -> list[str]:
    """Which of these entities are channels beyond those of CHANNELS."""
    others = {signal.entity for signal in (*CHANNELS, *TICKS)} | {EVENTS, PARAMETERS, SCORE, RUN, FRICTION_LOOP}
    below = tuple(f"{entity}/" for entity in (PARAMETERS, FRICTION_LOOP, SCANS))
    return sorted(e for e in entities if e not in others and not e.startswith((*below, "/__")))


def _plot(name: str, *signals: Signal, axis: int | None = None) -> rrb.TimeSeriesView:
    """A plot of signals, or of one axis of theirs. Its name describes it, because a legend would cover the curves."""
    shown = rr.SeriesLines.from_fields(visible_series=[axis in (None, k) for k in range(3)])
    return rrb.TimeSeriesView(
        name=f"{name} [{signals[0].unit}]",
        origin="/",
        contents=[signal.entity for signal in signals],
        # A visualizer has a random name: of bare lines rerun would make another one whenever they are sent.
        overrides=None if axis is None else {signal.entity: shown.visualizer() for signal in signals},
        plot_legend=rrb.PlotLegend(visible=False),
    )


def _plots(name: str, *signals: Signal, z: str | None = None) -> list[rrb.TimeSeriesView]:
    """One plot for each axis; `z`: name of that of z."""
    return [_plot((axis == "z" and z) or f"{name}, {axis}", *signals, axis=k) for k, axis in enumerate("xyz")]


def blueprint(further: Iterable[str] = (), pictures: Iterable[str] = ()) -> rrb.Blueprint:
    """The arrangement of `_blueprint`, the same object each time: rerun keeps the random names in it for ever."""
    return _blueprint(tuple(sorted(further)), tuple(sorted(pictures)))


@cache
def _blueprint(further: tuple[str, ...], images: tuple[str, ...]) -> rrb.Blueprint:
    """The arrangement of the viewer: signals in plots over simulated time; score, events and parameters below.

    With images these come first, and the signals are behind them.

    x and y follow the same reference and z is far smaller: each axis has a plot, so that none hides another.

    Parameters
    ----------
    further : tuple of str
        Entities of channels beyond those of CHANNELS.
    images : tuple of str
        Entities of images of scans.
    """
    signals = _signals(further)
    return rrb.Blueprint(
        rrb.Tabs(view(images), signals, active_tab=0) if images else signals,
        # At the end of the recording, where an image is as complete as it will be.
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following" if images else None),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_views=False,
    )


def _signals(further: Iterable[str]) -> rrb.Container:
    return rrb.Vertical(
        rrb.Grid(
            rrb.Tabs(
                *_plots("Position, pale: reference", POSITION, REFERENCE, z="Sample z, pale: reference of the tip")
            ),
            rrb.Tabs(*_plots("Tracking error", ERROR, z="Tracking error of the tip, z")),
            rrb.Spatial2DView(
                name="Friction loop: lateral force against position, x", origin=FRICTION_LOOP, contents="$origin/**"
            ),
            rrb.Tabs(_plot("Lateral force, x", LATERAL_FORCE), _plot("Lateral force, y", LATERAL_FORCE_Y)),
            rrb.Tabs(*_plots("Drive", DRIVE)),
            rrb.Tabs(_plot("Deflection", DEFLECTION), _plot("Normal force", NORMAL_FORCE)),
            grid_columns=3,
        ),
        rrb.Horizontal(
            rrb.TextDocumentView(name="Run", origin=RUN),
            rrb.Tabs(
                rrb.TextLogView(name="Events", origin=EVENTS),
                rrb.TextDocumentView(name="Parameters", origin=PARAMETERS),
                rrb.TimeSeriesView(name="Changed parameters", origin="/", contents=[f"{PARAMETERS}/**"]),
                _plot("Round trip", ROUND_TRIP),
                *(rrb.TimeSeriesView(name=name[1:], origin="/", contents=[name]) for name in further),
                active_tab="Events",
            ),
            column_shares=[1, 2],
        ),
        row_shares=[3, 1],
        name="Signals",
    )
