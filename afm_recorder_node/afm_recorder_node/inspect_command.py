"""`ros2 run afm_recorder_node inspect RECORDING ...`: questions to recordings, answered in the terminal."""

import argparse
import csv
import math
import sys
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from numpy.typing import ArrayLike, NDArray
from rich.console import Console
from rich.table import Table

from afm_model.core.errors import ResultFileError, reason
from afm_model.core.outputs import require_file
from afm_model.core.prefix import prefixed

from . import layout, questions
from .describe import parts, plain, quantity, scenario
from .overview import overview, print_statistics
from .places import recordings
from .reader import read_about, read_signals, visit_signals
from .recording import IncompleteRecording, RecordingError
from .spectrum import read_spectrum
from .statistics import Gathered

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ROW = ("recording", "scenario", "plant", "law", "duration", "ticks", "valid", "rms_x", "rms_y", "rms_z", "max_x",
        "max_y", "max_z", "stick_phases", "trajectory_sha256", "problem")  # fmt: skip
_OPTIONS = {
    "signal": {"begin", "end", "plot", "csv", "parquet"},
    "psd": {"begin", "end", "axis", "plot", "csv", "parquet"},
    "loop": {"begin", "end", "axis", "plot", "csv", "parquet"},
    "compare": set[str](),
    "table": {"sort", "csv"},
    "": set[str](),
}
"""What each question takes: what would be passed over is refused."""
_SHOWN_AS = {"begin": "from", "end": "to"}
_LEAST = ("stick_phases", "plant", "valid", "trajectory_sha256", "ticks")
"""Columns of the table of many that go first where there is no room for all."""
_PICTURES = (".png", ".svg", ".pdf")
_UNITS = {"duration": "s"} | {f"{what}_{axis}": "m" for what in ("rms", "max") for axis in "xyz"}


def _draw(path: Path, x: ArrayLike, y: ArrayLike, labels: tuple[str, str], title: str, log: bool = False) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 4.5), layout="constrained")
    axes: Axes = figure.subplots()
    axes.plot(x, y, linewidth=0.8)
    if log:
        axes.set(xscale="log", yscale="log")
    axes.set(xlabel=labels[0], ylabel=labels[1], title=title)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=120)


def _write(arguments: argparse.Namespace, table: dict[str, NDArray[np.float64]]) -> None:
    if arguments.csv:
        questions.write_csv(arguments.csv, table)
    if arguments.parquet:
        questions.write_parquet(arguments.parquet, table)


def _signal(path: Path, arguments: argparse.Namespace, console: Console) -> None:
    name, axis = questions.split(arguments.signal)
    gathered = Gathered()
    signals = visit_signals(path, [name], lambda _, *rows: gathered.put(*rows), arguments.begin, arguments.end)
    if not gathered.rows:
        raise RecordingError(f"{path}: {name} has no row from {arguments.begin:g} s to {arguments.end:g} s")
    found = gathered.statistics(signals[name])
    if axis and len(found) == 1:
        raise RecordingError(f"{path}: {name} has no axes: leave .{axis} out")
    print_statistics([each for each in found if not axis or each.name == arguments.signal], console)
    if not (arguments.plot or arguments.csv or arguments.parquet):
        return
    signal = read_signals(path, [name], arguments.begin, arguments.end)[name]
    table = questions.columns(name, signal)
    table = {each: table[each] for each in table if arguments.signal in (name, each)}
    _write(arguments, {"time_s": signal.time} | {f"{each}_{signal.unit}": table[each] for each in table})
    if arguments.plot:
        values = np.column_stack(list(table.values()))
        factor, unit = prefixed(signal.unit, *np.nanmax(np.abs(values), axis=0))
        _draw(arguments.plot, signal.time, factor * values, ("time [s]", f"{arguments.signal} [{unit}]"), path.name)


def _psd(path: Path, arguments: argparse.Namespace, console: Console) -> None:
    name, si_unit, found = read_spectrum(path, arguments.psd, arguments.begin, arguments.end, arguments.axis)
    console.print(
        f"{name}: rms {quantity(found.rms, si_unit)} about the mean, median level "
        f"{quantity(found.floor, f'{si_unit}/sqrt(Hz)')}; {found.samples} samples, {found.segments} stretches, "
        f"resolution {quantity(found.frequency[0], 'Hz')}"
    )
    for frequency, rms in found.lines():
        console.print(f"  {quantity(frequency, 'Hz')}: {quantity(rms, si_unit)} rms")
    unit = f"{si_unit}^2/Hz"
    _write(arguments, {"frequency_Hz": found.frequency, f"density_{unit}": found.density})
    if arguments.plot:
        _draw(
            arguments.plot, found.frequency, found.density, ("frequency [Hz]", f"{name} [{unit}]"), path.name, log=True
        )


def _loop(path: Path, arguments: argparse.Namespace, console: Console) -> None:
    made = questions.loop(path, arguments.axis, arguments.begin, arguments.end)
    half, offset, slope = made.found
    for what, (value, spread), unit in (
        ("width (twice the friction)", (2.0 * half.value, 2.0 * half.uncertainty), "N"),
        ("friction, half the width", half, "N"),
        ("offset", offset, "N"),
        ("slope after a turn", slope, "N/m"),
    ):
        console.print(f"{what}: {quantity(value, unit)} +- {quantity(spread, unit)}")
    console.print(f"energy of a cycle: {quantity(made.energy, 'J')} (mean of {made.cycles:g})")
    _write(arguments, {f"position.{arguments.axis}_m": made.position, "lateral_force_N": made.force})
    if arguments.plot:
        labels = (f"position along {arguments.axis} [nm]", "lateral force [nN]")
        _draw(arguments.plot, 1e9 * made.position, 1e9 * made.force, labels, path.name)


def _compare(path: Path, other: Path, console: Console) -> int:
    found, words = questions.compare(path, other)
    for sentence in words:
        console.print(plain(sentence))
    for k, each in enumerate(found):
        if not k:
            console.print(f"The first tick that differs is {each.tick}, at {each.time:.9g} s, in {each.name}.")
        values = f"{each.one!r} and {each.other!r} {each.unit}" if math.isfinite(each.one) else "only in one of the two"
        console.print(
            f"{each.name}: from tick {each.tick} on ({each.time:.9g} s): {values}; {each.rows} rows, at most "
            f"{quantity(each.largest, each.unit)}"
        )
    if not found and not words:
        console.print("no difference in any bit of signals and parameters (wall times are not compared)")
    return 1 if found or words else 0


def row(path: Path) -> dict[str, object]:
    """One recording as a row of the table of many, in SI units."""
    rows: list[tuple[int, int]] = []

    def see(name: str, times: NDArray[np.int64], values: NDArray[np.float64]) -> None:
        rows.append((len(times), int(times[-1])))

    made: dict[str, object] = {name: "" for name in _ROW}
    made["recording"] = str(path)
    try:
        about, _ = read_about(path, see, [layout.ROUND_TRIP.name])
    except RecordingError as error:
        return made | {"problem": str(error)}
    ticks = sum(count for count, _ in rows)
    known = about.parameters.get("afm_sim_node", {})
    period = known.get("plant.control_period", 0.0)
    last = max((last for _, last in rows), default=0) / 1e9
    made |= {"scenario": scenario(about), "plant": known.get("plant.kind", ""), "law": parts(about)[1], "ticks": ticks}
    made |= {"duration": last + (float(period) if isinstance(period, int | float) and ticks else 0.0)}
    made |= {"problem": "" if about.complete else f"{path} is not complete: {about.missing}"}
    for name, value in (about.score or {}).items():
        if isinstance(value, dict):
            made |= {f"{name}_{axis}": number for axis, number in value.items() if f"{name}_{axis}" in _ROW}
        elif name in _ROW and name != "ticks":
            made[name] = value
    return made


def _heading(name: str) -> str:
    return name.removeprefix("trajectory_")


def _cell(name: str, value: object) -> str:
    """A value of the table of many as it is shown."""
    text = quantity(value, _UNITS[name]) if isinstance(value, float) and name in _UNITS else str(value)
    if name == "recording":
        text = "/".join(Path(text).parts[-2:])
    text = text.replace(" with ", " *", 1).partition("*")[0] + "*" * (" with " in text)
    return text[:8] if name == "trajectory_sha256" else text


def _table(paths: Sequence[Path], arguments: argparse.Namespace, console: Console) -> int:
    rows = [row(path) for path in paths]
    if arguments.sort:
        if arguments.sort not in _ROW:
            raise RecordingError(f"there is no column {arguments.sort}: there is {', '.join(_ROW)}")
        rows.sort(
            key=lambda each: (each[arguments.sort] == "", isinstance(each[arguments.sort], str), each[arguments.sort])
        )
    if arguments.csv:
        with open(arguments.csv, "w", newline="") as file:
            writer = csv.DictWriter(file, _ROW)
            writer.writeheader()
            writer.writerows(rows)
    told = {name: [_cell(name, each[name]) for each in rows] for name in _ROW[:-1] if not name.startswith("max_")}
    told = {name: cells for name, cells in told.items() if any(cells)}
    left_out = [name for name in _LEAST if name in told]
    kept = dict(told)
    while left_out and sum(2 + max(map(len, [_heading(name), *cells])) for name, cells in kept.items()) > console.width:
        del kept[left_out.pop(0)]
    table = Table(*map(_heading, kept), box=None, pad_edge=False)
    for cells in zip(*kept.values(), strict=True):
        table.add_row(*map(plain, cells))
    console.print(table)
    if len(kept) < len(told):
        console.print(f"no room for {', '.join(name for name in told if name not in kept)}: --csv FILE has all")
    for each in rows:
        if each["problem"]:
            console.print(plain(str(each["problem"])))
    return 1 if any(not each["scenario"] for each in rows) else 0


def _time(text: str) -> float:
    """Return a time of the command line [s]; an infinite one has no bound."""
    value = float(text)
    if math.isnan(value):
        raise argparse.ArgumentTypeError(f"{text} s is not allowed: it must be a number")
    return value


def _arguments(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="inspect",
        description="Ask recordings something. Without a question: what a person asks first, on one screen. "
        "The exit code is 0; with --compare 1 if they differ; "
        "with --table 1 if one of them cannot be read, else 2 for that.",
    )
    parser.add_argument(
        "recordings", nargs="+", metavar="RECORDING", help="files, folders, or patterns such as 'out/*/*.mcap'"
    )
    question = parser.add_mutually_exclusive_group()
    question.add_argument(
        "--signal", metavar="NAME", help="statistics of a signal: deflection, position, position.x, ..."
    )
    question.add_argument("--psd", metavar="NAME", help="spectral density: rms, level, largest lines")
    question.add_argument("--loop", action="store_true", help="friction loop: width, slope, energy of a cycle")
    question.add_argument(
        "--compare", type=Path, metavar="OTHER", help="the first tick that differs, where, by how much"
    )
    question.add_argument("--table", action="store_true", help="one row for each recording")
    parser.add_argument("--from", dest="begin", type=_time, default=-math.inf, metavar="S", help="simulated time [s]")
    parser.add_argument("--to", dest="end", type=_time, default=math.inf, metavar="S", help="simulated time [s]")
    parser.add_argument("--axis", choices=("x", "y", "z"), help="of --loop (x, y) and --psd (default x)")
    parser.add_argument("--sort", metavar="COLUMN", help="of --table")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw the answer into a .png, .svg or .pdf")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the answer, in SI units")
    parser.add_argument("--parquet", type=Path, metavar="FILE", help="the same")
    found = parser.parse_args(arguments)
    if found.loop and found.axis == "z":
        parser.error("--loop needs --axis x or y")
    asked = next((name for name in _OPTIONS if getattr(found, name, None)), "")
    for name in sorted({each for names in _OPTIONS.values() for each in names} - _OPTIONS[asked]):
        if getattr(found, name) != parser.get_default(name):
            told = " or ".join(f"--{each}" for each, names in _OPTIONS.items() if name in names)
            parser.error(f"--{_SHOWN_AS.get(name, name)} is an option of {told}")
    if not found.begin <= found.end:
        parser.error(f"--from {found.begin:g} s is not allowed with --to {found.end:g} s: it must not be later")
    found.axis = found.axis or "x"
    if found.plot and found.plot.suffix not in _PICTURES:
        parser.error(f"--plot {found.plot}: the name of a picture ends in {', '.join(_PICTURES)}")
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Entry point; see `--help` for the exit code."""
    asked = _arguments(arguments)
    console = Console(width=None if Console().is_terminal else 140, highlight=False)
    worst = 0
    warnings.showwarning = lambda message, *_: print(f"warning: {message}", file=sys.stderr)
    # Screen and table say it themselves.
    by_itself = asked.table or not (asked.signal or asked.psd or asked.loop or asked.compare)
    warnings.simplefilter("ignore" if by_itself else "always", IncompleteRecording)
    try:
        for file in (asked.plot, asked.csv, asked.parquet):
            require_file(file)
        paths = recordings(asked.recordings)
        if asked.table:
            return _table(paths, asked, console)
        if len(paths) > 1 and (asked.plot or asked.csv or asked.parquet):
            raise RecordingError(f"{len(paths)} recordings cannot be written into one file: give one")
        for path in paths:
            if len(paths) > 1:
                console.print(plain(str(path)), style="bold")
            if asked.signal:
                _signal(path, asked, console)
            elif asked.psd:
                _psd(path, asked, console)
            elif asked.loop:
                _loop(path, asked, console)
            elif asked.compare:
                worst = max(worst, _compare(path, asked.compare, console))
            else:
                overview(path, console)
    except (RecordingError, ResultFileError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except (OSError, pa.ArrowException) as error:
        file = asked.csv or asked.parquet or asked.plot or "the answer"
        print(f"error: {file} cannot be written: {reason(error)}", file=sys.stderr)
        return 2
    return worst


if __name__ == "__main__":
    sys.exit(main())
