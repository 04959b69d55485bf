"""What may be asked of the signals of a recording: friction loop, difference from another one."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
from numpy.typing import NDArray

from afm_model.analysis import LoopForces, dissipated, friction_loop

from . import layout
from .places import MessageSource, open_recording
from .reader import read_about, read_signals
from .recording import RecordedChannel, RecordingError

_Array = NDArray[np.float64]
AXES = "xyz"
_CLOSED = 0.02
"""Part of its range by which the end of a loop may miss its begin."""


def split(name: str) -> tuple[str, str]:
    """position.y as position and y; no axis where the name has none."""
    base, _, axis = name.rpartition(".")
    return (base, axis) if base and axis in tuple(AXES) else (name, "")


def columns(name: str, signal: RecordedChannel) -> dict[str, _Array]:
    """A signal as columns by name: position.x, position.y, position.z; deflection."""
    if signal.values.ndim == 1:
        return {name: signal.values}
    return {f"{name}.{axis}": signal.values[:, i] for i, axis in enumerate(AXES)}


def write_csv(path: Path, table: dict[str, _Array]) -> None:
    """Write columns into a .csv file, every digit of them."""
    pyarrow.csv.write_csv(pa.table(table), path)


def write_parquet(path: Path, table: dict[str, _Array]) -> None:
    """Write columns into a .parquet file."""
    pyarrow.parquet.write_table(pa.table(table), path)


@dataclass(frozen=True)
class LateralLoop:
    """The friction loop of a recording: lateral force against position along one axis."""

    position: _Array  # [m]
    force: _Array  # [N]
    found: LoopForces
    energy: float  # dissipated in a cycle [J]
    cycles: float


def loop(path: Path, axis: str = "x", begin: float = -math.inf, end: float = math.inf) -> LateralLoop:
    """Friction loop along x or y: the force at the times of the ticks.

    Raises
    ------
    RecordingError
        If there is no loop: no force, or no trace and retrace.
    """
    channel = (layout.LATERAL_FORCE if axis == "x" else layout.LATERAL_FORCE_Y).name
    read = read_signals(path, [layout.POSITION.name, channel], begin, end)
    position, force = read[layout.POSITION.name], read[channel]
    if len(position.time) < 2 or len(force.time) < 2:
        raise RecordingError(f"{path} has no friction loop along {axis}: no rows from {begin:g} s to {end:g} s")
    inside = (position.time >= force.time[0]) & (position.time <= force.time[-1])
    x = position.values[inside, AXES.index(axis)]
    y = np.interp(position.time[inside], force.time, force.values)
    known = np.isfinite(x) & np.isfinite(y)
    x, y = once = x[known], y[known]
    if len(x) and abs(x[-1] - x[0]) < _CLOSED * np.ptp(x):
        # A run of whole periods: its end continues with its begin, and turns that are missing at its ends are there.
        x, y = np.concatenate([x, x]), np.concatenate([y, y])
    try:
        energy, cycles = dissipated(x, y)
        return LateralLoop(*once, friction_loop(x, y), energy, cycles)
    except (ValueError, IndexError) as error:
        raise RecordingError(f"{path} has no friction loop along {axis}: {error}") from None


@dataclass(frozen=True)
class Difference:
    """Where two recordings part in one column."""

    name: str
    unit: str
    time: float  # [s]
    tick: int
    one: float
    other: float
    largest: float
    """Largest difference of all rows."""
    rows: int
    """Rows that differ, or that one of the two lacks."""


def compare(path: Path, other: Path) -> tuple[list[Difference], list[str]]:
    """Differences of two recordings, the first in time first; those of the signals, and in words those of the rest.

    The wall times of the round trip are not compared. NaN equals NaN.
    """
    return _compare(open_recording(path), open_recording(other))


def _compare(*sources: MessageSource) -> tuple[list[Difference], list[str]]:
    abouts, signals, ticks = [], [], np.empty(0)
    for each in sources:
        about, found = read_about(each, lambda *_: None)
        abouts.append(about)
        signals.append({signal.name: signal for signal in found.values()})
    words = [f"only one of the two holds {name}" for name in sorted(signals[0].keys() ^ signals[1].keys())]
    for node in sorted(abouts[0].parameters.keys() & abouts[1].parameters.keys()):
        given, others = (about.parameters[node] for about in abouts)
        changed = [name for name in sorted({*given, *others}) if given.get(name) != others.get(name)]
        words += [f"{node}: {name} is {given.get(name)} in one, {others.get(name)} in the other" for name in changed]
    found_differences = []
    order = [signal.name for signal in (layout.DRIVE, layout.REFERENCE, layout.POSITION)]
    names = sorted(signals[0].keys() & signals[1].keys() - {layout.ROUND_TRIP.name})
    for name in sorted(names, key=lambda each: (order.index(each) if each in order else len(order), each)):
        one, two = (read_signals(each, [name])[name] for each in sources)
        if name == layout.DRIVE.name or not len(ticks):
            ticks = one.time
        common = one.time
        at_one = at_two = np.arange(len(common))
        if not np.array_equal(one.time, two.time):
            common, at_one, at_two = np.intersect1d(one.time, two.time, return_indices=True)
        missing = len(one.time) + len(two.time) - 2 * len(common)
        pairs = zip(columns(name, one).items(), columns(name, two).values(), strict=True)
        for (column, a), b in pairs:
            u, v = a[at_one], b[at_two]
            differ = np.flatnonzero((u != v) & ~(np.isnan(u) & np.isnan(v)))
            if not len(differ) and not missing:
                continue
            if len(differ):
                first, values = common[differ[0]], (float(u[differ[0]]), float(v[differ[0]]))
            else:
                first, values = float(np.setxor1d(one.time, two.time)[0]), (math.nan, math.nan)
            tick = int(np.searchsorted(ticks, first, "right")) - 1
            gap = np.abs(u[differ] - v[differ])
            largest = float(np.nanmax(gap)) if len(gap) and not np.isnan(gap).all() else math.nan
            found_differences.append(
                Difference(column, one.unit, float(first), tick, *values, largest, len(differ) + missing)
            )
    return sorted(found_differences, key=lambda each: each.time), words
