"""Claims about layers as .gsf: what gsffile, Gwyddion and the height maps of this package read from them."""

import gsffile
import numpy as np
import pytest

from afm_model.files import layer, layers, write_gsf
from afm_model.sample.map_files import read_field

from . import scans
from .readers import field, gwyddion


@pytest.mark.parametrize("name", ["height_trace", "lateral_retrace", "friction"])
def test_layer_is_read_with_its_values_in_single_precision_its_size_place_units_and_notes(tmp_path, name):
    image = scans.scanned(angle=0.5, pixels=48, lines=16, size_y=50e-9)
    wanted = layer(image, name)
    path = write_gsf(tmp_path / "scan.gsf", image, name)
    values, told = gsffile.read_gsf(path)
    np.testing.assert_array_equal(values[::-1], wanted.values.astype(np.float32))
    assert (told["XReal"], told["YReal"]) == (200e-9, 50e-9)
    assert (told["XOffset"], told["YOffset"]) == pytest.approx((0.0, 275e-9), abs=1e-20)
    assert (told["Title"], told["XYUnits"], told["ZUnits"]) == (wanted.title, "m", wanted.unit)
    assert told["Scan angle"].startswith("28.6479 deg")
    assert told["Law"] == "pid"
    seen, numbers = field(gwyddion(path, tmp_path), wanted.title)
    np.testing.assert_array_equal(seen, values)
    assert (numbers["xreal"], numbers["yreal"]) == (200e-9, 50e-9)
    assert (numbers["xoff"], numbers["yoff"]) == pytest.approx((0.0, 275e-9), abs=1e-20)
    assert (numbers["si_unit_xy"], numbers["si_unit_z"]) == ("m", wanted.unit)


def test_l_low_on_the_left_is_low_on_the_left_where_row_0_is_the_top(tmp_path):
    values, _ = gsffile.read_gsf(write_gsf(tmp_path / "scan.gsf", scans.scanned(), "friction"))
    on = values > 3e-9
    assert on[8, 8] and on[55, 39] and not on[8, 39] and not on[55, 50]


def test_what_is_not_measured_is_nan_which_gwyddion_masks(tmp_path):
    path = write_gsf(tmp_path / "part.gsf", scans.scanned(20))
    values, _ = gsffile.read_gsf(path)
    assert np.isnan(values[:44]).all() and np.isfinite(values[44:]).all()
    masked = gwyddion(path, tmp_path)["/0/mask"].data > 0.5
    np.testing.assert_array_equal(masked, np.isnan(values))


@pytest.mark.parametrize("more", range(4))
def test_values_begin_at_a_whole_word_whatever_the_length_of_the_notes(tmp_path, more):
    image = scans.scanned()
    image.metadata["Note"] = "a = b" + "x" * more
    path = write_gsf(tmp_path / "scan.gsf", image)
    values, told = gsffile.read_gsf(path)
    np.testing.assert_array_equal(values[::-1], image.data["height", "trace"].astype(np.float32))
    assert told["Note"] == "a b" + "x" * more
    np.testing.assert_array_equal(read_field(str(path)).values, values[::-1])


def test_layer_that_the_scan_does_not_have_is_refused_with_those_that_it_has(tmp_path):
    image = scans.scanned()
    with pytest.raises(
        ValueError, match="no layer 'heigth': it must be one of height_trace, height_retrace, error_trac"
    ):
        write_gsf(tmp_path / "scan.gsf", image, "heigth")
    assert not list(tmp_path.iterdir())
    assert [each.name for each in layers(image)][-2:] == ["friction", "crosstalk"]
