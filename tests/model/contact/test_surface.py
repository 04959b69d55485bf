"""Claims about what the shape of the sample does to the contact."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from afm_model.contact.jkr import effective_radius_ratio
from afm_model.parts.signals import Surface
from afm_model.sample import paper

from ..tables import record_of

BETA, KX, KY, R = 0.125, 0.5, 0.4, 0.4
places = st.floats(-300.0, 300.0)


def surface(X: float, Y: float) -> object:
    """The test sample at a place."""
    h = record_of(Surface)
    paper.surface(X, Y, h, record_of(paper.Constants, beta=BETA, k_x=KX, k_y=KY), 0)
    return h


@given(places, places)
def test_radius_follows_the_mean_curvature_of_the_height(X, Y):
    step = 1e-2
    here = surface(X, Y)
    neighbours = sum(surface(X + dx, Y + dy).height for dx, dy in ((step, 0), (-step, 0), (0, step), (0, -step)))
    kappa = -0.5 * (neighbours - 4.0 * here.height) / step**2
    # Second difference: k^4 beta step^2 / 24 = 3e-8.
    assert effective_radius_ratio(here, R) == pytest.approx(1.0 / (1.0 + kappa * R), abs=1e-7)


def test_contact_is_sharper_on_a_hill_than_in_a_valley():
    # A quarter of a wave along both axes, and three quarters along one of them.
    x, y = 0.5 * math.pi / KX, 0.5 * math.pi / KY
    hill, flat, valley = (effective_radius_ratio(surface(*at), R) for at in ((x, y), (0.0, 0.0), (3.0 * x, y)))
    assert hill < flat == 1.0 < valley
