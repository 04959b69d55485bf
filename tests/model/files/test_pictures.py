"""Claims about the pictures: what is where in them."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.axis import Axis
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from PIL import Image as Png

from afm_model.core.prefix import prefixed, text
from afm_model.files import (
    curve_picture,
    layer,
    layers,
    picture,
    sheet,
    write_curve_picture,
    write_picture,
    write_sheet,
)
from afm_model.files.picture import COLOURS, levelled, scale_bar

from . import scans


def pixels(path) -> np.ndarray:
    """Colours of a PNG, 0 to 1, row 0 at the top."""
    return np.asarray(Png.open(path).convert("RGB"), dtype=float) / 255.0


def near(colours: np.ndarray, colour) -> np.ndarray:
    """Where a picture has about this colour."""
    return np.abs(colours - np.asarray(colour)[:3]).max(axis=-1) < 0.15


def test_l_low_on_the_left_is_low_on_the_left(tmp_path):
    drawn = pixels(write_picture(tmp_path / "l.png", scans.scanned(), "friction"))
    left = drawn[:, : drawn.shape[1] * 5 // 6]  # without the bar of colours
    rows, columns = np.nonzero(near(left, colormaps[COLOURS](0.98)))
    middle = 0.5 * (rows.min() + rows.max())
    # The short bar at the lower end is longer than the long one is thick.
    lower, upper = columns[rows > rows.max() - 5], columns[rows < rows.min() + 5]
    assert np.ptp(lower) > 3.0 * np.ptp(upper)
    assert abs(lower.min() - upper.min()) <= 2
    assert middle > 0.45 * drawn.shape[0]


def test_what_is_not_measured_is_grey_at_the_top_of_a_scan_upwards(tmp_path):
    drawn = pixels(write_picture(tmp_path / "part.png", scans.scanned(20)))
    grey = np.all(np.abs(drawn - 0.82) < 0.01, axis=-1)
    rows = np.flatnonzero(grey.mean(axis=1) > 0.5)
    assert rows.max() < 0.75 * drawn.shape[0]
    assert len(rows) > 0.4 * drawn.shape[0]


@pytest.mark.parametrize("write", [write_picture, write_sheet])
def test_same_scan_gives_the_same_bytes(tmp_path, write):
    image = replace(scans.scanned(pixels=16, lines=16), units={"height": "m"})
    assert write(tmp_path / "a.png", image).read_bytes() == write(tmp_path / "b.png", image).read_bytes()


def test_picture_has_title_unit_and_scale_bar():
    figure = picture(scans.scanned())
    (axes,) = figure.axes
    (bar,) = axes.child_axes
    assert axes.get_title() == "Height\nless its background"
    assert bar.get_ylabel() == "nm"
    (drawn,) = axes.lines
    assert np.ptp(drawn.get_xdata()) == pytest.approx(50e-9 / 200e-9)
    (length,) = (each for each in axes.texts if each.get_text() == "50 nm")
    assert length.get_position()[1] == drawn.get_ydata()[0]
    assert figure.get_suptitle() == "200 nm x 200 nm, 64 x 64 pixels, 0.998 Hz"
    (shown,) = axes.images
    np.testing.assert_allclose(shown.get_array(), 1e9 * levelled(layer(scans.scanned(), "height_trace"))[0])


def test_sheet_shows_every_layer_traces_above_retraces():
    image = scans.scanned(20, angle=0.5)
    figure = sheet(image, "A sample")
    shown = [axes for axes in figure.axes if axes.images]
    places = {axes.get_title().splitlines()[0]: axes.get_subplotspec() for axes in shown}
    assert set(places) == {each.title for each in layers(image)}
    for title in ("Height", "Deflection Error", "Lateral Force"):
        above, below = places[title], places[f"{title} Retrace"]
        assert (above.rowspan.start, below.rowspan.start) == (0, 1)
        assert above.colspan == below.colspan
    assert places["Friction"].colspan == places["Crosstalk"].colspan
    assert max(each.colspan.stop for each in places.values()) == places["Friction"].get_gridspec().ncols
    assert figure.get_suptitle() == "A sample\n200 nm x 200 nm, 64 x 64 pixels, 0.998 Hz, 28.65°, 20 lines measured"


@pytest.mark.parametrize("lines_done", [0, 1])
def test_scan_of_no_line_and_of_one_is_drawn(tmp_path, lines_done):
    write_sheet(tmp_path / "sheet.png", replace(scans.scanned(lines_done, pixels=16, lines=16), units={"height": "m"}))


def test_layer_of_one_value_is_drawn_in_one_colour(tmp_path):
    image = scans.scanned(pixels=16, lines=16)
    image.data["height", "trace"][:] = 3e-9
    figure = picture(image, how="none")
    (low, high) = figure.axes[0].images[0].get_clim()
    assert (low, high) == pytest.approx((2.5, 3.5))


def drawn_as(values: np.ndarray, unit: str):
    """Limits of the colours, and their unit, of a picture of these values."""
    image = scans.scanned(pixels=16, lines=16)
    image.units["error"], image.data["error", "trace"] = unit, values
    (axes,) = picture(image, "error_trace").axes
    return axes.images[0].get_clim(), axes.child_axes[0].get_ylabel()


@pytest.mark.parametrize(
    ("unit", "offset", "noise", "span", "shown"),
    [
        ("m", 0.0, 3e-15, 1.0, "pm"),
        ("m", -4.6e-8, 3e-15, 1.0, "nm"),
        ("m", 0.0, 3e-11, None, "pm"),
        ("N", 0.0, 1e-17, 1.0, "pN"),
        ("V", 0.0, 1e-9, 100.0, "µV"),
        ("rad", 0.8, 1e-5, 1.0, "°"),
        ("rad", 0.8, 0.1, None, "°"),
    ],
)
def test_what_differs_by_less_than_any_instrument_measures_is_drawn_in_one_colour(unit, offset, noise, span, shown):
    values = offset + noise * np.random.default_rng(1).standard_normal((16, 16))
    (low, high), drawn = drawn_as(values, unit)
    assert drawn == shown
    if span is not None:
        assert high - low == pytest.approx(span, rel=1e-6)
    else:
        factor = {"pm": 1e12, "°": 180.0 / np.pi}[shown]
        assert (low, high) == pytest.approx(tuple(factor * np.percentile(values, (1.0, 99.0))))


def texts(figure) -> list[tuple[str, Bbox]]:
    """What is written in a figure, and its box [pixels]."""
    figure.draw_without_rendering()
    beyond = set()
    for axis in figure.findobj(Axis):
        low, high = sorted(axis.get_view_interval())
        # A tick beyond the ends of its axis is not drawn.
        beyond |= {tick.label2 for tick in axis.get_major_ticks() if not low <= tick.get_loc() <= high}
        beyond |= {tick.label1 for tick in axis.get_major_ticks() if not low <= tick.get_loc() <= high}
    found = (each for each in figure.findobj(Text) if each.get_visible() and each.get_text().strip())
    return [(each.get_text(), each.get_window_extent()) for each in found if each not in beyond]


FRAMES = {
    "square": {"pixels": 16, "lines": 16},
    "wide": {"pixels": 32, "lines": 8},
    "tall": {"pixels": 8, "lines": 32},
    "line": {"pixels": 32, "lines": 1},
}


@pytest.mark.parametrize("frame", FRAMES.values(), ids=list(FRAMES))
@pytest.mark.parametrize("draw", [picture, sheet])
def test_no_word_of_a_picture_is_written_over_another_one(draw, frame):
    image = scans.scanned(**frame)
    # Numbers with many digits, about an offset.
    image.data["lateral", "trace"] *= 1e-3
    image.data["lateral", "trace"] += 3.918e-9
    figure = draw(image, title="A title of the microscope that is as long as titles are")
    found = texts(figure)
    assert len(found) > 5
    for (one, here), (other, there) in combinations(found, 2):
        assert not here.overlaps(there), f"{one!r} and {other!r}"


def test_frame_that_is_flatter_than_a_fifth_is_stretched_and_its_title_says_so():
    (axes,) = picture(scans.scanned(pixels=32, lines=1)).axes
    assert axes.get_aspect() == pytest.approx(0.2 * 32)
    assert axes.get_title().splitlines()[-1] == "y drawn 6.4 times as long"
    (axes,) = picture(scans.scanned(pixels=32, lines=8)).axes
    assert axes.get_aspect() == 1.0 and "drawn" not in axes.get_title()


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("background", "less its background"),
        ("plane", "less its plane"),
        ("lines", "less the median of each line"),
        ("none", ""),
    ],
)
def test_levelling_of_a_picture_is_told_in_its_title(how, words):
    assert picture(scans.scanned(pixels=8, lines=8), how=how).axes[0].get_title().partition("\n")[2] == words


def test_levelling_of_another_name_is_refused():
    with pytest.raises(ValueError, match="levelled by background, plane, lines or none, not by 'parabola'"):
        picture(scans.scanned(pixels=8, lines=8), how="parabola")


@pytest.mark.parametrize(
    ("width", "bar"), [(200e-9, 50e-9), (100e-9, 20e-9), (90e-6, 20e-6), (6e-9, 2e-9), (3e-9, 1e-9)]
)
def test_scale_bar_is_the_largest_round_length_up_to_a_third_of_the_picture(width, bar):
    assert scale_bar(width) == pytest.approx(bar)


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        (1.5e-7, "m", "150 nm"),
        (-2e-9, "N", "-2 nN"),
        (0.0, "m", "0 m"),
        (1e-6, "m", "1 µm"),
        (999.9999e-9, "m", "1 µm"),
        (3e-16, "m", "0.3 fm"),
        (0.02, "m/s", "20 mm/s"),
        (3e-13, "m/sqrt(Hz)", "300 fm/sqrt(Hz)"),
        (3e-13, "m^2/Hz", "3e-13 m^2/Hz"),
        (7200.0, "s", "7200 s"),
        (2.0, "1", "2"),
        (1e4, "Hz", "10 kHz"),
        (1e-8, "m/V", "10 nm/V"),
        (0.5 * np.pi, "rad", "90°"),
        (5e-8, "N/V", "50 nN/V"),
        (np.nan, "m", "not measured"),
    ],
)
def test_numbers_are_told_with_the_prefix_that_people_use(value, unit, words):
    assert text(value, unit) == words


def test_prefix_of_nothing_is_none():
    assert prefixed("m", float("nan")) == prefixed("m") == (1.0, "m")
    assert prefixed("m", 1e-9, float("nan"), -2e-6) == (1e6, "µm")


def test_force_curves_are_drawn_from_their_turn_in_newton(tmp_path):
    curves = [scans.curve(0.0, 0.0), scans.curve(1e-9, 0.0)]
    (axes,) = curve_picture(curves).axes
    assert axes.get_title() == "2 force curves"
    assert axes.get_ylabel() == "force [nN]"
    lines = [line for line in axes.lines if line.get_label() in ("approach", "retract")]
    assert [line.get_label() for line in lines] == ["approach", "retract"]
    (zero,) = (line for line in axes.lines if len(line.get_xdata()) == 2)
    assert list(zero.get_ydata()) == [0.0, 0.0]
    read = curves[0].record.channels
    z, force = lines[0].get_data()
    assert len(z) == np.count_nonzero(read["phase"] == read["phase"][0])
    assert z.max() == pytest.approx(0.0, abs=0.2)
    assert force.max() == pytest.approx(1e9 * 0.2 * 1e-7 * read["deflection_voltage"].max())
    drawn = pixels(write_curve_picture(tmp_path / "curves.png", curves))
    assert near(drawn, (1.0, 0.5, 0.05)).any()
    with pytest.raises(ValueError, match="no force curve"):
        curve_picture([])
