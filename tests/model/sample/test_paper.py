"""Claims about the test sample."""

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_model.parts.signals import Surface
from afm_model.sample import paper

from ..tables import record_of

BETA, KX, KY = 0.125, 0.5, 0.4
places = st.floats(-300.0, 300.0)


def surface(X: float, Y: float, k_y: float = KY) -> Any:
    """The sample at a place, as a record of Surface."""
    h = record_of(Surface)
    paper.surface(X, Y, h, record_of(paper.Constants, beta=BETA, k_x=KX, k_y=k_y), 0)
    return h


@given(places, places)
def test_slopes_are_the_derivatives_of_the_height(X, Y):
    here = surface(X, Y)
    step = 1e-4
    along_x = (surface(X + step, Y).height - surface(X - step, Y).height) / (2.0 * step)
    along_y = (surface(X, Y + step).height - surface(X, Y - step).height) / (2.0 * step)
    # Central difference: k^3 beta step^2 / 6 = 3e-11, round-off of the height over the step 1e-12.
    assert here.slope_x == pytest.approx(along_x, abs=1e-10)
    assert here.slope_y == pytest.approx(along_y, abs=1e-10)


@given(places, places)
def test_curvatures_are_the_derivatives_of_the_slopes(X, Y):
    here = surface(X, Y)
    step = 1e-4
    right, left, above, below = (surface(X + dx, Y + dy) for dx, dy in ((step, 0), (-step, 0), (0, step), (0, -step)))
    # Central difference: k^4 beta step^2 / 6 = 1e-11, round-off of the slope over the step 1e-12.
    assert here.curvature_xx == pytest.approx((right.slope_x - left.slope_x) / (2.0 * step), abs=1e-10)
    assert here.curvature_yy == pytest.approx((above.slope_y - below.slope_y) / (2.0 * step), abs=1e-10)
    assert here.curvature_xy == pytest.approx((above.slope_x - below.slope_x) / (2.0 * step), abs=1e-10)


@given(places, places)
def test_mean_curvature_is_that_of_the_height_and_positive_on_a_hill(X, Y):
    step = 1e-2
    here = surface(X, Y)
    neighbours = sum(surface(X + dx, Y + dy).height for dx, dy in ((step, 0), (-step, 0), (0, step), (0, -step)))
    # Second difference: k^4 beta step^2 / 24 = 3e-8.
    assert here.curvature == pytest.approx(-0.5 * (neighbours - 4.0 * here.height) / step**2, abs=1e-7)


def test_sample_of_the_paper_repeats_every_4_pi():
    here, there = surface(1.0, 2.0, 0.5), surface(1.0 + 4.0 * math.pi, 2.0, 0.5)
    # The sine of an argument 4 pi larger: round-off of the argument.
    assert there.tolist() == pytest.approx(here.tolist(), abs=1e-15)


@given(places, places)
def test_friction_of_the_sample_is_that_of_the_contact_everywhere(X, Y):
    assert surface(X, Y).strength == 1.0
