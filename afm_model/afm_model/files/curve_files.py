"""Force curves as files for afmformats (and nanite and PyJibe, which use it): HDF5 and tab."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..core.optional import needed
from ..microscope.verbs.force_curve import Curve, as_curves
from ..program.force_curve import APPROACH, RETRACT
from .result_files import replacing

if TYPE_CHECKING:
    import xarray

_Array = NDArray[np.float64]
UNITS = {
    "force": "N",
    "height (measured)": "m",
    "height (piezo)": "m",
    "segment": "",
    "time": "s",
    "tip position": "m",
}
"""Of the columns."""


@dataclass(frozen=True)
class _Table:
    """One curve in the words of afmformats."""

    columns: dict[str, _Array]
    notes: dict[str, Any]


def _table(curve: Curve, number: int, session: str, grid: Mapping[str, float]) -> _Table:
    record = curve.record
    phase = record.channels["phase"]
    # afmformats has an approach and a retract; z rests in between.
    part = (phase == APPROACH) | (phase == RETRACT)
    time, retract = record.time[part], phase[part] == RETRACT
    deflection = record.channels["deflection_voltage"][part] * curve.deflection_sensitivity
    height = -record.channels["z"][part]
    steps = np.diff(record.time)
    # Times are sums: their last digits are rounding.
    rate = float(f"{1.0 / np.median(steps):.9g}") if len(steps) else 0.0
    notes: dict[str, Any] = {
        "imaging mode": "force-distance",
        "feedback mode": "contact",
        "sensitivity": curve.deflection_sensitivity,
        "spring constant": curve.spring_constant,
        "setpoint": curve.trigger * curve.deflection_sensitivity * curve.spring_constant,
        "speed approach": curve.approach_rate,
        "speed retract": curve.retract_rate,
        "rate approach": rate,
        "rate retract": rate,
        "duration": float(np.ptp(time)) if len(time) else 0.0,
        "duration approach": float(np.sum(~retract)) / rate if rate else 0.0,
        "duration retract": float(np.sum(retract)) / rate if rate else 0.0,
        "z range": float(np.ptp(height)) if len(height) else 0.0,
        "point count": int(np.sum(part)),
        "position x": curve.x,
        "position y": curve.y,
        "instrument": "virtual atomic force microscope",
        "software": "afm_model",
        "software version": _version(),
        "session id": session,
        "curve id": f"{session}_{number}",
        "enum": number,
        **grid,
    }
    columns = {
        "force": deflection * curve.spring_constant,
        # There is no sensor along z. Maps of afmformats and nanite read this column and no other.
        "height (measured)": height,
        "height (piezo)": height,
        "segment": retract.astype(np.uint8),
        "time": time - time[0] if len(time) else time,
        "tip position": height + deflection,
    }
    return _Table(columns, notes)


def _version() -> str:
    try:
        return version("afm_model")
    except PackageNotFoundError:  # run from its sources
        return "unknown"


def _grid(curves: Sequence[Curve]) -> dict[str, float]:
    """Where the curves lie on a full grid: its keys."""
    found: dict[str, float] = {}
    places = {axis: np.array([getattr(curve, axis) for curve in curves]) for axis in "xy"}
    values = {axis: np.unique(np.round(each, 13)) for axis, each in places.items()}
    counts = {axis: len(each) for axis, each in values.items()}
    if min(counts.values()) < 2 or counts["x"] * counts["y"] != len(curves):
        return {}
    if len({*zip(*(np.round(each, 13) for each in places.values()), strict=True)}) != len(curves):
        return {}
    for axis, each in values.items():
        step = np.diff(each)
        if np.ptp(step) > 1e-3 * step[0]:
            return {}
        found[f"grid shape {axis}"] = counts[axis]
        found[f"grid center {axis}"] = float(0.5 * (each[0] + each[-1]))
        # With half a step around the outermost curves.
        found[f"grid size {axis}"] = float(each[-1] - each[0] + step.mean())
    return found


def write_curves(path: Path | str, curves: "Curve | Sequence[Curve] | xarray.Dataset") -> Path:
    """Write force curves into an HDF5 file, .h5, as afmformats has it.

    A group for each curve, `0`, `1`, ..., with its metadata as attributes and the columns `force` [N], `height (piezo)`
    [m] (falls towards the sample), the same again as `height (measured)` because the instrument has no sensor along z,
    `tip position` [m], `time` [s] from the curve's first sample, `segment` (0 approach, 1 retract). The groups have the
    order of the curves. Curves on a full grid of places are marked as a map. The dwell and the lateral signal have no
    place in this format; the labelled arrays keep them.

    Parameters
    ----------
    path : Path or str
        Ends with .h5. A file of this name is replaced once the new one is whole.
    curves : Curve or sequence of Curve, or their labelled arrays

    Raises
    ------
    ResultFileError
        If it cannot be written.
    ValueError
        If there is no curve, or it is something else.
    ImportError
        If h5py is not installed.
    """
    tables = _tables(path, curves)
    h5py = needed("h5py", "an HDF5 file")
    # In memory first: the library does not survive a disk that is full.
    content = BytesIO()
    # Readers take the groups in the order in which the file lists them; by name, 10 comes before 2.
    with h5py.File(content, "w", track_order=True) as file:
        file.attrs["software"] = tables[0].notes["software"]
        file.attrs["software version"] = tables[0].notes["software version"]
        for number, table in enumerate(tables):
            group = file.create_group(str(number))
            group.attrs.update(table.notes)
            for name, values in table.columns.items():
                group.create_dataset(name, data=values, fletcher32=len(values) > 0).attrs["unit"] = UNITS[name]
    with replacing(path, ".h5") as beside:
        beside.write_bytes(content.getvalue())
    return Path(path)


def write_curve_tab(path: Path | str, curve: "Curve | xarray.Dataset") -> Path:
    """Write one force curve into a text file, .tab, as afmformats has it: metadata as JSON, columns with tabs.

    Columns and keys are those of `write_curves`, with 9 digits.

    Parameters
    ----------
    path : Path or str
        Ends with .tab. A file of this name is replaced once the new one is whole.
    curve : Curve, or its labelled arrays

    Raises
    ------
    ResultFileError
        If it cannot be written.
    ValueError
        If it is not one curve.
    """
    tables = _tables(path, curve)
    if len(tables) > 1:
        raise ValueError(f"{path} is not written: a .tab file holds one force curve, these are {len(tables)}")
    (table,) = tables
    notes = json.dumps(table.notes, sort_keys=True, indent=2).splitlines()
    head = ["# afm_model", "#", "# BEGIN METADATA", *(f"# {each}" for each in notes), "# END METADATA", "#"]
    columns = list(table.columns)
    rows = np.stack([table.columns[name] for name in columns], axis=1)
    with replacing(path, ".tab") as beside, beside.open("w", encoding="utf-8") as file:
        file.write("\n".join([*head, "# " + "\t".join(columns)]) + "\n")
        np.savetxt(file, rows, fmt=["%d" if name == "segment" else "%.9g" for name in columns], delimiter="\t")
    return Path(path)


def _tables(path: Path | str, curves: "Curve | Sequence[Curve] | xarray.Dataset") -> list[_Table]:
    every = as_curves(curves)
    if not every:
        raise ValueError(f"{path} is not written: there is no force curve to write")
    grid = _grid(every)
    return [_table(curve, number, Path(path).stem, grid) for number, curve in enumerate(every)]
