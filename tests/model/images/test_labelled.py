"""Claims about labelled arrays."""

import numpy as np
import pytest
import xarray

from afm_model.analysis import Estimate
from afm_model.microscope.labelled import curves, labelled
from afm_model.microscope.results import Calibration, Loop, PathRecord, Record
from afm_model.microscope.verbs import FrictionLoop, ScanPath

from . import scans


def results() -> dict[str, object]:
    """A result of every kind."""
    time = np.linspace(0.0, 1.0, 5)
    loop = Loop(FrictionLoop(), 1e-9 * time, 2e-9 * time, 3e-9 * time, time)
    names = {"x": "m", "y": "m", "height": "m", "error": "V", "lateral": "N"}
    path = Record(time, {name: number * time for number, name in enumerate(names)}, names)
    return {
        "image": scans.scanned(20, angle=0.5, direction="down"),
        "curve": scans.curve(),
        "curves": [scans.curve(), scans.curve(1e-9, dwell=7)],
        "loop": loop,
        "path": PathRecord(ScanPath(x=(0.0, 1e-7), y=(0.0, 2e-7)), path),
        "calibration": Calibration(Estimate(1e-7, 1e-9), "m/V", {"curves": 3.0}),
        "line": scans.line(scans.scanned(0).scan, 3, "retrace"),
    }


@pytest.mark.parametrize("kind", list(results()))
def test_every_result_has_a_labelled_form_that_netcdf_keeps(tmp_path, kind):
    made = labelled(results()[kind])
    made.to_netcdf(tmp_path / "result.nc")
    opener = xarray.open_dataarray if kind == "calibration" else xarray.open_dataset
    with opener(tmp_path / "result.nc") as read:
        xarray.testing.assert_equal(read.load(), made)
        for name, value in made.attrs.items():
            np.testing.assert_array_equal(read.attrs[name], value, err_msg=name)


@pytest.mark.parametrize("kind", ["image", "curve", "curves", "loop", "path"])
def test_every_variable_has_a_unit_and_a_long_name(kind):
    made = labelled(results()[kind])
    for variable in made.data_vars.values():
        assert {"units", "long_name"} <= set(variable.attrs), variable.name


def test_places_on_the_sample_are_those_of_a_frame_that_is_turned_about_its_centre():
    made = labelled(scans.scanned(angle=np.pi / 2))
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
    made = labelled(scans.curve())
    np.testing.assert_allclose(made.force, 0.2 * 1e-7 * made.deflection, rtol=1e-12)
    assert made.time.attrs["units"] == "s" and float(made.time[0]) == 12.5
    assert dict(zip(made.phase.flag_meanings.split(), made.phase.flag_values, strict=True))["retract"] == 4
    assert made.attrs["spring_constant"] == 0.2


def test_curves_of_different_lengths_are_one_array_that_ends_with_nan():
    made = curves([scans.curve(), scans.curve(1e-9, dwell=7)])
    assert made.z.shape == (2, 4102)
    assert np.isfinite(made.z[0]).all() and np.isnan(made.z[1, 4009:]).all()
    np.testing.assert_allclose(made.x, [0.0, 1e-9])


def test_what_has_no_labelled_form_is_returned_as_it_is():
    assert labelled(None) is None
    assert labelled([]) == []
