"""How the viewer arranges a run: a screen for each kind of run. Needs no ROS."""

import math
from collections.abc import Iterable, Mapping, Sequence

import rerun as rr
import rerun.blueprint as rrb

from . import layout, pictures, result_views, scene
from .canvas import Range
from .layout import (
    DEFLECTION,
    DRIVE,
    ERROR,
    LATERAL_FORCE,
    LATERAL_FORCE_Y,
    NORMAL_FORCE,
    POSITION,
    REFERENCE,
    PlotSignal,
)

Ranges = Mapping[tuple[str, int], Range]
"""Least and largest number of a signal, by entity and axis (0 for one number), as they are drawn."""

_PLOT = 270.0
"""Height of a plot on a laptop, in points."""
_LABEL = 22.0
"""Points between two numbers at an axis, below which the viewer does not show them."""


def kind(entities: Iterable[str]) -> str:
    """control, scan, force curve or calibration: what kind of run these entities are of."""
    there = list(entities)
    if pictures.pictures(there):
        return "scan"
    if result_views.FORCE_CURVE in result_views.titles(there):
        return "force curve"
    return "calibration" if layout.RESULT in there else "control"


def has_place(entity: str) -> bool:
    """Whether the arrangement depends on an entity being there."""
    return bool(layout.further([entity]) or pictures.pictures([entity]) or entity.startswith(layout.RESULT))


def blueprint(entities: Iterable[str], ranges: Ranges | None = None) -> rrb.Blueprint:
    """The screen of a run by its kind; in a second tab, all signals.

    Parameters
    ----------
    entities : iterable of str
        Those of the run that have a time; signals that there always are need not be among them.
    ranges : mapping, optional
        Of whole runs: then each axis has two numbers at least.
    """
    there, plots = set(entities), Plots(ranges or {})
    signals = _signals(plots, layout.further(there))
    found = kind(there)
    shown: list[rrb.Container] = []
    if found == "scan":
        shown.append(_scan(plots, pictures.pictures(there)))
    diagrams = result_views.titles(there)
    if diagrams or found == "calibration":
        shown.append(_result(plots, diagrams, "Force curve" if result_views.FORCE_CURVE in diagrams else "Result"))
    return tabbed(shown, signals)


def tabbed(shown: Sequence[rrb.Container], signals: rrb.Container) -> rrb.Blueprint:
    """Screens of what was found, the first one in front, the signals last."""
    return rrb.Blueprint(
        rrb.Tabs(*shown, signals, active_tab=0) if shown else signals,
        # At the end of the run, where an image is as complete as it will be.
        rrb.TimePanel(state="collapsed", timeline=layout.TIMELINE, play_state="following" if shown else None),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_views=False,
    )


def readable(low: float, high: float, height: float = _PLOT) -> Range | None:
    """Range of an axis in which two numbers at least are shown; None if the viewer's own is one.

    The viewer writes powers of ten and their multiples at an axis, of the least power at which they do not crowd: a
    signal between -84 and 84 gets nothing but a 0.

    `height` is that of the plot, in points.
    """
    if not (math.isfinite(low) and math.isfinite(high) and high > low):
        return None
    margin = 0.05 * (high - low)
    step = 10.0 ** math.ceil(math.log10((high - low + 2.0 * margin) * _LABEL / height))  # no part of a run
    first, last = math.ceil(low / step), math.floor(high / step)
    if last > first:
        return None
    low, high = low - margin, high + margin
    # To the nearer side, until there are two.
    while math.floor(high / step) - math.ceil(low / step) < 1:
        below, above = step * (math.ceil(low / step) - 1), step * (math.floor(high / step) + 1)
        if low - below < above - high:
            low = below - margin
        else:
            high = above + margin
    return low, high


class Plots:
    """Makes plots over time whose axes can be read.

    Parameters
    ----------
    ranges : mapping
    places : sequence of str
        Entity below which each run stands: a plot shows the signals of all of them.
    """

    def __init__(self, ranges: Ranges, places: Sequence[str] = ("",)) -> None:
        self._ranges, self._places = ranges, places

    def one(self, name: str, *signals: PlotSignal, axis: int | None = None) -> rrb.TimeSeriesView:
        """A plot of signals, or of one axis of theirs. Its name describes it: a legend would cover the curves."""
        shown = rr.SeriesLines.from_fields(visible_series=[axis in (None, k) for k in range(3)])
        known = [self._ranges[key] for signal in signals if (key := (signal.entity, axis or 0)) in self._ranges]
        span = readable(min(low for low, _ in known), max(high for _, high in known)) if known else None
        contents = [f"{place}{signal.entity}" for place in self._places for signal in signals]
        return rrb.TimeSeriesView(
            name=f"{name} [{signals[0].unit}]",
            origin="/",
            contents=contents,
            overrides=None if axis is None else {entity: shown.visualizer() for entity in contents},
            plot_legend=rrb.PlotLegend(visible=False),
            axis_y=None if span is None else rrb.ScalarAxis(range=span),
        )

    def three(self, name: str, *signals: PlotSignal, z: str | None = None) -> list[rrb.TimeSeriesView]:
        """One plot for each axis; `z`: name of that of z. x and y follow the same reference, and z is far smaller."""
        return [self.one((axis == "z" and z) or f"{name}, {axis}", *signals, axis=k) for k, axis in enumerate("xyz")]


def _signals(plots: Plots, further: Sequence[str]) -> rrb.Container:
    """The screen of a control run: signals in plots over simulated time; score, events and parameters below."""
    return rrb.Vertical(
        rrb.Grid(
            rrb.Tabs(
                *plots.three("Position, pale: reference", POSITION, REFERENCE, z="Sample z, pale: reference of the tip")
            ),
            rrb.Tabs(*plots.three("Tracking error", ERROR, z="Tracking error of the tip, z")),
            rrb.Tabs(plane("Friction loop: lateral force over x", layout.FRICTION_LOOP), _scene()),
            rrb.Tabs(plots.one("Lateral force, x", LATERAL_FORCE), plots.one("Lateral force, y", LATERAL_FORCE_Y)),
            rrb.Tabs(*plots.three("Drive", DRIVE)),
            rrb.Tabs(plots.one("Deflection", DEFLECTION), plots.one("Normal force", NORMAL_FORCE)),
            grid_columns=3,
        ),
        rrb.Horizontal(
            rrb.TextDocumentView(name="Run", origin=layout.RUN),
            rrb.Tabs(
                _events(),
                rrb.TextDocumentView(name="Parameters", origin=layout.PARAMETERS),
                rrb.TimeSeriesView(name="Changed parameters", origin="/", contents=[f"{layout.PARAMETERS}/**"]),
                plots.one("Round trip", layout.ROUND_TRIP),
                *(rrb.TimeSeriesView(name=name[1:], origin="/", contents=[name]) for name in further),
                active_tab="Events",
            ),
            column_shares=[1, 2],
        ),
        row_shares=[3, 1],
        name="Signals",
    )


def _scan(plots: Plots, images: Sequence[str]) -> rrb.Container:
    """Images as they grow; what they have come to, the signals and the events below."""
    table = rrb.TextDocumentView(name="Result", origin=layout.RESULT)
    below = rrb.Horizontal(table, _measured(plots), _events(), column_shares=[4, 4, 3])
    return rrb.Vertical(pictures.view(images), below, row_shares=[5, 3], name="Scan")


def _result(plots: Plots, diagrams: Mapping[str, str], name: str) -> rrb.Container:
    """Curves of a result over what they depend on, and its numbers as a table; signals and events next to them."""
    table = rrb.TextDocumentView(name="Result", origin=layout.RESULT)
    drawn = [plane(title, entity) for entity, title in diagrams.items()]
    signals, events = _measured(plots), _events()
    if not drawn:
        return rrb.Vertical(rrb.Horizontal(table, events), signals, row_shares=[1, 1], name=name)
    if len(drawn) == 1:
        rows = rrb.Horizontal(*drawn, rrb.Vertical(signals, events)), rrb.Horizontal(table)
    else:
        rows = rrb.Horizontal(*drawn), rrb.Horizontal(table, signals, events)
    return rrb.Vertical(*rows, row_shares=[5, 2], name=name)


def _measured(plots: Plots) -> rrb.Tabs:
    """What a microscope measures, over time, and the scene."""
    signals = [plots.one("Deflection", DEFLECTION), plots.one("Sample z", POSITION, axis=2)]
    forces = [plots.one("Lateral force, x", LATERAL_FORCE), plots.one("Normal force", NORMAL_FORCE)]
    return rrb.Tabs(*signals, *forces, _scene(), active_tab=0)


def plane(name: str, entity: str) -> rrb.Spatial2DView:
    """A drawing in a plane."""
    return rrb.Spatial2DView(name=name, origin=entity, contents="$origin/**")


def _events() -> rrb.View:
    return rrb.TextLogView(name="Events", origin=layout.EVENTS)


def _scene() -> rrb.View:
    return rrb.Spatial3DView(
        name="Scene",
        origin=layout.SCENE,
        contents="$origin/**",
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(position=scene.EYE, look_target=scene.TARGET, eye_up=(0.0, 0.0, 1.0)),
    )
