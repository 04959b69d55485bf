"""Claims about what is measured in images: contrast, step heights, edges, loops of a line, roughness, correlation."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from afm_model.analysis import (
    Estimate,
    contrast,
    correlation_length,
    edges,
    friction_loop,
    line_loop,
    roughness,
    step_height,
    step_heights,
    two_levels,
)

X = (np.arange(400) + 0.5) * 2.5e-9
"""Places of pixels [m]."""


def red(rng: np.random.Generator, shape: tuple[int, ...], memory: float) -> np.ndarray:
    """Noise of unit rms whose correlation along the last axis falls by `memory` in a sample."""
    return np.asarray(lfilter([math.sqrt(1.0 - memory**2)], [1.0, -memory], rng.standard_normal(shape), axis=-1))


def test_correlation_length_is_that_of_the_noise(rng):
    for memory in (0.0, 0.8, 0.95):
        expected = (1.0 + memory) / (1.0 - memory)
        lengths = [correlation_length(red(rng, (5000,), memory)) for _ in range(20)]
        assert np.mean(lengths) == pytest.approx(expected, rel=0.15)


def stripes(ratio: float, lines: int = 40) -> np.ndarray:
    """Friction of two materials in stripes of 250 nm."""
    return np.tile(np.where((X // 250e-9) % 2 == 1, ratio, 1.0), (lines, 1))


def test_contrast_of_two_materials_is_found(rng):
    image = 2e-9 * (stripes(0.5) + 0.1 * red(rng, (40, 400), 0.9))
    low, high = two_levels(image, margin=3)
    found = contrast(image, high, low)
    assert found.ratio.value == pytest.approx(0.5, abs=0.015)
    assert found.lines == 40


def test_what_a_whole_line_has_too_much_is_not_in_the_uncertainty_of_the_ratio(rng):
    image = stripes(0.5) * (1.0 + 0.1 * rng.standard_normal((40, 1)))
    found = contrast(image, stripes(0.5) == 1.0, stripes(0.5) == 0.5)
    assert found.ratio.value == pytest.approx(0.5, rel=1e-12)
    assert found.ratio.uncertainty < 1e-12
    assert found.first.uncertainty > 0.01


def test_split_leaves_out_the_border_and_lines_that_were_not_measured():
    image = stripes(0.5)
    image[30:] = np.nan
    low, high = two_levels(image, margin=2)
    assert not (low | high)[30:].any()
    assert not (low & high).any()
    # Three borders, two pixels left out on each side; the edge of the image is no border.
    assert (low | high)[0].sum() == 400 - 3 * 4
    assert (low | high)[29].sum() == 400 - 3 * 4
    assert contrast(image, high, low).ratio.value == pytest.approx(0.5)


def test_image_of_one_material_has_no_two_levels(rng):
    with pytest.raises(ValueError, match=r"has not two levels: a split explains 6[0-9] %"):
        two_levels(rng.standard_normal((50, 50)), smooth=0.0)
    with pytest.raises(ValueError, match="all of its values are equal"):
        two_levels(np.ones((5, 5)))
    with pytest.raises(ValueError, match="margin = 110 leaves nothing"):
        two_levels(stripes(0.5), margin=110)


def test_contrast_needs_both_regions_in_a_line():
    image = np.vstack([np.ones((4, 10)), 2.0 * np.ones((4, 10))])
    low, high = two_levels(image, margin=0, smooth=0.0)
    with pytest.raises(ValueError, match="no line has both regions"):
        contrast(image, low, high)
    with pytest.raises(ValueError, match="must have the same shape"):
        contrast(image, low[:3], high)


def grating(tilt: float = 0.0, bow: float = 0.0) -> np.ndarray:
    """A line over ridges of 20 nm, 200 nm wide every 450 nm, with rounded edges."""
    from_ridge = np.abs((X + 100e-9) % 450e-9 - 225e-9)
    z = 20e-9 * np.clip((from_ridge - 120e-9) / 10e-9, 0.0, 1.0)
    return z + tilt * (X - 0.5e-6) + bow * (X - 0.5e-6) ** 2


def test_step_height_is_recovered_under_tilt_and_bow():
    assert step_height(X, grating()).value == pytest.approx(20e-9, rel=1e-9)
    assert step_height(X, grating(tilt=0.05)).value == pytest.approx(20e-9, rel=1e-9)
    # A bow of 1.5 nm over the line.
    assert step_height(X, grating(bow=6e3)).value == pytest.approx(20e-9, rel=0.005)


def test_step_height_needs_a_plateau_with_neighbours():
    with pytest.raises(ValueError, match="needs at least two edges"):
        step_height(X, np.where(X > 0.5e-6, 20e-9, 0.0))
    with pytest.raises(ValueError, match="x must increase"):
        step_height(X[::-1], grating())
    with pytest.raises(ValueError, match="two lists of the same length"):
        step_height(X[:-1], grating())


def test_edges_have_their_places_widths_and_directions():
    # By hand: the middle of a slope of 10 nm is 125 nm from the middle of a valley, that is 125 nm from 125 nm and 575
    # nm; 10 % to 90 % of it are 8 nm.
    found = edges(X, grating())
    middle = np.array([each.place for each in found])
    expected = np.array([250e-9, 450e-9, 700e-9, 900e-9])
    assert len(found) == len(expected)
    assert middle == pytest.approx(expected, abs=0.5e-9)
    assert [each.width for each in found] == pytest.approx([8e-9] * len(found), abs=2e-9)
    assert [each.rising for each in found] == [bool(grating()[np.searchsorted(X, p) + 8] > 10e-9) for p in expected]


def test_edge_at_the_first_sample_has_a_width():
    x = np.arange(20.0)
    (only,) = edges(x, np.minimum(x, 1.0))  # 10 % to 90 % of a slope from the first sample to the second one
    assert (only.place, only.width, only.rising) == (0.5, pytest.approx(0.8), True)


def test_heights_of_neighbours_are_as_uncertain_as_the_plateaus_that_they_share():
    for count in (2, 3, 7):
        # Height n is level n + 1 less half of both levels beside it, of the other sign for every second one.
        of_levels = np.zeros((count, count + 2))
        for n in range(count):
            of_levels[n, n : n + 3] = np.array([-0.5, 1.0, -0.5]) * (-1.0) ** n
        shared = of_levels @ of_levels.T
        of_mean = shared.sum() / count**2
        scatter = (np.trace(shared) - shared.sum() / count) / (count - 1)
        found = step_heights._of_neighbours(Estimate(0.0, math.sqrt(scatter / count)), count)
        assert found.uncertainty == pytest.approx(math.sqrt(of_mean), rel=1e-12)


def test_noise_at_half_the_height_makes_no_edges(rng):
    line = grating() + 1e-9 * rng.standard_normal(400)
    assert len(edges(X, line)) == len(edges(X, grating()))


def test_loop_of_a_line_agrees_with_that_of_the_travels(rng):
    trace, retrace = 1.5 + 0.05 * red(rng, (400,), 0.8), -0.5 + 0.05 * red(rng, (400,), 0.8)
    found = line_loop(X, trace, retrace)
    assert found.half_width.value == pytest.approx(1.0, abs=4.0 * found.half_width.uncertainty)
    assert found.offset.value == pytest.approx(0.5, abs=4.0 * found.offset.uncertainty)
    assert math.isnan(found.stick_slope.value)
    # With turns in the line: the tip sticks over the first 20 pixels.
    stick = np.clip((X - X[0]) / 50e-9, 0.0, 1.0)
    forth = -1.0 + 2.0 * stick
    back = (1.0 - 2.0 * stick)[::-1]
    of_line = line_loop(X, forth, back)
    whole = friction_loop(
        np.concatenate([X[200:], X[::-1], X, X[::-1][:200]]),
        np.concatenate([forth[200:], back[::-1], forth, back[::-1][:200]]),
    )
    assert of_line.half_width.value == pytest.approx(whole.half_width.value)
    assert of_line.stick_slope.value == pytest.approx(2.0 / 50e-9, rel=1e-6)
    assert whole.stick_slope.value == pytest.approx(2.0 / 50e-9, rel=1e-6)


def test_loop_of_a_line_that_is_closed_is_refused():
    with pytest.raises(ValueError, match="the loop is not open"):
        line_loop(X, np.zeros(400), np.ones(400))
    with pytest.raises(ValueError, match="lists of the same length"):
        line_loop(X, np.zeros(10), np.zeros(400))
    for sliding in (0.0, 1.5):
        with pytest.raises(ValueError, match=f"sliding = {sliding:g} is not allowed"):
            line_loop(X, np.ones(400), np.zeros(400), sliding=sliding)


def test_roughness_is_that_of_a_sine_on_a_plane():
    i, j = np.mgrid[0:64, 0:512]
    waves = 3e-9 * np.cos(2.0 * np.pi * 16 * (j + 0.5) / 512.0) + 1e-6 * (i + 2.0 * j) / 64.0
    found = roughness(waves)
    assert found.Sq == pytest.approx(3e-9 / math.sqrt(2.0), rel=0.01)
    assert found.Sa == pytest.approx(3e-9 * 2.0 / math.pi, rel=0.01)
    assert found.Sz == pytest.approx(6e-9, rel=0.02)
    with pytest.raises(ValueError, match="at least four pixels: there are 0"):
        roughness(np.full((3, 3), np.nan))
