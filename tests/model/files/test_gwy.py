"""Claims about scans as .gwy: what gwyfile, Gwyddion and the height maps of this package read from them."""

import warnings
from typing import Any

import gwyfile
import numpy as np
import pytest

from afm_model.files import FrameWarning, layers, write_gsf, write_gwy
from afm_model.sample.map_files import read_field

from . import scans
from .readers import field, gwyddion, titles

EVERY = {
    **{"Height": "m", "Height Retrace": "m", "Deflection Error": "V", "Deflection Error Retrace": "V"},
    **{"Lateral Force": "N", "Lateral Force Retrace": "N", "Friction": "N", "Crosstalk": "N"},
}


@pytest.fixture(scope="module")
def image():
    return scans.scanned(angle=0.5)


@pytest.fixture(scope="module")
def path(image, tmp_path_factory):
    return write_gwy(tmp_path_factory.mktemp("gwy") / "scan.gwy", image)


@pytest.fixture(scope="module", params=["gwyfile", "gwyddion"])
def read(request, path) -> Any:
    return gwyfile.load(str(path)) if request.param == "gwyfile" else gwyddion(path, path.parent)


def test_every_layer_is_read_with_its_values_to_the_last_bit_its_size_place_and_units(read, image):
    assert list(titles(read)) == list(EVERY)
    for layer in layers(image):
        values, told = field(read, layer.title)
        np.testing.assert_array_equal(values[::-1], layer.values)
        assert told["si_unit_z"] == EVERY[layer.title]
        assert told["si_unit_xy"] == "m"
        assert (told["xreal"], told["yreal"]) == (200e-9, 200e-9)
        assert (told["xoff"], told["yoff"]) == pytest.approx((0.0, 200e-9), abs=1e-20)


def test_l_low_on_the_left_is_low_on_the_left_where_row_0_is_the_top(read):
    values, _ = field(read, "Friction")
    on = values > 3e-9
    rows, columns = np.nonzero(on)
    # Top of the long bar, and the short one at its lower end, to the right.
    assert (rows.min(), rows.max()) == (8, 55)
    assert (columns.min(), columns.max()) == (8, 39)
    assert on[8, 8] and on[55, 39] and not on[8, 39] and not on[30, 30]


def test_notes_are_texts_that_say_angle_rate_and_what_the_microscope_says(read):
    notes = read["/0/meta"]
    assert notes["Scan angle"].startswith("28.6479 deg")
    assert notes["Line rate"].startswith("0.998 Hz")
    assert notes["Scan centre"] == "x = 100 nm, y = -300 nm"
    assert notes["Lines measured"] == "64 of 64"
    # One letter stays a text.
    assert {name: notes[name] for name in scans.METADATA} == scans.METADATA
    assert read[f"/{titles(read)['Friction']}/meta"]["Channel"] == "friction"


def components(found: Any) -> list[tuple[str, str, Any]]:
    """Name, type and value of every component of an object and of those in it."""
    every = []
    for name, value in found.items():
        every.append((name, found.typecodes[name], value))
        every += components(value) if found.typecodes[name] == "o" else []
    return every


@pytest.mark.parametrize("lines_done", [64, 20, 0])
def test_no_value_is_nan_no_component_is_boolean_and_the_size_comes_before_the_values(tmp_path, lines_done):
    """AFMReader 0.0.7 never ends at a boolean component, and shapes the values by a size that it has read before."""
    found = gwyfile.load(str(write_gwy(tmp_path / "scan.gwy", scans.scanned(lines_done))))
    kinds = {kind for _, kind, _ in components(found)}
    assert kinds <= {"o", "s", "d", "i", "D"}
    fields = [value for _, kind, value in components(found) if kind == "o" and value.name == "GwyDataField"]
    assert len(fields) == len(EVERY) * (1 if lines_done == 64 else 2)
    for each in fields:
        assert np.isfinite(each.data).all()
        names = list(each)
        assert max(names.index("xres"), names.index("yres")) < names.index("data")


@pytest.mark.parametrize("direction", ["up", "down"])
def test_what_is_not_measured_is_masked_and_the_rest_has_its_place(tmp_path, direction):
    image = scans.scanned(20, direction=direction)
    path = write_gwy(tmp_path / "part.gwy", image)
    for read in (gwyfile.load(str(path)), gwyddion(path, tmp_path)):
        values, _ = field(read, "Height")
        number = titles(read)["Height"]
        masked = read[f"/{number}/mask"].data > 0.5
        assert masked.sum() == 44 * 64
        # A scan upwards begins at the bottom.
        assert not masked[-20:].any() if direction == "up" else not masked[:20].any()
        height = image.data["height", "trace"][::-1]
        np.testing.assert_array_equal(values[~masked], height[~masked])
        assert np.unique(values[masked]) == pytest.approx(np.nanmean(height))


def test_a_line_with_trace_and_no_retrace_is_masked_in_the_layers_that_need_both(tmp_path):
    image = scans.scanned(20)
    image.put(scans.line(image.scan, 20, "trace"))
    read = gwyfile.load(str(write_gwy(tmp_path / "part.gwy", image)))
    missing = {title: int(read[f"/{number}/mask"].data.sum()) // 64 for title, number in titles(read).items()}
    assert missing == {title: 43 if title in ("Height", "Deflection Error", "Lateral Force") else 44 for title in EVERY}


@pytest.mark.parametrize("write", [write_gwy, write_gsf])
def test_one_place_of_the_sample_in_two_frames_is_at_one_place_in_gwyddion(tmp_path, write):
    """Gwyddion counts y downwards from the top: a dimple at (x, y) of the sample stands at (x, -y)."""
    dimple = np.array([0.13e-6, -0.31e-6])
    for number, (centre, size) in enumerate([((0.1e-6, -0.3e-6), 200e-9), ((0.15e-6, -0.2e-6), 400e-9)]):
        image = scans.scanned(centre_x=centre[0], centre_y=centre[1], size_x=size)
        way = np.hypot(image.x[None, :] + centre[0] - dimple[0], image.y[:, None] + centre[1] - dimple[1])
        image.data["height", "trace"][:] = -np.exp(-0.5 * (way / 10e-9) ** 2)
        path = write(tmp_path / f"{number}.{write.__name__[-3:]}", image)
        values, told = field(gwyddion(path, tmp_path), "Height")
        row, column = np.unravel_index(np.argmin(values), values.shape)
        place = told["xoff"] + (column + 0.5) * told["xreal"] / 64, told["yoff"] + (row + 0.5) * told["yreal"] / 64
        assert place == pytest.approx((dimple[0], -dimple[1]), abs=0.51 * size / 64)


def test_picture_that_is_not_square_keeps_its_sides(tmp_path):
    image = scans.scanned(pixels=48, lines=16, size_y=50e-9)
    path = write_gwy(tmp_path / "wide.gwy", image)
    for read in (gwyfile.load(str(path)), gwyddion(path, tmp_path)):
        values, told = field(read, "Height")
        np.testing.assert_array_equal(values[::-1], image.data["height", "trace"])
        assert (told["xreal"], told["yreal"]) == (200e-9, 50e-9)


def test_scan_can_be_the_height_map_of_a_sample(path, image):
    found = read_field(str(path))
    np.testing.assert_array_equal(found.values, image.data["height", "trace"])
    assert (found.width, found.height) == (200e-9, 200e-9)


def by_afmreader(path, title: str) -> tuple[np.ndarray, tuple[float, float]]:
    """Values and size of a pixel along x and y [m] as AFMReader 0.0.7 and TopoStats 2.4.2 take them from a .gwy file.

    They shape the numbers as (xres, yres), and take xreal over the columns of that for the size of a pixel.
    """
    read = gwyfile.load(str(path))
    found = read[f"/{titles(read)[title]}/data"]
    values = found.data.ravel().reshape(found["xres"], found["yres"])
    side = found["xreal"] / values.shape[1]
    return values, (side, side)


@pytest.mark.parametrize(
    ("frame", "told"),
    [
        ({"pixels": 16, "lines": 16}, None),
        ({"pixels": 16, "lines": 16, "size_y": 200e-9}, None),
        ({"pixels": 16, "lines": 8}, "scramble an image of 16 pixels in 8 lines"),
        ({"pixels": 8, "lines": 16, "size_y": 200e-9}, "scramble an image of 8 pixels in 16 lines"),
        ({"pixels": 16, "lines": 16, "size_y": 400e-9}, "take a frame of 200 nm x 400 nm for a square one"),
    ],
)
def test_frame_that_afmreader_and_topostats_read_wrongly_is_warned_of_and_no_other(frame, told, tmp_path):
    image = scans.scanned(**frame)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        path = write_gwy(tmp_path / "scan.gwy", image)
    scan, (height, *_) = image.scan, layers(image)
    values, pixel = by_afmreader(path, "Height")
    right = np.array_equal(values, height.values[::-1]) and pixel == pytest.approx(
        (scan.size_x / scan.pixels, scan.height / scan.lines)
    )
    assert right == (told is None)
    assert [each.category for each in caught] == ([] if told is None else [FrameWarning])
    for each in caught:
        assert told in str(each.message) and "scan.gwy" in str(each.message)
        # It points to the line that wrote the file.
        assert each.filename == __file__
