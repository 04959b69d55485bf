"""What a person asks a recording first, on one screen. Needs no ROS."""

import math
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from afm_model.core.prefix import prefixed

from . import layout
from .describe import NODES, not_default, parts, quantity, scenario
from .reader import read_about
from .recording import About
from .statistics import Gathered, Statistics

_EVENTS = 12
"""Events that are shown; of more the first and the last ones."""
_SCORED = {"rms": "m", "max": "m", "max_percent": "%", "drive_total_variation": "V/s", "extent": "m"}
"""Vectors of a score, and their units."""
_SHARES = {"stick_fraction": "stick", "contact_fraction": "in contact", "retracted_fraction": "retracted"}


def overview(path: Path, console: Console) -> None:
    """What a person asks first, on one screen."""
    gathered: dict[str, Gathered] = defaultdict(Gathered)
    about, signals = read_about(path, lambda entity, times, values: gathered[entity].put(times, values))
    kept = [each for entity, signal in signals.items() for each in gathered[entity].statistics(signal)]
    ticks = next((each for each in kept if each.name == layout.ROUND_TRIP.name), None)
    facts = Table(show_header=False, box=None, title=escape(str(path)), title_justify="left", pad_edge=False)
    named, law = parts(about)
    facts.add_row("file", f"{_size(path) / 1e6:.4g} MB, {'complete' if about.complete else 'WITHOUT AN END'}")
    facts.add_row("scenario", escape(scenario(about)))
    facts.add_row("parts", escape(named))
    facts.add_row("law", escape(law))
    if ticks is not None:
        facts.add_row(
            "duration",
            f"{quantity(ticks.end - ticks.begin + ticks.period, 's')}, {ticks.rows} ticks of "
            f"{quantity(ticks.period, 's')} ({quantity(1.0 / ticks.period, 'Hz')})",
        )
    console.print(facts)
    _print_parameters(about, console)
    _print_events(about, console)
    _print_score(about, console)
    for image in about.images:
        console.print(
            f"Scan of {image.scan.pixels} x {image.scan.lines} pixels, {quantity(image.scan.size_x, 'm')} wide: "
            f"{image.lines_done} of {image.scan.lines} lines, {', '.join(image.units)}."
        )
    print_statistics(kept, console)


def _size(path: Path) -> int:
    return sum(file.stat().st_size for file in (path.iterdir() if path.is_dir() else [path]))


def _print_parameters(about: About, console: Console) -> None:
    table = Table("not the default", box=None, title_justify="left", pad_edge=False)
    for heading in ("value", "default", "unit"):
        table.add_column(heading)
    for node in NODES:
        for name, value, default, unit in not_default(node, about.parameters.get(node, {})):
            shown = [f"{each:.6g}" if isinstance(each, float) else str(each) for each in (value, default)]
            table.add_row(f"{node.removeprefix('afm_').removesuffix('_node')} {name}", *map(escape, shown), unit)
    if table.row_count:
        console.print(table)


def _print_events(about: About, console: Console) -> None:
    table = Table("time", "until next", "event", box=None, pad_edge=False)
    times = [time for time, _ in about.events]
    for k, (time, text) in enumerate(about.events):
        if len(times) > _EVENTS and k == _EVENTS // 2:
            table.add_row("...", "", f"{len(times) - _EVENTS} more events")
        if len(times) <= _EVENTS or not _EVENTS // 2 <= k < len(times) - _EVENTS // 2:
            until = quantity(times[k + 1] - time, "s") if k + 1 < len(times) else ""
            table.add_row(quantity(time, "s"), until, escape(text))
    console.print(table)


def _print_score(about: About, console: Console) -> None:
    score = about.score
    if score is None:
        console.print("No score: the run has not come to one.")
        return
    table = Table("score", "x", "y", "z (tip)", box=None, pad_edge=False)
    for name, unit in _SCORED.items():
        vector = score.get(name)
        if isinstance(vector, dict):
            factor, unit = prefixed(unit, *vector.values())
            table.add_row(escape(f"{name} [{unit}]"), *(f"{factor * vector[axis]:.4g}" for axis in "xyz"))
    console.print(table)
    told = [f"{what} {100.0 * float(share):.4g} %" for name, what in _SHARES.items()
            if isinstance(share := score.get(name), float)]  # fmt: skip
    for what in ("friction", "normal_force"):
        low, high = score.get(f"{what}_min"), score.get(f"{what}_max")
        if isinstance(low, float) and isinstance(high, float):
            factor, unit = prefixed("N", low, high)
            told.append(f"{what.replace('_', ' ')} {factor * low:.4g} to {factor * high:.4g} {unit}")
    told += [f"{name} {value}" for name, value in score.items() if type(value) is int and value]
    trip = score.get("round_trip")
    if isinstance(trip, dict):
        told.append("round trip " + ", ".join(f"{name} {quantity(value, 's')}" for name, value in trip.items()))
    console.print(escape("; ".join(told)))
    for name in ("reason", "warning", "trajectory_sha256"):
        if score.get(name):
            console.print(escape(f"{name}: {score[name]}"))


def print_statistics(kept: Sequence[Statistics], console: Console) -> None:
    """A row for each signal: rate, range, mean, rms, gaps."""
    table = Table("signal", box=None, pad_edge=False)
    for heading in ("rate", "rows", "least", "largest", "mean", "rms", "unit"):
        table.add_column(heading, justify="right")
    table.add_column("gaps")
    for each in kept:
        factor, unit = prefixed(each.unit, each.low, each.high)
        numbers = (
            "-" if value != value else f"{factor * value:.4g}" for value in (each.low, each.high, each.mean, each.rms)
        )
        lost = [f"{count} rows missing after {quantity(time, 's')}" for time, count in each.gaps[:1]]
        if len(each.gaps) > 1:
            lost.append(f"{len(each.gaps)} gaps, {sum(count for _, count in each.gaps)} rows in all")
        if each.unknown:
            lost.append(f"{each.unknown} NaN")
        rate = quantity(1.0 / each.period if each.period > 0.0 else math.nan, "Hz")
        table.add_row(each.name, rate, str(each.rows), *numbers, unit, "; ".join(lost) or "none")
    console.print(table)
