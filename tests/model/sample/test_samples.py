"""Claims about the samples besides the paper's: consistent derivatives, rolling tips, files, contrast."""

import math
import struct
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import grey_dilation, map_coordinates

from afm_model import InstrumentParameters, ParameterError, build
from afm_model.compiled.records import record_at, size
from afm_model.core.registry import find
from afm_model.instrument.block import Layout
from afm_model.parts.signals import Surface
from afm_model.sample.dilation import dilated, offsets_under
from afm_model.sample.map_files import read_field
from afm_model.sample.mapped import relief

from ..plant.lever_bench import LeverBench, triangle

LEVER = {"plant.kind": "lever"}
ROUGH = {"sample.kind": "rough", "sample.pixels": 64, "sample.size": 400e-9, "sample.shortest": 40e-9}


class Place:
    """A sample at places in metres, everything in SI."""

    def __init__(self, values: dict[str, Any]) -> None:
        self.parameters: Any = build(InstrumentParameters, LEVER | values)
        layout = Layout(self.parameters)
        block = layout.make(self.parameters)
        self._sample = find("sample", self.parameters.sample.kind)
        self._p = layout.record(block, "sample_constants")
        self._map = block[layout.places["sample_map"] :]
        self._numbers = np.zeros(size(Surface))
        self._h = record_at(self._numbers, 0, Surface)

    def __call__(self, x: float, y: float = 0.0) -> Any:
        scales = self.parameters.scales
        self._h.adhesion = self._h.modulus = 1.0
        self._sample.surface(x / scales.x0, y / scales.x0, self._h, self._p, self._map)
        h, rise = self._h.copy(), scales.z0 / scales.x0
        h.height *= scales.z0
        for name in ("slope_x", "slope_y"):
            h[name] *= rise
        for name in ("curvature", "curvature_xx", "curvature_yy", "curvature_xy"):
            h[name] *= rise / scales.x0
        return h


def height_file(folder: Path, heights: np.ndarray) -> str:
    path = folder / "heights.npy"
    np.save(path, heights)
    return str(path)


@pytest.mark.parametrize(
    "values",
    [
        {"sample.kind": "plane", "sample.angle_x": 0.4, "sample.angle_y": -0.2},
        {"sample.kind": "grating", "sample.edge_radius": 100e-9, "sample.step": 300e-9, "sample.angle": 0.9553},
        ROUGH,
    ],
    ids=["plane", "grating", "rough"],
)
def test_slopes_and_curvatures_are_those_of_the_heights(values, rng):
    place, small = Place(values), 1e-12
    for x, y in rng.uniform(-2e-6, 2e-6, (100, 2)):
        h, right, up = place(x, y), place(x + small, y), place(x, y + small)
        assert (right.height - h.height) / small == pytest.approx(h.slope_x, rel=1e-3, abs=1e-5)
        assert (up.height - h.height) / small == pytest.approx(h.slope_y, rel=1e-3, abs=1e-5)
        assert (right.slope_x - h.slope_x) / small == pytest.approx(h.curvature_xx, rel=1e-2, abs=2e3)
        assert (up.slope_x - h.slope_x) / small == pytest.approx(h.curvature_xy, rel=1e-2, abs=2e3)
        assert (up.slope_y - h.slope_y) / small == pytest.approx(h.curvature_yy, rel=1e-2, abs=2e3)


@pytest.mark.parametrize("plant", ["lever", "compliant"])
def test_a_plane_rises_by_the_tangent_of_its_angles(plant):
    # The scales of length along x and z differ.
    place = Place(
        {"plant.kind": plant, "scales.x0": 3e-9, "sample.kind": "plane", "sample.angle_x": 0.4, "sample.angle_y": -0.2}
    )
    assert place(1e-9, 2e-9).height == pytest.approx(math.tan(0.4) * 1e-9 - math.tan(0.2) * 2e-9, rel=1e-12, abs=0.0)


def test_a_map_tells_its_largest_mean_curvature():
    width, amplitude, radius = 200e-9, 1e-9, 50e-9
    wave = 2.0 * math.pi / width
    heights = np.tile(amplitude * np.sin(wave * (np.arange(64) - 32) * width / 64), (64, 1))
    scales = build(InstrumentParameters, LEVER).scales
    made = relief(heights, width, width, wrap=True, dilate=False, R=radius, scales=scales)
    assert made.curvature == pytest.approx(0.5 * amplitude * wave**2, rel=1e-3)
    assert made.amplitude == pytest.approx(amplitude, rel=1e-6)


@pytest.mark.parametrize("angle", [0.5, 0.9553, 1.3])
def test_grating_is_the_path_of_a_ball_that_rolls_over_rounded_ridges(angle):
    r, step, pitch, top = 60e-9, 200e-9, 2e-6, 0.9e-6
    shape = {
        "sample.edge_radius": r,
        "sample.step": step,
        "sample.angle": angle,
        "sample.pitch": pitch,
        "sample.top": top,
    }
    place = Place({"sample.kind": "grating"} | shape)
    R = place.parameters.plant.cantilever_numbers.tip_radius
    # The rounded profile itself, by rolling a ball of radius r above and below the sharp one.
    x = np.linspace(0.0, 0.5 * pitch, 8001)
    corner = 0.5 * (pitch - top)
    sharp = np.clip((x - corner) * math.tan(angle) + step, 0.0, step)

    def rolled(profile: np.ndarray, radius: float, over: float) -> np.ndarray:
        reach = int(radius / (x[1] - x[0]))
        way = np.arange(-reach, reach + 1)
        ball = np.sqrt(np.maximum(radius**2 - (way * (x[1] - x[0])) ** 2, 0.0)) - radius
        padded = np.pad(profile, reach, mode="reflect")
        windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
        return over * (over * windows + ball).max(axis=1)

    # Closing rounds the inner edges, opening the outer ones; then the tip.
    rounded = rolled(rolled(sharp, r, 1.0), r, -1.0)
    rounded = rolled(rolled(rounded, r, -1.0), r, 1.0)
    path = rolled(rounded, R, 1.0)
    found = np.array([place(each).height for each in x])
    # The grid of 0.125 nm on a slope of 3.6.
    assert np.abs(found - path).max() < 0.6e-9
    assert place(0.0).height == 0.0
    assert place(0.5 * pitch).height == pytest.approx(step, rel=1e-12)


def test_grating_with_edges_sharper_than_the_tip_is_refused_with_the_place_and_with_what_to_do(tmp_path):
    with pytest.raises(ParameterError, match=r"at x = \+-7.*e-07 m, a tip of radius 1e-08 m touches at two") as told:
        build(InstrumentParameters, LEVER | {"sample.kind": "grating", "sample.edge_radius": 8e-9})
    for what, values in {
        "sample.edge_radius > 1e-08 m": {"sample.edge_radius": 1.01e-8},
        "plant.tip_radius < 8e-09 m": {"sample.edge_radius": 8e-9, "plant.tip_radius": 7.9e-9},
    }.items():
        assert what in str(told.value)
        build(InstrumentParameters, LEVER | {"sample.kind": "grating"} | values)
    assert "sample.kind = map" in str(told.value)
    ridges = np.tile(np.where(np.arange(64) // 16 % 2, 20e-9, 0.0), (8, 1))
    Place({"sample.kind": "map", "sample.file": height_file(tmp_path, ridges), "sample.width": 128e-9})


def test_rough_surface_has_its_rms_its_spectrum_and_its_seed():
    from afm_model.sample.rough import Rough, heights

    sample = Rough(rms=2e-9, pixels=512, size=4e-6, correlation=100e-9, hurst=0.7, shortest=40e-9)
    z = heights(sample)
    assert z.std() == pytest.approx(2e-9, rel=1e-12)
    power = np.abs(np.fft.fft2(z)) ** 2
    q = 2.0 * np.pi * np.fft.fftfreq(512, 4e-6 / 512)
    size = np.hypot(q[:, None], q[None, :])
    bands = [(size > low) & (size < 1.2 * low) for low in (2e7, 4e7, 8e7)]
    density = [power[band].mean() for band in bands]
    middle = [size[band].mean() for band in bands]
    # (1 + (q xi)^2)^-(1 + H); the mean over hundreds of waves is known to some percent.
    expected = [(1.0 + (each * 100e-9) ** 2) ** -1.7 for each in middle]
    assert density[1] / density[0] == pytest.approx(expected[1] / expected[0], rel=0.15)
    assert density[2] / density[1] == pytest.approx(expected[2] / expected[1], rel=0.15)
    assert power[size > 2.01 * np.pi / 40e-9].max() < 1e-20 * power.max()
    assert (heights(sample) == z).all()
    assert (heights(sample.model_copy(update={"surface_seed": 2})) != z).any()


def test_a_map_is_met_at_its_pixels_and_mirrored_or_repeated_beyond(tmp_path, rng):
    smooth = np.cumsum(np.cumsum(rng.standard_normal((16, 24)), axis=0), axis=1)
    file = {"sample.kind": "map", "sample.file": height_file(tmp_path, smooth), "sample.width": 24e-9}
    scaled = file | {"sample.height_unit": 1e-13, "sample.dilate": False}
    place = Place(scaled)
    expected = (smooth - smooth.mean()) * 1e-13
    for row, column in ((0, 0), (8, 12), (15, 23), (3, 20)):
        assert place((column - 12) * 1e-9, (row - 8) * 1e-9).height == pytest.approx(expected[row, column], abs=1e-22)
    assert place(12e-9, 0.0).height == pytest.approx(expected[8, 22], abs=1e-22)
    # Between them by the cubic spline through them.
    for v, u in rng.uniform((0.0, 0.0), (15.0, 23.0), (20, 2)):
        spline = map_coordinates(expected, [[v], [u]], order=3, mode="mirror")[0]
        assert place((u - 12) * 1e-9, (v - 8) * 1e-9).height == pytest.approx(spline, abs=1e-9 * np.ptp(expected))
    wrapped = Place(scaled | {"sample.border": "wrap"})
    assert wrapped(12e-9, 0.0).height == pytest.approx(expected[8, 0], abs=1e-22)


@pytest.mark.parametrize("wrap", [True, False], ids=["repeated", "mirrored"])
@pytest.mark.parametrize("shape", [(12, 15), (240, 201)], ids=["smaller than the tip", "many tiles"])
def test_dilation_has_the_bits_of_one_that_compares_every_place_with_every_other_under_the_tip(shape, wrap):
    R, step_x, step_y, every = 60e-9, 2e-9, 3e-9, 3
    rng = np.random.default_rng(3)
    # A step with noise, and a plain where nothing reaches far.
    fine = 1e-10 * rng.standard_normal(shape) + 8e-9 * (np.arange(shape[1]) < shape[1] // 3)
    offsets, ball = offsets_under(R, float(np.ptp(fine)), step_x, step_y)
    found = dilated(fine, every, offsets, ball, wrap)
    half_y, half_x = np.abs(offsets).max(axis=0)
    under = np.full((2 * half_y + 1, 2 * half_x + 1), -1e3)
    under[offsets[:, 0] + half_y, offsets[:, 1] + half_x] = ball
    expected = grey_dilation(fine, structure=under, mode="wrap" if wrap else "reflect")
    np.testing.assert_array_equal(found, expected[1::every, 1::every])
    # The ball itself, and nothing that could touch is left out.
    rows, columns = offsets.T
    distance = np.hypot(step_y * rows, step_x * columns)
    np.testing.assert_allclose(ball, np.sqrt(R**2 - distance**2) - R, atol=1e-21)
    i, j = (each.ravel() for each in np.mgrid[-40:41, -40:41])
    sag = R - np.sqrt(np.maximum(R**2 - (step_y * i) ** 2 - (step_x * j) ** 2, 0.0))
    assert set(zip(i[sag < np.ptp(fine)], j[sag < np.ptp(fine)], strict=True)) <= {*map(tuple, offsets.tolist())}


def test_dilation_takes_a_part_of_the_time_of_one_that_compares_all():
    fine = np.where(np.add.outer(np.arange(300), np.arange(300)) // 100 % 2, 20e-9, 0.0)
    offsets, ball = offsets_under(60e-9, 20e-9, 2e-9, 2e-9)
    half = int(offsets.max())
    under = np.full((2 * half + 1, 2 * half + 1), -1e3)
    under[offsets[:, 0] + half, offsets[:, 1] + half] = ball
    times = []
    for call in (
        lambda: dilated(fine, 3, offsets, ball, True),
        lambda: grey_dilation(fine, structure=under, mode="wrap"),
    ):
        begin = time.process_time()
        call()
        times.append(time.process_time() - begin)
    assert times[0] < 0.5 * times[1]


def test_a_map_sharper_than_the_tip_is_dilated_or_refused_with_the_place(tmp_path):
    # Valleys of radius 4 nm along y at x = 20 and -28 nm, for a tip of 10 nm.
    pitch, n = 1e-9, 96
    x = (np.arange(n) - n // 2) * pitch
    k = 2.0 * np.pi / 48e-9
    A = 1.0 / (4e-9 * k**2)
    profile = -A * np.cos(k * (x - 20e-9))
    heights = np.tile(profile, (8, 1))
    values = {
        "sample.kind": "map",
        "sample.file": height_file(tmp_path, heights),
        "sample.width": n * pitch,
        "sample.border": "wrap",
    }
    with pytest.raises(ParameterError, match=r"sharper than the tip at x = (2|-2\.8)e-08 m, y = "):
        build(InstrumentParameters, LEVER | values | {"sample.dilate": False})
    place = Place(values)
    # The apex of the ball, by the largest height seen from every place under it.
    u = np.linspace(-48e-9, 47e-9, 40_000)
    under = -A * np.cos(k * (u - 20e-9))
    # At the pixels to a hundredth of one; between them a kink is rounded over a pixel.
    for at, error in ((5e-9 + i * 0.5e-9, 0.03e-9 if i % 2 == 0 else 0.5e-9) for i in range(55)):
        way = np.abs(u - at) < 10e-9
        exact = (under[way] + np.sqrt(100e-18 - (u[way] - at) ** 2) - 10e-9).max()
        assert place(at).height + heights.mean() == pytest.approx(exact, abs=error)
    # On a crest of 4 nm the apex goes on a circle of 14 nm along x, and straight along y.
    assert 1.0 / (1.0 + place(-4e-9).curvature * 10e-9) == pytest.approx(1.0 - 0.5 * 10.0 / 14.0, rel=0.03)
    # R_e stays within its bounds.
    ratios = [1.0 / (1.0 + place(each).curvature * 10e-9) for each in np.linspace(-40e-9, 40e-9, 300)]
    assert 0.25 * (1.0 - 1e-9) <= min(ratios) < max(ratios) <= 4.0 * (1.0 + 1e-9)


def gsf(values: np.ndarray, width: float) -> bytes:
    rows, columns = values.shape
    head = (
        f"Gwyddion Simple Field 1.0\nXRes = {columns}\nYRes = {rows}\nXReal = {width}\nYReal = {width / 2}\n".encode()
    )
    head += b"\0" * (4 - len(head) % 4)
    return head + values[::-1].astype("<f4").tobytes()


def gwy(values: np.ndarray, width: float) -> bytes:
    rows, columns = values.shape

    def item(name: str, kind: str, content: bytes) -> bytes:
        return name.encode() + b"\0" + kind.encode() + content

    def packed(name: str, items: bytes) -> bytes:
        return name.encode() + b"\0" + struct.pack("<I", len(items)) + items

    numbers = struct.pack("<I", values.size) + values[::-1].astype("<f8").tobytes()
    field = item("xres", "i", struct.pack("<i", columns)) + item("yres", "i", struct.pack("<i", rows))
    field += item("xreal", "d", struct.pack("<d", width)) + item("yreal", "d", struct.pack("<d", width / 2))
    field += item("si_unit_xy", "o", packed("GwySIUnit", item("unitstr", "s", b"m\0"))) + item("data", "D", numbers)
    top = item("/filename", "s", b"x\0") + item("/0/data", "o", packed("GwyDataField", field))
    return b"GWYP" + packed("GwyContainer", top)


def sxm(values: np.ndarray, width: float) -> bytes:
    """The same scanned downwards: its first row is the top one, and the way back is another picture, mirrored."""
    rows, columns = values.shape
    pairs = {
        **{"NANONIS_VERSION": "2", "SCANIT_TYPE": "FLOAT MSBFIRST", "SCAN_PIXELS": f"{columns} {rows}"},
        **{"SCAN_RANGE": f"{width} {width if rows == columns else width / 2}", "SCAN_DIR": "down"},
        "DATA_INFO": "\tChannel\tName\tUnit\tDirection\tCalibration\tOffset\n\t14\tZ\tm\tboth\t1\t0",
    }
    head = "".join(f":{key}:\n{value}\n" for key, value in pairs.items()) + "\n:SCANIT_END:\n\n\n"
    return head.encode() + b"\x1a\x04" + np.stack([values[::-1], 7.0 + values[::-1, ::-1]]).astype(">f4").tobytes()


@pytest.mark.parametrize("write", [gsf, gwy, sxm], ids=["gsf", "gwy", "sxm"])
def test_files_of_other_programs_are_read_with_their_size_first_row_on_top(tmp_path, rng, write):
    values = rng.standard_normal((6, 9)).astype(np.float32).astype(float)
    path = tmp_path / f"a.{write.__name__}"
    path.write_bytes(write(values, 90e-9))
    field = read_field(str(path))
    assert (field.values == values).all()
    assert (field.width, field.height) == (90e-9, 45e-9)


def test_a_simple_field_without_a_size_has_none(tmp_path):
    path = tmp_path / "a.gsf"
    head = b"Gwyddion Simple Field 1.0\nXRes = 4\nYRes = 4\n"
    path.write_bytes(head + bytes(4 - len(head) % 4) + bytes(4 * 4 * 4))
    field = read_field(str(path))
    assert (field.width, field.height) == (0.0, 0.0)


def test_an_image_is_read_as_grey_from_its_bottom_up(tmp_path):
    from matplotlib.image import imsave

    grey = np.linspace(0.0, 1.0, 30).reshape(5, 6)
    imsave(tmp_path / "a.png", grey, cmap="gray", vmin=0.0, vmax=1.0)
    # 8 bits, twice rounded.
    assert read_field(str(tmp_path / "a.png")).values == pytest.approx(grey[::-1], abs=8e-3)


@pytest.mark.parametrize(
    ("content", "name", "told"),
    [
        (b"nothing", "a.gwy", "it does not begin as a Gwyddion file"),
        (b"nothing", "a.gsf", "it does not begin as a Gwyddion Simple Field"),
        (b"nothing", "a.npy", "cannot be read as a height map"),
        (b"nothing", "a.xyz", r"its name must end with one of \.npy, \.gsf"),
    ],
)
def test_a_file_that_is_no_map_is_refused_by_name(tmp_path, content, name, told):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ParameterError, match=told):
        build(InstrumentParameters, LEVER | {"sample.kind": "map", "sample.file": str(tmp_path / name)})


def test_a_map_with_a_hole_is_refused_with_the_place(tmp_path):
    heights = np.zeros((8, 8))
    heights[3, 5] = np.nan
    with pytest.raises(ParameterError, match="row 3, column 5 is no finite number"):
        build(InstrumentParameters, LEVER | {"sample.kind": "map", "sample.file": height_file(tmp_path, heights)})


@pytest.mark.parametrize("pattern", ["stripes", "squares"])
def test_patches_change_material_at_their_edges(pattern):
    other = {"sample.adhesion": 2.0, "sample.modulus": 0.25}
    place = Place({"sample.kind": "patches", "sample.pattern": pattern, "sample.width": 10e-9} | other)
    assert [place(x).strength for x in (5e-9, 15e-9, -5e-9, 25e-9)] == [1.0, 0.5, 0.5, 1.0]
    assert [place(x).adhesion for x in (5e-9, 15e-9)] == [1.0, 2.0]
    assert [place(x).modulus for x in (5e-9, 15e-9)] == [1.0, 0.25]
    assert place(5e-9, 15e-9).strength == (0.5 if pattern == "squares" else 1.0)


def test_friction_and_load_of_the_lever_follow_the_material():
    # Half the strength and twice the adhesion to the left of x = 0.
    patches = {"sample__kind": "patches", "sample__strength": 0.5, "sample__adhesion": 2.0}
    plain = LeverBench(plant__tilt=0.0, plant__scanner="stack_13um")
    doubled = LeverBench(plant__tilt=0.0, plant__scanner="stack_13um", plant__work_of_adhesion=0.2)
    b = LeverBench(plant__tilt=0.0, plant__scanner="stack_13um", **patches)
    r = b.run(np.column_stack([np.linspace(0.0, -4e-9, 8000), np.zeros((8000, 2))]))
    right = LeverBench(plant__tilt=0.0, plant__scanner="stack_13um", **patches)
    q = right.run(np.column_stack([np.linspace(0.0, 4e-9, 8000), np.zeros((8000, 2))]))
    assert q.F_max[-1] == pytest.approx(plain.s.F_max, rel=1e-4)
    # Of the same load on a plant of twice the adhesion. Hamaker and modulus are alike; the table is exact to 1e-4.
    assert r.N[-1] == pytest.approx(doubled.s.N, rel=2e-2)
    assert r.F_max[-1] == pytest.approx(0.5 * doubled.s.F_max, rel=2e-2)


@pytest.mark.parametrize("strengthening", [0.0, 0.05])
def test_a_map_of_the_modulus_is_as_a_plant_of_that_modulus(tmp_path, strengthening):
    """Indentation, contact radius, load, friction and stick slope, pressed in and slid to and fro."""
    flat, soft = height_file(tmp_path, np.zeros((8, 8))), tmp_path / "modulus.npy"
    np.save(soft, np.full((8, 8), 0.25))
    values = {"plant__tilt": 0.0, "plant__scanner": "stack_13um", "plant__strengthening": strengthening}
    sample = {"sample__kind": "map", "sample__file": flat, "sample__width": 1e-6, "sample__modulus_file": str(soft)}
    by_map, hard = LeverBench(**values, **sample), LeverBench(**values)
    numbers = hard.plant.pair_numbers
    by_plant = LeverBench(**values, plant__K=0.25 * numbers.K, plant__G=0.25 * numbers.G)
    n = 4000
    ways = np.column_stack([triangle(1e-9, n), np.zeros(2 * n), np.linspace(0.0, 2e-9, 2 * n)])
    one, other, third = (bench.run(ways) for bench in (by_map, by_plant, hard))
    for name in ("delta", "a", "N", "T_x", "F_max", "shown"):
        # The rows of the contact's table are apart, and exact to 1e-4.
        scale = np.abs(other[name]).max()
        assert one[name] == pytest.approx(other[name], abs=1e-3 * scale), name
        assert np.abs(third[name] - other[name]).max() > 2e-3 * scale, name


def test_a_rough_sample_is_scanned_without_losing_the_tip():
    values = {name.replace(".", "__"): value for name, value in ROUGH.items()}
    b = LeverBench(plant__scanner="stack_13um", plant__tilt=0.2, reference__z_r=100e-9, **values)
    n = 20_000
    way = 60e-9 * np.arange(n) / n
    r = b.run(np.column_stack([way, 0.3 * way, np.zeros(n)]))
    assert (r.a > 0.0).all()
    assert np.ptp(r.tip) > 0.5e-9
    # The tip follows the surface: within its indentation and the lateral give of the cantilever.
    place = Place(ROUGH)
    surface = np.array([place(x, y).height for x, y in zip(r.U_x[::500], r.U_y[::500], strict=True)])
    assert r.Z[::500] + surface - r.tip[::500] == pytest.approx(r.delta[::500], abs=0.05e-9)
