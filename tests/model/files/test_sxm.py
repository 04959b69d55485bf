"""Claims about scans as .sxm: what a parser of the layout, Gwyddion and this package read from them."""

import math
import re
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from afm_model.core.errors import ResultFileError
from afm_model.files import read_scan, read_sxm, write_sxm
from afm_model.microscope import Lift, Microscope
from afm_model.microscope.image import Image
from afm_model.sample.map_files import read_field

from . import scans
from .readers import field, gwyddion

FRAMES = [
    pytest.param({"pixels": 64, "lines": 64}, id="square"),
    pytest.param({"pixels": 128, "lines": 32, "size_y": 60e-9}, id="wide"),
    pytest.param({"pixels": 16, "lines": 48, "size_y": 500e-9}, id="high"),
]
ways = pytest.mark.parametrize("direction", ["up", "down"])
frames = pytest.mark.parametrize("frame", FRAMES)


def parsed(path: Path) -> tuple[dict[str, str], list[list[str]], np.ndarray]:
    """Header, table of channels and numbers (channel, way, row, column) as stored, by the layout alone."""
    content = path.read_bytes()
    head, mark, data = content.partition(b"\n\n:SCANIT_END:\n\n\n\x1a\x04")
    assert mark
    words = re.split(r"^:(.+):$\n", head.decode("ascii"), flags=re.MULTILINE)
    assert words[0] == ""
    header = {key: value.removesuffix("\n") for key, value in zip(words[1::2], words[2::2], strict=True)}
    titles, *table = [line.removeprefix("\t").split("\t") for line in header["DATA_INFO"].split("\n")]
    assert titles == ["Channel", "Name", "Unit", "Direction", "Calibration", "Offset"]
    columns, rows = map(int, header["SCAN_PIXELS"].split())
    assert len(data) == 4 * len(table) * 2 * rows * columns
    return header, table, np.frombuffer(data, ">f4").reshape(len(table), 2, rows, columns)


@ways
@frames
def test_every_pixel_stands_where_the_layout_has_it(tmp_path, frame, direction):
    image = scans.scanned(direction=direction, **frame)
    _, table, stored = parsed(write_sxm(tmp_path / "scan.sxm", image))
    assert [row[1:4] for row in table] == [
        ["Z", "m", "both"],
        ["Deflection_Error", "V", "both"],
        ["Lateral_Force", "N", "both"],
    ]
    for number, channel in enumerate(image.units):
        for way, name in enumerate(("trace", "retrace")):
            values = image.data[channel, name].astype(np.float32)
            # In the order of the scan: upwards the bottom row is the first; the way back begins on the right.
            values = values if direction == "up" else values[::-1]
            np.testing.assert_array_equal(stored[number, way], values if way == 0 else values[:, ::-1])


def test_header_has_size_centre_and_the_angle_clockwise(tmp_path):
    image = scans.scanned(angle=math.radians(30.0), pixels=64, lines=16, size_y=50e-9)
    image.metadata |= {"Setpoint": "12.5 nN", "Gains": "P = 2e-09 m/V, I = 8e-06 m/(V s)", "Law": "Geschwindigkeit µ"}
    path = write_sxm(tmp_path / "scan.sxm", image, date=datetime(2026, 11, 28, 7, 5, 9))
    header, *_ = parsed(path)
    keys = ("SCAN_PIXELS", "SCAN_RANGE", "SCAN_OFFSET", "SCAN_ANGLE", "SCAN_TIME")
    numbers = {key: [float(word) for word in header[key].split()] for key in keys}
    assert numbers["SCAN_PIXELS"] == [64, 16]
    assert numbers["SCAN_RANGE"] == [200e-9, 50e-9]
    assert numbers["SCAN_OFFSET"] == [1e-7, -3e-7]
    assert numbers["SCAN_ANGLE"] == pytest.approx([-30.0])
    assert sum(numbers["SCAN_TIME"]) == pytest.approx(1.0 / 0.998)
    assert (header["REC_DATE"], header["REC_TIME"], header["SCAN_DIR"]) == ("28.11.2026", "07:05:09", "up")
    _, loop = (line.split("\t") for line in header["Z-CONTROLLER"].removeprefix("\t").split("\n\t"))
    assert [float(word.split()[0]) for word in loop[2:]] == pytest.approx([12.5e-9, 2e-9, 8e-6, 2.5e-4])
    assert [word.split()[1] for word in loop[2:]] == ["N", "m/V", "m/V/s", "s"]
    assert header["NANONIS_VERSION"] == "2" and header["COMMENT"].strip()


@ways
@frames
def test_gwyddion_shows_the_same_picture_with_its_units_and_size(tmp_path, frame, direction):
    image = scans.scanned(direction=direction, **frame)
    read = gwyddion(write_sxm(tmp_path / "scan.sxm", image), tmp_path)
    for title, key in {"Z (Forward)": ("height", "trace"), "Lateral_Force (Backward)": ("lateral", "retrace")}.items():
        values, told = field(read, title)
        np.testing.assert_array_equal(values[::-1], image.data[key].astype(np.float32))
        assert (told["xreal"], told["yreal"]) == pytest.approx((200e-9, image.scan.height))
        # Gwyddion takes the frame's corner with the least y.
        assert (told["xoff"], told["yoff"]) == pytest.approx((0.0, -300e-9 - 0.5 * image.scan.height), abs=1e-20)
        assert (told["si_unit_xy"], told["si_unit_z"]) == ("m", image.units[key[0]])


def same(read: Image, image: Image) -> None:
    assert list(read.data) == list(image.data)
    for key, values in image.data.items():
        np.testing.assert_array_equal(read.data[key], values.astype(np.float32))


@ways
@pytest.mark.parametrize("lines_done", [64, 20, 0])
def test_scan_is_read_back_with_its_fields_and_notes_as_far_as_it_came(tmp_path, direction, lines_done):
    image = scans.scanned(lines_done, direction=direction, angle=0.3, overscan=0.2, line_rate=2.0)
    read = read_scan(write_sxm(tmp_path / "scan.sxm", image))
    same(read, image)
    assert (read.scan, read.units, read.metadata) == (image.scan, image.units, image.metadata)
    for name in ("start", "line_rate", "lines_done", "complete"):
        assert getattr(read, name) == getattr(image, name), name


def of_others(path: Path) -> Path:
    """The same file without the key that only this package writes."""
    content = re.sub(rb"\n:Virtual AFM>Scan:\n[^\n]*", b"", path.read_bytes())
    other = path.with_name("other.sxm")
    other.write_bytes(content)
    return other


@ways
@pytest.mark.parametrize("lines_done", [32, 10, 0])
def test_scan_of_another_program_is_read_by_its_header(tmp_path, direction, lines_done):
    frame = {"pixels": 128, "lines": 32, "size_y": 60e-9, "angle": -0.7, "direction": direction}
    image = scans.scanned(lines_done, **frame)
    read = read_sxm(of_others(write_sxm(tmp_path / "scan.sxm", image)))
    same(read, image)
    for name in ("size_x", "size_y", "centre_x", "centre_y", "angle", "pixels", "lines"):
        assert getattr(read.scan, name) == pytest.approx(getattr(image.scan, name), rel=1e-12), name
    assert read.scan.direction == direction
    assert read.line_rate == pytest.approx(0.998)
    assert (read.lines_done, read.complete) == (lines_done, lines_done == 32)
    assert read.metadata["REC_DATE"]


def test_channel_that_has_no_way_back_is_nan_there(tmp_path):
    path = write_sxm(tmp_path / "scan.sxm", scans.scanned(pixels=8, lines=4))
    content = of_others(path).read_bytes().replace(b"\tLateral_Force\tN\tboth", b"\tInput_7\tA\tforward")
    path.write_bytes(content[: -4 * 8 * 4])
    read = read_sxm(path)
    assert read.units == {"height": "m", "error": "V", "Input 7": "A"}
    assert np.isfinite(read.data["Input 7", "trace"]).all() and np.isnan(read.data["Input 7", "retrace"]).all()


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda content: content[:-1], "buffer"),
        (lambda content: b"", "it is no .sxm file"),
        (lambda content: content.replace(b":SCANIT_END:", b":SCAN_END:"), "it is no .sxm file"),
        (lambda content: content.replace(b":SCAN_PIXELS:\n64 64", b":SCAN_PIXELS:\n64"), "not enough values"),
        (lambda content: content.replace(b":SCAN_DIR:\nup", b":SCAN_DIR:\nsideways"), "direction"),
        (lambda content: content.replace(b'{"verb"', b'["verb"'), "Expecting"),
    ],
)
def test_file_that_is_no_scan_is_refused_in_a_sentence(tmp_path, spoil, why):
    path = write_sxm(tmp_path / "scan.sxm", scans.scanned())
    if why == "direction":
        path = of_others(path)
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(ResultFileError) as refused:
        read_scan(path)
    assert str(refused.value).startswith(f"{path} cannot be read as a scan: ")
    assert why in str(refused.value)


def test_height_can_be_the_map_of_a_sample(tmp_path):
    image = scans.scanned(direction="down", pixels=32, lines=48, size_y=100e-9)
    found = read_field(str(write_sxm(tmp_path / "scan.sxm", image)))
    np.testing.assert_array_equal(found.values, image.data["height", "trace"].astype(np.float32))
    assert (found.width, found.height) == (200e-9, 100e-9)


@pytest.fixture(scope="module")
def measured(tmp_path_factory) -> Any:
    """A letter F of unequal arms, scanned at an angle and off centre; the file is then scanned as a sample."""
    folder = tmp_path_factory.mktemp("measured")
    heights = np.zeros((32, 32))
    heights[6:26, 8:12] = heights[22:26, 8:26] = heights[14:18, 8:19] = 5e-9
    np.save(folder / "letter.npy", heights)
    sample = {"kind": "map", "file": str(folder / "letter.npy"), "width": 400e-9}
    with Microscope("two_materials", sample=sample) as microscope:
        microscope.approach(rate=20e-6)
        frame = {"size_x": 300e-9, "size_y": 200e-9, "pixels": 48, "lines": 16, "line_rate": 20.0}
        first = microscope.lift(**frame, centre_x=20e-9, centre_y=-30e-9, angle=math.radians(30.0), lift=100e-9)
    path = write_sxm(folder / "letter.sxm", first)
    frame |= {"size_x": 250e-9, "size_y": 150e-9}
    with Microscope("two_materials", sample={"kind": "map", "file": str(path)}) as microscope:
        microscope.approach(rate=20e-6)
        again = microscope.scan(**frame, direction="down")
    return path, first, again


def test_lifted_scan_of_the_microscope_is_read_back_with_the_channels_of_both_passes(measured):
    path, first, _ = measured
    read = read_scan(path)
    assert isinstance(read.scan, Lift) and read.scan.lift == 100e-9
    assert "deflection_lift" in read.units
    np.testing.assert_array_equal(
        read.data["height", "trace"], first.height.sel(direction="trace").values.astype(np.float32)
    )


def test_scan_of_the_file_of_a_scan_shows_the_same_letter_at_the_same_place(measured):
    _, first, again = measured
    # Both have their middle at 0 of their own frame.
    there = first.height.sel(direction="trace").interp(x=again.x, y=again.y)
    here = again.height.sel(direction="trace")
    plain, *turned = (
        float(np.corrcoef(np.ravel(each), np.ravel(there))[0, 1])
        for each in (here.values, here.values[::-1], here.values[:, ::-1], here.values[::-1, ::-1])
    )
    assert plain > 0.9 > max(turned)
