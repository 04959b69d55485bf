"""Claims about the test sample."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_model.contact.surface import effective_radius_ratio, surface

BETA, KX, KY, R = 0.125, 0.5, 0.4, 0.4
places = st.floats(-300.0, 300.0)


@given(places, places)
def test_slopes_are_the_derivatives_of_the_height(X, Y):
    _, H_X, H_Y = surface(X, Y, BETA, KX, KY)
    step = 1e-4
    along_x = (surface(X + step, Y, BETA, KX, KY)[0] - surface(X - step, Y, BETA, KX, KY)[0]) / (2.0 * step)
    along_y = (surface(X, Y + step, BETA, KX, KY)[0] - surface(X, Y - step, BETA, KX, KY)[0]) / (2.0 * step)
    # Central difference: k^3 beta step^2 / 6 = 3e-11, round-off of the height over the step 1e-12.
    assert H_X == pytest.approx(along_x, abs=1e-10)
    assert H_Y == pytest.approx(along_y, abs=1e-10)


@given(places, places)
def test_radius_follows_the_mean_curvature_of_the_height(X, Y):
    step = 1e-2
    H = surface(X, Y, BETA, KX, KY)[0]
    neighbours = sum(
        surface(X + dx, Y + dy, BETA, KX, KY)[0] for dx, dy in ((step, 0), (-step, 0), (0, step), (0, -step))
    )
    kappa = -0.5 * (neighbours - 4.0 * H) / step**2
    # Second difference: k^4 beta step^2 / 24 = 3e-8.
    assert effective_radius_ratio(H, KX, KY, R) == pytest.approx(1.0 / (1.0 + kappa * R), abs=1e-7)


def test_contact_is_sharper_on_a_hill_than_in_a_valley():
    hill, flat, valley = (effective_radius_ratio(H, 0.5, 0.5, R) for H in (BETA, 0.0, -BETA))
    assert hill < flat == 1.0 < valley


def test_sample_of_the_paper_repeats_every_4_pi():
    # The sine of an argument 4 pi larger: round-off of the argument.
    assert surface(1.0 + 4.0 * math.pi, 2.0, BETA, 0.5, 0.5) == pytest.approx(
        surface(1.0, 2.0, BETA, 0.5, 0.5), abs=1e-15
    )
