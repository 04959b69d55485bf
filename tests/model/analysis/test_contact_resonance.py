"""Claims about the stiffness of a contact from a resonance: that of boundary conditions and of finite elements."""

import itertools
import math

import numpy as np
import pytest
from scipy.optimize import brentq

from afm_model.analysis import Estimate, contact_stiffness

from ..plant.beam_elements import ElementBeam

F0, K, L = 77e3, 2.8, 225e-6


def resonances(stiffness: float, count: int) -> list[float]:
    """Of a beam whose upright tip is held by a spring, over the free one: its boundary conditions."""

    def at_end(x: float) -> float:
        # Shape cosh - cos + ratio (sinh - sin) along the beam, without a couple at its end: shear less spring.
        c, s, ch, sh = math.cos(x), math.sin(x), math.cosh(x), math.sinh(x)
        ratio = -(ch + c) / (sh + s)
        shear, end = x**3 * ((sh - s) + ratio * (ch + c)), (ch - c) + ratio * (sh - s)
        return shear - 3.0 * stiffness * end

    first = brentq(lambda x: math.cos(x) * math.cosh(x) + 1.0, 1.8, 2.0, xtol=1e-15)
    grid = np.linspace(0.5, 12.0, 231)
    brackets = [(a, b) for a, b in itertools.pairwise(grid) if at_end(a) * at_end(b) < 0.0]
    return [(brentq(at_end, *each, xtol=1e-14) / first) ** 2 for each in brackets[:count]]


@pytest.mark.parametrize("stiffness", [0.5, 8.0, 60.0, 400.0])
def test_stiffness_is_that_of_the_roots_of_the_boundary_conditions(stiffness):
    for number, ratio in enumerate(resonances(stiffness, 3)):
        found = contact_stiffness(ratio * F0, f0=F0, k=K, mode=number + 1)
        assert found.value == pytest.approx(stiffness * K, rel=1e-8)


@pytest.mark.parametrize(("tilt", "lateral"), [(0.2, 0.0), (0.0, 0.9), (0.2, 0.9), (-0.3, 2.0)])
@pytest.mark.parametrize("stiffness", [20.0, 200.0])
def test_tilt_and_a_tip_that_sticks_are_those_of_finite_elements(tilt, lateral, stiffness):
    height = 14e-6
    # The end moves by its deflection and turns; the tip hangs below it.
    along = np.array([math.sin(tilt), height * math.cos(tilt)])
    normal = np.array([math.cos(tilt), -height * math.sin(tilt)])
    springs = stiffness * (np.outer(normal, normal) + lateral * np.outer(along, along))
    for mode, f in enumerate(ElementBeam(K, L, F0).frequencies(springs)[:3], start=1):
        found = contact_stiffness(f, f0=F0, k=K, mode=mode, lateral=lateral, tilt=tilt, tip_height=height, length=L)
        assert found.value == pytest.approx(stiffness, rel=1e-4)


def test_uncertainty_is_that_of_the_resonance_times_the_slope():
    given = Estimate(3.1 * F0, 40.0)
    found = contact_stiffness(given, f0=F0, k=K)
    low, high = (contact_stiffness(3.1 * F0 + side * 40.0, f0=F0, k=K).value for side in (-1.0, 1.0))
    assert found.uncertainty == pytest.approx(0.5 * (high - low), rel=1e-3)


def test_a_pinned_end_hides_the_stiffness_as_the_page_says():
    first = resonances(100.0, 1)[0]
    assert contact_stiffness(1.001 * first * F0, f0=F0, k=K).value == pytest.approx(1.02 * 100.0 * K, rel=1e-3)
    assert resonances(1e6, 1)[0] == pytest.approx(4.39, abs=0.005)


@pytest.mark.parametrize(
    ("resonance", "values", "told"),
    [
        (
            0.9 * F0,
            {},
            "a resonance at 69300 Hz = 0.9 f0 is not allowed: no stiffness of a contact makes it that of mo",
        ),
        (4.5 * F0, {}, "= 4.5 f0 is not allowed: no stiffness of a contact makes it that of mode 1"),
        (3.0 * F0, {"mode": 2}, "no stiffness of a contact makes it that of mode 2"),
        (3.0 * F0, {"mode": 0}, "mode = 0 is not allowed: it must be >= 1"),
        (3.0 * F0, {"lateral": -1.0}, "lateral = -1 is not allowed: it must be >= 0"),
        (3.0 * F0, {"length": -1.0}, "length = -1 is not allowed: it must be a positive number"),
        (-1.0, {}, "resonance = -1 is not allowed: it must be a positive number"),
    ],
)
def test_what_no_contact_makes_is_refused_in_a_sentence(resonance, values, told):
    with pytest.raises(ValueError, match=told.replace("=", ".").replace(">", ".")):
        contact_stiffness(resonance, f0=F0, k=K, **values)
