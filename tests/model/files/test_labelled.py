"""Claims about labelled arrays."""

import numpy as np
import pytest
import xarray

from afm_model.files import text_table, write_curve_tab, write_curves, write_gwy
from afm_model.microscope.arrays import to_xarray
from afm_model.microscope.image import as_image
from afm_model.microscope.results import Calibration, TimeSeries
from afm_model.microscope.verbs import FrictionLoop, ScanPath
from afm_model.microscope.verbs.force_curve import as_curves
from afm_model.microscope.verbs.friction_loop import Loop
from afm_model.microscope.verbs.scan_path import PathRecord

from . import scans


def results() -> dict[str, object]:
    """A result of every kind."""
    time = np.linspace(0.0, 1.0, 5)
    loop = Loop(FrictionLoop(), 1e-9 * time, 2e-9 * time, 3e-9 * time, time, 1e-8, 5e-8)
    names = {"x": "m", "y": "m", "height": "m", "error": "V", "lateral": "N"}
    path = TimeSeries(time, {name: number * time for number, name in enumerate(names)}, names)
    return {
        "image": scans.scanned(20, angle=0.5, direction="down"),
        "curve": scans.curve(),
        "curves": [scans.curve(), scans.curve(1e-9, dwell=7)],
        "loop": loop,
        "path": PathRecord(ScanPath(x=(0.0, 1e-7), y=(0.0, 2e-7)), path, 5e-8),
        "calibration": Calibration(1e-7, 1e-9, "m/V", {"curves": 3.0}),
        "line": scans.line(scans.scanned(0).scan, 3, "retrace"),
    }


@pytest.mark.parametrize("kind", list(results()))
def test_every_result_has_a_labelled_form_that_netcdf_keeps(tmp_path, kind):
    made = to_xarray(results()[kind])
    made.to_netcdf(tmp_path / "result.nc")
    opener = xarray.open_dataarray if kind == "calibration" else xarray.open_dataset
    with opener(tmp_path / "result.nc") as read:
        xarray.testing.assert_equal(read.load(), made)
        for name, value in made.attrs.items():
            np.testing.assert_array_equal(read.attrs[name], value, err_msg=name)


@pytest.mark.parametrize("kind", ["image", "curve", "curves", "loop", "path"])
def test_every_variable_has_a_unit_and_a_long_name(kind):
    made = to_xarray(results()[kind])
    for variable in made.data_vars.values():
        assert {"units", "long_name"} <= set(variable.attrs), variable.name


def test_places_on_the_sample_are_those_of_a_frame_that_is_turned_about_its_centre():
    made = to_xarray(scans.scanned(angle=np.pi / 2))
    corner = made.isel(x=-1, y=0)  # lower right of the frame
    half = 0.5 * 200e-9 * 63 / 64
    # A quarter turn counterclockwise takes it to the upper right.
    assert float(corner.place_x) == pytest.approx(1e-7 + half)
    assert float(corner.place_y) == pytest.approx(-3e-7 + half)
    assert made.height.dims == ("direction", "y", "x")
    assert float(made.height.sel(direction="retrace").isel(x=3, y=5)) == pytest.approx(
        scans.scanned().data["height", "retrace"][5, 3]
    )
    assert made.friction.attrs["units"] == "N"
    assert made.attrs["angle"] == np.pi / 2 and made.attrs["Law"] == "pid" and made.attrs["complete"] == 1


def test_curve_has_its_force_and_the_names_of_its_phases():
    made = to_xarray(scans.curve())
    np.testing.assert_allclose(made.force, 0.2 * 1e-7 * made.deflection_voltage, rtol=1e-12)
    assert made.time.attrs["units"] == "s" and float(made.time[0]) == 12.5
    assert dict(zip(made.phase.flag_meanings.split(), made.phase.flag_values, strict=True))["retract"] == 4
    assert made.attrs["spring_constant"] == 0.2


def test_curves_of_different_lengths_are_one_array_that_ends_with_nan():
    made = to_xarray([scans.curve(), scans.curve(1e-9, dwell=7)])
    assert made.z.shape == (2, 4102)
    assert np.isfinite(made.z[0]).all() and np.isnan(made.z[1, 4009:]).all()
    np.testing.assert_allclose(made.x, [0.0, 1e-9])


@pytest.mark.parametrize("kind", ["image", "curve", "curves", "loop"])
def test_every_field_of_the_verb_is_an_attribute_of_what_it_measured(kind):
    result = results()[kind]
    first = result[0] if isinstance(result, list) else result
    verb, made = first.scan if kind == "image" else first.verb, to_xarray(result)
    assert made.attrs["verb"] == type(verb).__name__
    for name, value in verb.model_dump().items():
        assert made.attrs[name] == value, name


def test_labelled_curves_give_back_the_verb_that_measured_them(tmp_path):
    for result in (scans.curve(), [scans.curve(), scans.curve(1e-9, dwell=7)]):
        made = to_xarray(result)
        made.to_netcdf(tmp_path / "curves.nc")
        with xarray.open_dataset(tmp_path / "curves.nc") as read:
            assert [each.verb for each in as_curves(read)] == [scans.curve().verb] * len(as_curves(result))
        # Arrays of versions before had no fields of the verb.
        bare = made.copy()
        del bare.attrs["verb"]
        assert {each.verb for each in as_curves(bare)} == {None}


def test_what_has_no_labelled_form_is_returned_as_it_is():
    assert to_xarray(None) is None
    assert to_xarray([]) == []


def test_labelled_scan_is_written_as_the_scan_itself(tmp_path):
    image = scans.scanned(20, angle=0.5, direction="down", channels="height, lateral, x", slow_axis=False)
    image.units["x"] = image.units.pop("error")
    for way in ("trace", "retrace"):
        image.data["x", way] = image.data.pop(("error", way))
    made = to_xarray(image)
    made.to_netcdf(tmp_path / "scan.nc")
    with xarray.open_dataset(tmp_path / "scan.nc") as read:
        for dataset in (made, read):
            again = as_image(dataset)
            assert (again.scan, again.units, again.metadata) == (image.scan, image.units, image.metadata)
            assert (again.start, again.line_rate, again.lines_done) == (0.5, 0.998, 20)
            assert again.complete is False
            assert (
                write_gwy(tmp_path / "a.gwy", dataset).read_bytes() == write_gwy(tmp_path / "b.gwy", image).read_bytes()
            )
            assert text_table(dataset) == text_table(image)


def test_labelled_curves_are_written_as_the_curves_themselves(tmp_path):
    several = [scans.curve(), scans.curve(1e-9, dwell=7)]
    for result in (several[0], several):
        made = to_xarray(result)
        made.to_netcdf(tmp_path / "curves.nc")
        with xarray.open_dataset(tmp_path / "curves.nc") as read:
            for dataset in (made, read):
                one, other = write_curves(tmp_path / "curves.h5", dataset), tmp_path / "again" / "curves.h5"
                other.parent.mkdir(exist_ok=True)
                assert one.read_bytes() == write_curves(other, result).read_bytes()
    with pytest.raises(ValueError, match=r"a \.tab file holds one force curve, these are 2"):
        write_curve_tab(tmp_path / "curves.tab", several)


def test_something_else_is_refused_in_a_sentence(tmp_path):
    loop = to_xarray(results()["loop"])
    with pytest.raises(ValueError, match="Dataset is not a scan: it must be an Image or the labelled arrays of one"):
        write_gwy(tmp_path / "loop.gwy", loop)
    with pytest.raises(ValueError, match="list has no force curves: it must be a list of Curve or labelled arrays"):
        write_curves(tmp_path / "curves.h5", [scans.curve(), 1.0])
    with pytest.raises(ValueError, match="Dataset has no force curves: it must be a list of Curve or labelled arrays"):
        write_curves(tmp_path / "loop.h5", loop)
    assert not list(tmp_path.iterdir())
