"""Claims about docs/files.md: its examples run and its tables are those of the code."""

import re
from pathlib import Path

import gwyfile
import pytest
from printed.page_run import run_programs

from afm_model.files import layers
from afm_model.files.curve_files import UNITS
from afm_model.microscope import Microscope
from afm_model.microscope.arrays import to_xarray

from .test_labelled import results

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "files.md").read_text()


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Names that the examples have made, and what each has printed."""
    done = run_programs("docs/files.md", tmp_path_factory.mktemp("docs"))
    return done.folder, done.scope, done.printed


def test_examples_of_the_page_run_and_print_what_they_measure(ran):
    folder, _, printed = ran
    assert list(printed) == ["scan", "write", "long", "curves", "afmformats", "labelled", "level"]
    assert printed["long"] == "4 True\n"
    setpoint, speed, most = (float(word) for word in printed["afmformats"].split())
    assert (setpoint, most) == (pytest.approx(20e-9, rel=0.1), pytest.approx(setpoint, rel=0.1))
    assert speed == 4e-6
    ratio, unit = printed["labelled"].split()
    # Half the friction, less what the edges of the stripes add.
    assert 0.3 < float(ratio) < 0.52 and unit == "N"
    assert float(printed["level"]) < 0.2e-9
    names = {"scan.gwy", "friction.gsf", "height.png", "scan.png", "scan.csv", "scan.h5", "curves.h5", "curve.tab"}
    names |= {"scan.sxm", "curve.dat"}
    assert names <= {each.name for each in folder.iterdir()}
    again, first = (gwyfile.load(str(folder / name)) for name in ("again.gwy", "scan.gwy"))
    assert (again["/6/data"].data == first["/6/data"].data).all()


def test_table_of_layers_has_the_names_titles_and_units_of_the_code(ran):
    _, scope, _ = ran
    table = PAGE.partition("### Layers")[2].partition("###")[0]
    for each in layers(scope["image"]):
        (row,) = [line for line in table.splitlines() if f"`{each.name}`" in line]
        _, _, titles, unit, *_ = (cell.strip() for cell in row.split("|"))
        assert each.title in titles.split(", ")
        assert each.unit == unit


def test_table_of_labelled_arrays_has_the_dimensions_and_variables_of_the_results(ran):
    _, scope, _ = ran
    assert scope["curves"].sizes["curve"] == 2
    loop, path = (to_xarray(results()[kind]) for kind in ("loop", "path"))
    one = scope["curves"].isel(curve=[0])
    found = {"scan": scope["image"], "force_curve": one, "friction_loop": loop, "scan_path": path}
    with Microscope("tapping", plant={"kind": "averaged", "lever": "ppp_fmr", "gap": 60e-9, "dt": 2e-6}) as microscope:
        found["amplitude_curve"] = microscope.amplitude_curve(begin=20e-9, ramp=10e-9, rate=1e-5, settle=1e-3, points=4)
    table = PAGE.partition("| result of |")[2].partition("\n\n")[0]
    rows = [[cell.strip() for cell in line.split("|")[1:4]] for line in table.splitlines()[2:]]
    named = {name: row for row in rows for name in re.findall(r"`(\w+)`", row[0])}
    assert set(found) <= set(named)
    for verb, made in found.items():
        _, dims, variables = named[verb]
        longest = max((each.dims for each in made.data_vars.values()), key=len)
        assert dims.split(", ") == list(longest), verb
        listed = set(re.findall(r"`(\w+)`", variables)) - {"curve"}
        assert listed <= set(made.variables), verb
        if verb != "scan":
            assert set(made.data_vars) <= listed, verb
        assert made.attrs["verb"] == "".join(part.capitalize() for part in verb.split("_"))


def test_table_of_columns_is_that_of_the_force_curves():
    for name, unit in UNITS.items():
        assert re.search(rf"^\| `{re.escape(name)}` \| {unit} ?\|", PAGE, re.MULTILINE), name
