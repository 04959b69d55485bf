"""Claims about the splines and the filter that replace scipy's and numpy's: the same numbers, but for round-off."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.ndimage import spline_filter

from afm_model.core.fourier import filtered
from afm_model.core.splines import b_spline_coefficients, clamped_spline, slopes, weighted


@pytest.mark.parametrize("shape", [(1, 8), (2, 3), (8, 13), (64, 65)])
@pytest.mark.parametrize(("wrap", "mode"), [(True, "grid-wrap"), (False, "mirror")])
def test_coefficients_are_those_of_the_spline_through_the_map(shape, wrap, mode, rng) -> None:
    values = rng.standard_normal(shape)
    found = b_spline_coefficients(values, wrap)
    assert found == pytest.approx(spline_filter(values, 3, mode=mode), abs=1e-13)
    if min(shape) > 1:
        at_nodes = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)
        assert weighted(found, at_nodes, at_nodes, wrap) == pytest.approx(values, abs=1e-13)


def test_clamped_spline_is_that_of_rest_at_both_ends(rng) -> None:
    for n in (2, 3, 50):
        values = rng.standard_normal(n)
        assert clamped_spline(values) == pytest.approx(CubicSpline(range(n), values, bc_type="clamped").c[::-1].T)


def test_slopes_are_exact_for_polynomials_of_degree_four() -> None:
    x = np.linspace(-1.0, 2.0, 9)
    assert slopes(x**4 - x**2, x[1] - x[0]) == pytest.approx(4.0 * x**3 - 2.0 * x, abs=1e-12)


@pytest.mark.parametrize("n", [16, 30, 37])
def test_filter_takes_each_wave_by_its_gain(n, rng) -> None:
    values, waves = rng.standard_normal((n, n)), np.minimum(np.arange(n), n - np.arange(n))
    gain = 1.0 / (1.0 + waves[:, None] ** 2 + 3.0 * waves[None, :])
    assert filtered(values, gain) == pytest.approx(np.fft.ifft2(np.fft.fft2(values) * gain).real, abs=1e-14)
