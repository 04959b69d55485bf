"""Claims about the files of a scan and of force curves that a microscope has made."""

import afmformats
import gwyfile
import numpy as np
import pytest

from afm_model.files import ScanFile, layers, level_plane, read_scan, write_curves, write_gwy
from afm_model.microscope import Microscope
from afm_model.microscope.verbs import Scan

from . import scans
from .readers import field, gwyddion

STEP, SIZE, PIXELS = 5e-9, 320e-9, 32
SCAN = {"size_x": SIZE, "pixels": PIXELS, "lines": PIXELS, "line_rate": 20.0, "overscan": 0.2}


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """Folder, an image of an L, 5 nm high and of half the friction, and two force curves."""
    folder = tmp_path_factory.mktemp("real")
    shape = scans.shape(PIXELS, PIXELS)
    np.save(folder / "height.npy", STEP * shape)
    np.save(folder / "strength.npy", 1.0 - 0.5 * shape)
    sample = {"kind": "map", "file": str(folder / "height.npy"), "strength_file": str(folder / "strength.npy")}
    with Microscope("two_materials", sample=sample | {"width": SIZE}) as microscope:
        microscope.approach(rate=20e-6)
        with ScanFile(folder / "scan.h5", Scan(**SCAN)) as file:
            microscope.on_line = file.put
            image = microscope.scan(**SCAN)
        curves = microscope.force_curve(trigger_force=20e-9, count=2, approach_rate=4e-6, retract_rate=4e-6)
    return folder, image, curves


def test_every_layer_of_a_real_scan_comes_out_of_gwyddion_as_it_was_measured(measured):
    folder, image, _ = measured
    path = write_gwy(folder / "scan.gwy", image)
    for read in (gwyfile.load(str(path)), gwyddion(path, folder)):
        for layer in layers(image):
            values, told = field(read, layer.title)
            np.testing.assert_array_equal(values[::-1], layer.values)
            assert (told["xreal"], told["si_unit_z"]) == (SIZE, layer.unit)
        notes = read["/0/meta"]
        assert notes["Setpoint"] == "10 nN"
        assert notes["Cantilever"].startswith("ppp_lfmr, k = 0.2 N/m")


def test_l_of_the_sample_lies_in_the_file_as_on_the_sample_and_in_no_other_of_the_eight_ways(measured):
    folder, image, _ = measured
    read = gwyfile.load(str(write_gwy(folder / "scan.gwy", image)))
    height, friction = (field(read, title)[0][::-1] for title in ("Height", "Friction"))
    shape = scans.shape(PIXELS, PIXELS)
    ways = [np.rot90(each, turn) for each in (shape, shape.T) for turn in range(4)]
    for seen in (level_plane(height, shape > 0.5), -friction):
        alike = [np.corrcoef(seen.ravel(), way.ravel())[0, 1] for way in ways]
        # The edges are blurred by the lag of z, and much of the L lies on its own image in a mirror.
        assert alike[0] > max(alike[1:]) + 0.1


def test_lines_written_as_they_came_are_the_image(measured):
    folder, image, _ = measured
    read = read_scan(folder / "scan.h5")
    assert read.complete
    for name in read.units:
        for way in ("trace", "retrace"):
            np.testing.assert_array_equal(read.data[name, way], image[name].sel(direction=way))


def test_real_force_curves_are_read_by_afmformats(measured):
    folder, _, curves = measured
    read = afmformats.load_data(write_curves(folder / "curves.h5", curves))
    assert len(read) == 2
    for each in read:
        meta = each.metadata
        assert meta["setpoint"] == pytest.approx(20e-9, rel=0.1)  # tilted: the vertical force is not that across
        force = each.appr["force"]
        assert np.ptp(force) == pytest.approx(meta["setpoint"], rel=0.15)
        assert each.retr["force"].min() < -2e-9  # it sticks
        assert (meta["speed approach"], meta["rate approach"]) == (4e-6, 5e4)
