"""What a person asks a recording first, on one screen. Needs no ROS."""

import math
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from afm_model.core.prefix import prefixed

from . import layout
from .describe import NODES, not_default, parts, plain, quantity, scenario
from .reader import read_about
from .recording import About
from .score_text import facts, vectors
from .statistics import Gathered, Statistics

_EVENTS = 12
"""Events that are shown; of more the first and the last ones."""


def overview(path: Path, console: Console) -> None:
    """What a person asks first, on one screen."""
    gathered: dict[str, Gathered] = defaultdict(Gathered)
    about, signals = read_about(path, lambda name, times, values: gathered[name].put(times, values))
    order = {name: place for place, name in enumerate(layout.KNOWN)}
    names = sorted(signals, key=lambda name: (order.get(name, len(order)), name))
    kept = [each for name in names for each in gathered[name].statistics(signals[name])]
    ticks = next((each for each in kept if each.name == layout.ROUND_TRIP.name), None)
    about_run = Table(show_header=False, box=None, title=plain(str(path)), title_justify="left", pad_edge=False)
    named, law = parts(about)
    about_run.add_row(
        "file", f"{_size(path) / 1e6:.4g} MB, {'complete' if about.complete else 'NOT COMPLETE: ' + about.missing}"
    )
    about_run.add_row("scenario", plain(scenario(about)))
    about_run.add_row("parts", plain(named))
    about_run.add_row("law", plain(law))
    if ticks is not None:
        about_run.add_row(
            "duration",
            f"{quantity(ticks.end - ticks.begin + ticks.period, 's')}, {ticks.rows} ticks of "
            f"{quantity(ticks.period, 's')} ({quantity(1.0 / ticks.period, 'Hz')})",
        )
    console.print(about_run)
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
    return sum(file.stat().st_size for file in (path.iterdir() if path.is_dir() else [path]) if file.exists())


def _print_parameters(about: About, console: Console) -> None:
    table = Table("not the default", box=None, title_justify="left", pad_edge=False)
    for heading in ("value", "default", "unit"):
        table.add_column(heading)
    for node in NODES:
        for name, value, default, unit in not_default(node, about.parameters.get(node, {})):
            shown = [f"{each:.6g}" if isinstance(each, float) else str(each) for each in (value, default)]
            table.add_row(f"{node.removeprefix('afm_').removesuffix('_node')} {name}", *map(plain, shown), unit)
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
            table.add_row(quantity(time, "s"), until, plain(text))
    console.print(table)


def _print_score(about: About, console: Console) -> None:
    score = about.score
    if score is None:
        console.print("No score: the run has not come to one.")
        return
    table = Table("score", "x", "y", "z (tip)", box=None, pad_edge=False)
    for row in vectors(score):
        table.add_row(*map(plain, row))
    console.print(table)
    console.print(plain("; ".join(facts(score))))
    for name in ("reason", "warning", "trajectory_sha256"):
        if score.get(name):
            console.print(plain(f"{name}: {score[name]}"))


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
