"""Claims about levelling."""

import numpy as np
import pytest

from afm_model.files import level_background, level_lines, level_plane

from . import scans


def tilted() -> tuple[np.ndarray, np.ndarray]:
    """A step of 5 nm on a plane that stands on 1 mm, and where the step is."""
    on = scans.shape(32, 48) > 0.5
    x, y = np.meshgrid(np.arange(48), np.arange(32))
    return 1e-3 + 2e-10 * x - 7e-10 * y + 5e-9 * on, on


def test_plane_is_taken_off_to_the_last_digits_and_the_mean_is_0(rng):
    values, on = tilted()
    plane = values - 5e-9 * on
    # A double holds 1 mm to 1e-19 m.
    np.testing.assert_allclose(level_plane(plane), 0.0, atol=2e-18)
    noisy = level_plane(plane + 1e-10 * rng.standard_normal(plane.shape))
    assert abs(noisy.mean()) < 1e-18


def test_step_that_is_excluded_comes_out_with_its_height(rng):
    values, on = tilted()
    flat = level_plane(values, on)
    np.testing.assert_allclose(flat, 5e-9 * on, atol=2e-18)
    # Not excluded, it tilts the plane.
    assert np.ptp(level_plane(values)[~on]) > 1e-9


def test_background_is_levelled_and_a_letter_on_it_does_not_tilt_it(rng):
    values, on = tilted()
    assert 0.1 < on.mean() < 0.5
    flat = level_background(values)
    np.testing.assert_allclose(flat, 5e-9 * on, atol=1e-15)
    noisy = level_background(values + 1e-10 * rng.standard_normal(values.shape))
    assert np.median(noisy[~on]) == pytest.approx(0.0, abs=2e-11)
    assert np.median(noisy[on]) == pytest.approx(5e-9, rel=0.01)
    # The plane through all of it is tilted by the letter.
    assert np.ptp(level_plane(values)[~on]) > 1e-9
    np.testing.assert_array_equal(level_background(np.zeros((4, 5))), np.zeros((4, 5)))


def test_what_is_not_measured_is_not_fitted_and_stays_nan():
    values, on = tilted()
    values[20:] = np.nan
    flat = level_plane(values, on)
    assert np.isnan(flat[20:]).all()
    np.testing.assert_allclose(flat[:20], 5e-9 * on[:20], atol=2e-18)
    by_line = level_lines(values, "median", exclude=on)
    assert np.isnan(by_line[20:]).all() and np.isfinite(by_line[:20]).all()


def test_one_line_and_one_column_are_levelled_too():
    for values in (np.linspace(1.0, 3.0, 7)[None, :], np.linspace(1.0, 3.0, 7)[:, None], np.full((1, 1), 5.0)):
        np.testing.assert_allclose(level_plane(values), 0.0, atol=1e-15)


@pytest.mark.parametrize(("by", "of"), [("mean", np.mean), ("median", np.median)])
def test_line_by_line_takes_jumps_between_lines_away(rng, by, of):
    on = scans.shape(32, 48) > 0.5
    jumps = 1e-8 * rng.standard_normal((32, 1))
    levelled = level_lines(jumps + 5e-9 * on, by, exclude=on)
    np.testing.assert_allclose(levelled, 5e-9 * on, atol=1e-20)
    values = jumps + rng.standard_normal((32, 48))
    np.testing.assert_allclose(level_lines(values, by), values - of(values, axis=1, keepdims=True), rtol=1e-12)


def test_polynomial_of_its_degree_is_taken_off_each_line(rng):
    x = np.linspace(-1.0, 1.0, 48)
    values = np.array([np.polynomial.Polynomial(rng.standard_normal(4))(x) for _ in range(8)])
    np.testing.assert_allclose(level_lines(values, "polynomial", 3), 0.0, atol=1e-13)
    assert np.abs(level_lines(values, "polynomial", 2)).max() > 0.01
    # Excluded pixels are levelled with the rest.
    exclude = np.zeros(values.shape, bool)
    exclude[:, 10:20] = True
    spiked = np.where(exclude, values + 5.0, values)
    np.testing.assert_allclose(level_lines(spiked, "polynomial", 3, exclude), 5.0 * exclude, atol=1e-12)


def test_nothing_to_fit_leaves_the_picture_as_it_was():
    nothing = np.full((3, 4), np.nan)
    for found in (level_plane(nothing), level_lines(nothing), level_lines(nothing, "polynomial")):
        np.testing.assert_array_equal(found, nothing)
    everything = np.ones((3, 4), bool)
    np.testing.assert_array_equal(level_plane(np.ones((3, 4)), everything), np.ones((3, 4)))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: level_plane(np.zeros(3)), "a picture has 2 dimensions, this one 1"),
        (lambda: level_plane(np.zeros((2, 3)), np.zeros((3, 2), bool)), r"exclude is \(3, 2\): it must be as"),
        (lambda: level_lines(np.zeros((2, 3)), "mode"), "by mean, median or polynomial, not by 'mode'"),
        (lambda: level_lines(np.zeros((2, 3)), "polynomial", 11), "degree 11 is not allowed: 0 to 10"),
    ],
)
def test_what_cannot_be_levelled_is_refused_in_a_sentence(call, message):
    with pytest.raises(ValueError, match=message):
        call()
