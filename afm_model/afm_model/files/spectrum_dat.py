"""Force curves as .dat, the text format of spectra of Nanonis controllers."""

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..core.errors import ResultFileError, reason
from ..microscope.results import TimeSeries
from ..microscope.verbs.force_curve import Curve, as_curves
from ..program.force_curve import APPROACH, RETRACT
from .result_files import replacing

if TYPE_CHECKING:
    import xarray

_Array = NDArray[np.float64]
SWEEP = "Z rel (m)"
"""First column: from where the curve was begun, positive away from the sample."""
COLUMNS = {
    "Z (m)": "z",
    "Vert. Deflection (V)": "deflection_voltage",
    "Horiz. Deflection (V)": "lateral_voltage",
}
"""Channel of a curve by its column; Z is -z."""
_NUMBERS = {
    "Approach rate (m/s)": "approach_rate",
    "Retract rate (m/s)": "retract_rate",
    "Deflection sensitivity (m/V)": "deflection_sensitivity",
    "Spring constant (N/m)": "spring_constant",
    "Trigger (V)": "trigger",
}


def write_dat(path: Path | str, curve: "Curve | xarray.Dataset", *, date: datetime | None = None) -> Path:
    """Write one force curve into a .dat file.

    The format has one axis for both ways, `Z rel (m)`, here that of the approach: the values of the retract are
    interpolated between its two nearest samples to the same z. The dwell and the time have no column. Z is positive
    away from the sample.

    Parameters
    ----------
    path : Path or str
        Ends with .dat. A file of this name is replaced once the new one is whole.
    curve : Curve, or its labelled arrays
    date : datetime, optional
        When it was measured; without, the present time.

    Raises
    ------
    ResultFileError
        If it cannot be written.
    ValueError
        If it is not one curve.
    """
    curves = as_curves(curve)
    if len(curves) != 1:
        raise ValueError(f"{path} is not written: a .dat file holds one force curve, these are {len(curves)}")
    (one,) = curves
    table = _table(one)
    lines = [f"{key}\t{value}\t" for key, value in _header(one, date or datetime.now()).items()]
    lines += ["", "[DATA]", "\t".join(table)]
    with replacing(path, ".dat") as beside, beside.open("w", encoding="ascii", newline="\r\n") as file:
        file.write("\n".join(lines) + "\n")
        np.savetxt(file, np.stack([*table.values()], axis=1), fmt="%.9E", delimiter="\t")
    return Path(path)


def _begun(curve: Curve) -> float:
    """Where z was before the curve [m]: the lift was taken from there."""
    z = curve.record.channels["z"]
    return float(z[0] if len(z) else 0.0) + (curve.verb.lift if curve.verb is not None else 0.0)


def _table(curve: Curve) -> dict[str, _Array]:
    channels, phase = curve.record.channels, curve.record.channels["phase"]
    there, back = phase == APPROACH, phase == RETRACT
    z, z_back = channels["z"][there], channels["z"][back]
    found = {SWEEP: _begun(curve) - z}
    for suffix, part in (("", there), (" [bwd]", back)):
        for column, name in COLUMNS.items():
            title, _, unit = column.rpartition(" ")
            values = -channels[name][part] if name == "z" else channels[name][part]
            if suffix:
                values = _at(z, z_back, values)
            found[f"{title}{suffix} {unit}"] = values
    return found


def _at(z: _Array, z_back: _Array, values: _Array) -> _Array:
    """Values of the retract at the z of the approach; NaN where the retract did not go."""
    if not len(z_back):
        return np.full(len(z), np.nan)
    # It goes back: np.interp wants z to rise.
    return np.interp(z, z_back[::-1], values[::-1], left=np.nan, right=np.nan)


def _header(curve: Curve, date: datetime) -> dict[str, str]:
    z, time = curve.record.channels["z"], curve.record.time
    lift = curve.verb.lift if curve.verb is not None else 0.0
    now = f"{date:%d.%m.%Y %H:%M:%S}"
    numbers = {
        "X (m)": curve.x,
        "Y (m)": curve.y,
        "Z (m)": -_begun(curve),
        "Z offset (m)": lift,
        "Z sweep distance (m)": -float(np.ptp(z)) if len(z) else 0.0,
        "Settling time (s)": 0.0,
        "Integration time (s)": float(np.median(np.diff(time))) if len(time) > 1 else 0.0,
        "Final Z (m)": -_begun(curve),
    }
    words = {"Experiment": "Z spectroscopy", "Saved Date": now, "User": "afm_model", "Date": now}
    words |= {key: f"{value:.9E}" for key, value in numbers.items()}
    words |= {"Z-Ctrl hold": "TRUE", "Triggered": str(curve.triggered).upper()}
    return words | {key: f"{getattr(curve, name):.9E}" for key, name in _NUMBERS.items()}


def read_curve(path: Path | str, deflection_sensitivity: float = 0.0, spring_constant: float = 0.0) -> Curve:
    """Read a force curve from a .dat file, of this package or of others.

    Times follow from the distances and the rates of approach and retract: the curve begins at 0. Files of others have
    no rates: their samples are one integration time apart.

    Parameters
    ----------
    path : Path or str
        With the columns `Z rel (m)` and `Vert. Deflection (V)`; backward and lateral ones if there are.
    deflection_sensitivity : float
        For vertical motion of the tip [m/V]; 0: that of the file.
    spring_constant : float
        For vertical forces [N/m]; 0: that of the file.

    Raises
    ------
    ResultFileError
        If it cannot be read, or is another kind of file; the message names it and says why.
    """
    try:
        header, columns = _parts(Path(path).read_text(encoding="latin-1"))
        given = {"deflection_sensitivity": deflection_sensitivity, "spring_constant": spring_constant}
        return _curve(header, columns, {name: value for name, value in given.items() if value})
    except (OSError, ValueError, KeyError) as error:
        raise ResultFileError(f"{path} cannot be read as a force curve: {reason(error)}") from None


def _parts(text: str) -> tuple[dict[str, str], dict[str, _Array]]:
    head, ended, data = text.replace("\r\n", "\n").partition("[DATA]\n")
    if not ended:
        raise ValueError("it has no line [DATA]")
    header = {}
    for line in head.splitlines():
        key, _, value = line.partition("\t")
        header[key] = value.strip()
    titles, _, numbers = data.partition("\n")
    names = titles.split("\t")
    rows = [[float(word) for word in line.split("\t")] for line in numbers.splitlines() if line.strip()]
    if any(len(row) != len(names) for row in rows):
        raise ValueError(f"it has rows of another number of values than its {len(names)} columns")
    table = np.array(rows, dtype=np.float64).reshape(len(rows), len(names))
    # The mean of several sweeps counts where the file has one.
    return header, {name.replace(" [AVG]", ""): table[:, i] for i, name in enumerate(names)}


def _curve(header: Mapping[str, str], columns: Mapping[str, _Array], given: Mapping[str, float]) -> Curve:
    for name in (SWEEP, "Vert. Deflection (V)"):
        if name not in columns:
            raise ValueError(f"it has no column {name}, its columns are {', '.join(columns)}")

    def number(key: str, otherwise: float) -> float:
        words = header.get(key, "N/A")
        return otherwise if words == "N/A" else float(words)

    numbers: dict[str, Any] = {name: number(key, np.nan) for key, name in _NUMBERS.items()} | {**given}
    begun = -number("Z (m)", 0.0)
    period = number("Integration time (s)", 1.0)
    parts: list[dict[str, _Array]] = []
    for suffix, phase in (("", APPROACH), (" [bwd]", RETRACT)):
        part = {"z": begun - columns[SWEEP]}
        for column, name in COLUMNS.items():
            title, _, unit = column.rpartition(" ")
            if name != "z" and (values := columns.get(f"{title}{suffix} {unit}")) is not None:
                part[name] = values
        if "deflection_voltage" not in part:
            continue
        part["phase"] = np.full(len(part["z"]), float(phase))
        measured = np.isfinite(part["deflection_voltage"])
        # A retract is from the sample away: the other way round than the rows.
        order = slice(None, None, -1 if suffix else 1)
        parts.append({name: values[measured][order] for name, values in part.items()})
    names = set.intersection(*(set(part) for part in parts))
    channels = {name: np.concatenate([part[name] for part in parts]) for name in parts[0] if name in names}
    rates = np.where(channels["phase"] == APPROACH, numbers["approach_rate"], numbers["retract_rate"])
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.abs(np.diff(channels["z"])) / rates[1:]
    time = np.concatenate([[0.0], np.cumsum(np.where(np.isfinite(steps), steps, period))])[: len(channels["z"])]
    units = {"z": "m", "deflection_voltage": "V", "lateral_voltage": "V", "phase": "1"}
    return Curve(
        TimeSeries(time, channels, {name: units[name] for name in channels}),
        triggered=header.get("Triggered", "FALSE") == "TRUE",
        x=number("X (m)", 0.0),
        y=number("Y (m)", 0.0),
        **{**numbers, "trigger": 0.0 if np.isnan(numbers["trigger"]) else numbers["trigger"]},
    )
