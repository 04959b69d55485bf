"""Claims about a letter without symmetry as .sxm: what readers from PyPI, in a folder of their own, make of it."""

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pypi import installed

from afm_model.files import read_sxm, write_sxm
from afm_model.microscope import Image, Scan

from .readers import field, gwyddion

PIXELS, LINES = 512, 128
_READ = """
import sys
import numpy, xarray, nanonispy2
path, written = sys.argv[1:]
found = {}
scan = nanonispy2.read.Scan(path)
header = scan.header
place = [*header["scan_offset"], *header["scan_range"], float(header["scan_angle"])]
found["place"] = numpy.array(place, dtype=float)
for name, ways in scan.signals.items():
    for way, values in ways.items():
        found[f"nanonispy2/{name}/{way}"] = values
data = xarray.open_dataset(path, engine="nanonis")
for name in data.data_vars:
    for way in data.dir.values:
        found[f"xarray_nanonis/{name}/{way}"] = data[name].sel(dir=way).values
found["size"] = numpy.array([data.x[-1], data.y[-1]])
found["units"] = numpy.array([data[name].attrs["units"] for name in data.data_vars])
numpy.savez(written, **found)
"""


@pytest.fixture(scope="module")
def packages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return installed(tmp_path_factory.mktemp("readers"), "nanonispy2==1.2.0", "xarray-nanonis==2025.10.0")


def letter(direction: str) -> Image:
    """An F of unequal arms, left of the middle, 30 degrees turned and off centre; friction on it is larger."""
    place = {"size_x": 800e-9, "size_y": 300e-9, "centre_x": 120e-9, "centre_y": -340e-9, "angle": math.radians(30.0)}
    scan = Scan(**place, pixels=PIXELS, lines=LINES, direction=direction)
    image = Image.empty(scan, {"height": "m", "lateral": "N"})
    on = np.zeros((LINES, PIXELS))
    on[16:112, 90:150] = on[96:112, 90:420] = on[56:70, 90:290] = 1.0
    noise = np.random.default_rng(1)
    for sign, way in ((1.0, "trace"), (-1.0, "retrace")):
        image.data["height", way][:] = 5e-9 * on + 1e-10 * noise.standard_normal(on.shape)
        image.data["lateral", way][:] = sign * (2e-9 + 2e-9 * on) + 1e-11 * noise.standard_normal(on.shape)
    image.lines_done, image.complete = LINES, True
    return image


@pytest.mark.long
@pytest.mark.parametrize("direction", ["up", "down"])
def test_every_pixel_of_an_asymmetric_letter_stands_where_each_reader_has_it(
    tmp_path: Path, packages: Path, direction: str
) -> None:
    image = letter(direction)
    path = write_sxm(tmp_path / "letter.sxm", image)
    written = tmp_path / "read.npz"
    found_in = os.environ | {"PYTHONPATH": str(packages)}
    subprocess.run([sys.executable, "-c", _READ, path, written], env=found_in, check=True)
    read = np.load(written)
    by_gwyddion = gwyddion(path, tmp_path)
    for channel, name in (("height", "Z"), ("lateral", "Lateral_Force")):
        for way, named in (("trace", "forward"), ("retrace", "backward")):
            values = image.data[channel, way].astype(np.float32)
            # Row 0 at the least y; the left pixel first.
            np.testing.assert_array_equal(read[f"xarray_nanonis/{name}/{named}"], values)
            # As stored: in the order of the scan, the way back from right to left.
            stored = values if direction == "up" else values[::-1]
            stored = stored if way == "trace" else stored[:, ::-1]
            np.testing.assert_array_equal(read[f"nanonispy2/{name}/{named}"], stored)
            # Row 0 at the top.
            shown, _ = field(by_gwyddion, f"{name} ({named.capitalize()})")
            np.testing.assert_array_equal(shown, values[::-1])
            np.testing.assert_array_equal(read_sxm(path).data[channel, way], values)
    assert read["place"] == pytest.approx([120e-9, -340e-9, 800e-9, 300e-9, -30.0])
    assert read["size"] == pytest.approx([800e-9, 300e-9])
    assert list(read["units"]) == ["m", "N"]
