"""Claims about the table of a scan's figures."""

import csv

import numpy as np
import pytest

from afm_model.files import figures, text_table, write_table

from . import scans


def test_figures_are_those_of_the_layers(tmp_path):
    image = scans.scanned()
    path = write_table(tmp_path / "scan.csv", image)
    with path.open(newline="") as file:
        rows = {row["layer"]: row for row in csv.DictReader(file)}
    assert list(rows) == [each.layer for each in figures(image)]
    friction = image.friction()
    assert rows["friction"]["unit"] == "N"
    for name, wanted in (
        ("mean", friction.mean()),
        ("median", np.median(friction)),
        ("least", friction.min()),
        ("largest", friction.max()),
        ("rms", friction.std()),
    ):
        assert float(rows["friction"][name]) == pytest.approx(wanted, rel=1e-14), name
    # The plane of 8 nm is in the one and not in the other.
    height = rows["height_trace"]
    assert float(height["rms_levelled"]) < 2e-9 < float(height["rms"])


def test_what_is_not_measured_counts_for_nothing():
    part, whole = figures(scans.scanned(32)), figures(scans.scanned())
    assert (part[0].measured, whole[0].measured) == (0.5, 1.0)
    assert part[0].mean == pytest.approx(np.nanmean(scans.scanned(32).data["height", "trace"]))
    (nothing, *_) = figures(scans.scanned(0))
    assert nothing.measured == 0.0 and np.isnan(nothing.mean)


@pytest.mark.parametrize("lines_done", [64, 0])
def test_text_is_in_columns_with_prefixes(tmp_path, lines_done):
    image = scans.scanned(lines_done)
    read = write_table(tmp_path / "scan.txt", image).read_text()
    assert read == text_table(image)
    notes, table = read.split("\n\n")
    assert f"Lines measured  {lines_done} of 64\n" in notes
    header, *rows = table.splitlines()
    assert [row[: header.index("unit")].strip() for row in rows][-2:] == ["Friction", "Crosstalk"]
    assert rows[-2].split()[1] == ("nN" if lines_done else "N")
    assert max(map(len, read.splitlines())) <= 120
