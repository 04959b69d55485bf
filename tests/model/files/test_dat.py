"""Claims about force curves as .dat: what a parser of the layout, Gwyddion and this package read from them."""

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from afm_model.core.errors import ResultFileError
from afm_model.files import read_curve, write_dat
from afm_model.microscope.verbs.force_curve import Curve
from afm_model.program.force_curve import APPROACH, DWELL, RETRACT

from . import scans
from .readers import gwyddion

COLUMNS = ["Z rel (m)", "Z (m)", "Vert. Deflection (V)", "Horiz. Deflection (V)"]
BACK = ["Z [bwd] (m)", "Vert. Deflection [bwd] (V)", "Horiz. Deflection [bwd] (V)"]


def parsed(path: Path) -> tuple[dict[str, str], dict[str, np.ndarray]]:
    """Header and columns, by the layout alone."""
    lines = path.read_bytes().decode("ascii").split("\r\n")
    assert "\n" not in "".join(lines) and lines.pop() == ""
    blank = lines.index("")
    assert lines[blank + 1] == "[DATA]"
    header = {}
    for line in lines[:blank]:
        key, value, nothing = line.split("\t")
        assert nothing == ""
        header[key] = value
    names = lines[blank + 2].split("\t")
    rows = np.array([[float(word) for word in line.split("\t")] for line in lines[blank + 3 :]]).reshape(-1, len(names))
    return header, dict(zip(names, rows.T, strict=True))


@pytest.fixture
def curve() -> Curve:
    return scans.curve(3e-9, -2e-9)


def test_columns_are_both_ways_over_the_distance_from_the_begin_with_z_away_from_the_sample(tmp_path, curve):
    header, columns = parsed(write_dat(tmp_path / "curve.dat", curve, date=datetime(2026, 1, 2, 3, 4, 5)))
    assert list(columns) == COLUMNS + BACK
    z, phase = curve.record.channels["z"], curve.record.channels["phase"]
    there = z[phase == APPROACH]
    # The lift of 200 nm was taken first: the sweep begins that far away, and goes towards the sample.
    np.testing.assert_allclose(columns["Z rel (m)"], 200e-9 - there, atol=1e-16)
    np.testing.assert_allclose(columns["Z (m)"], -there, atol=1e-16)
    for name, channel in (("Vert. Deflection", "deflection_voltage"), ("Horiz. Deflection", "lateral_voltage")):
        values = curve.record.channels[channel]
        np.testing.assert_allclose(columns[f"{name} (V)"], values[phase == APPROACH], rtol=1e-8)
        # In the order of the rows, which is that of the approach.
        np.testing.assert_allclose(columns[f"{name} [bwd] (V)"], values[phase == RETRACT][::-1], rtol=1e-8)
    assert (header["Experiment"], header["Date"]) == ("Z spectroscopy", "02.01.2026 03:04:05")
    numbers = {"X (m)": 3e-9, "Y (m)": -2e-9, "Z (m)": -200e-9, "Z offset (m)": 200e-9, "Z sweep distance (m)": -1e-7}
    assert {name: float(header[name]) for name in numbers} == pytest.approx(numbers)


def other_rate(curve: Curve) -> Curve:
    """The same with a retract of 700 samples, and no deflection that is a straight line there."""
    part = curve.record.channels["phase"] != RETRACT
    back = np.linspace(1e-7, 0.0, 700)
    added = {"z": back, "deflection_voltage": np.sin(back / 1e-8), "lateral_voltage": 0.0 * back}
    added["phase"] = np.full(700, float(RETRACT))
    channels = {name: np.concatenate([values[part], added[name]]) for name, values in curve.record.channels.items()}
    time = 2e-5 * np.arange(len(channels["z"]))
    record = type(curve.record)(time, channels, curve.record.units)
    return Curve(record, True, 0.0, 0.0, 2.5e-6, 7e-6, 1e-7, 0.2, trigger=0.4)


def test_retract_of_another_rate_has_the_values_at_the_z_of_the_approach(tmp_path, curve):
    _, columns = parsed(write_dat(tmp_path / "curve.dat", other_rate(curve)))
    np.testing.assert_allclose(columns["Z [bwd] (m)"], columns["Z (m)"], atol=1e-16)
    wanted = np.sin(-columns["Z (m)"] / 1e-8)
    # Linear between two samples: a step of 0.0143 of the period's radian makes 0.0143**2 / 8.
    np.testing.assert_allclose(columns["Vert. Deflection [bwd] (V)"], wanted, atol=1.1 * 0.01431**2 / 8.0)


def test_gwyddion_reads_the_curve_at_its_place(tmp_path, curve):
    read = gwyddion(write_dat(tmp_path / "curve.dat", curve), tmp_path)
    every = {each["title"]: each for key, each in read.items() if key.startswith("/sps/") and hasattr(each, "items")}
    assert {"Z", "Vert. Deflection", "Vert. Deflection [bwd]"} <= set(every)
    for title, wanted in (("Vert. Deflection", APPROACH), ("Vert. Deflection [bwd]", RETRACT)):
        assert every[title]["coords"] == pytest.approx([3e-9, -2e-9])
        (line,) = every[title]["data"]
        # Its axis goes upwards: from the sample away.
        assert (line["res"], line["off"], line["real"]) == (2001, pytest.approx(1e-7), pytest.approx(1e-7, rel=1e-3))
        values = curve.record.channels["deflection_voltage"][curve.record.channels["phase"] == wanted]
        away = values[::-1] if wanted == APPROACH else values
        np.testing.assert_allclose(line["data"], away, rtol=1e-8)


def test_curve_is_read_back_with_its_numbers_but_for_the_dwell(tmp_path, curve):
    read = read_curve(write_dat(tmp_path / "curve.dat", curve))
    kept = curve.record.channels["phase"] != DWELL
    for name, values in curve.record.channels.items():
        np.testing.assert_allclose(read.record.channels[name], values[kept], rtol=1e-8, atol=1e-16)
    np.testing.assert_allclose(np.diff(read.record.time)[:2000], 2e-5, rtol=1e-6)
    fields = ("x", "y", "triggered", "trigger", "approach_rate", "retract_rate", "spring_constant")
    for name in (*fields, "deflection_sensitivity"):
        assert getattr(read, name) == pytest.approx(getattr(curve, name)), name


def test_broken_off_curve_is_read_back_with_its_approach_alone(tmp_path, curve):
    cut = curve.record.channels["phase"] == APPROACH
    record = type(curve.record)(
        curve.record.time[cut], {name: each[cut] for name, each in curve.record.channels.items()}, curve.record.units
    )
    path = write_dat(tmp_path / "part.dat", Curve(record, False, 0.0, 0.0, 1e-6, 1e-6, 1e-7, 0.2))
    assert np.isnan(parsed(path)[1]["Vert. Deflection [bwd] (V)"]).all()
    read = read_curve(path)
    assert set(read.record.channels["phase"]) == {APPROACH} and len(read.record.time) == 2001


def test_curve_of_another_program_takes_the_numbers_that_are_given(tmp_path):
    """A mean of two sweeps, with ends of lines by LF, and less columns."""
    text = "Experiment\tZ spectroscopy\t\nX (m)\t1E-9\t\nZ (m)\tN/A\t\nIntegration time (s)\t1E-3\t\n\n[DATA]\n"
    text += "Z rel (m)\tVert. Deflection [AVG] (V)\tVert. Deflection [AVG] [bwd] (V)\n0\t0\t1\n-1E-9\t2\t3\n"
    (tmp_path / "other.dat").write_text(text)
    read = read_curve(tmp_path / "other.dat", deflection_sensitivity=1e-8, spring_constant=0.5)
    assert read.record.channels["z"].tolist() == [0.0, 1e-9, 1e-9, 0.0]
    assert read.record.channels["deflection_voltage"].tolist() == [0.0, 2.0, 3.0, 1.0]
    assert np.diff(read.record.time) == pytest.approx(1e-3)
    assert read.arrays().variables["force"].values.max() == pytest.approx(3.0 * 1e-8 * 0.5)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", r"it has no line \[DATA\]"),
        ("X (m)\t0\t\n\n[DATA]\nBias calc (V)\n0\n", r"it has no column Z rel \(m\), its columns are Bias calc \(V\)"),
        ("\n[DATA]\nZ rel (m)\tVert. Deflection (V)\n0\n", "rows of another number of values than its 2 columns"),
        ("\n[DATA]\nZ rel (m)\tVert. Deflection (V)\n0\tx\n", "could not convert"),
    ],
)
def test_file_that_is_no_curve_is_refused_in_a_sentence(tmp_path, text, why):
    (tmp_path / "other.dat").write_text(text)
    with pytest.raises(ResultFileError, match=rf"other\.dat cannot be read as a force curve: .*{why}"):
        read_curve(tmp_path / "other.dat")


def test_several_curves_and_none_are_refused(tmp_path, curve):
    for curves, count in (([curve, curve], 2), ([], 0)):
        with pytest.raises(ValueError, match=rf"a \.dat file holds one force curve, these are {count}"):
            write_dat(tmp_path / "many.dat", curves)
    assert not list(tmp_path.iterdir())
