"""Claims about the wedge methods: exact for the friction they are made for, and what they recover of the simulator."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from afm_model.analysis import Estimate, means, wedge_by_flat, wedge_ogletree, wedge_varenberg

from .bench import grating_line

STEEP, MILD = math.radians(54.74), math.radians(25.0)
TRUE = 5e-8
"""Lateral sensitivity of the simulated detector [N/V]."""


def forces(load: np.ndarray, angle: float, friction) -> tuple[np.ndarray, np.ndarray]:
    """Lateral forces up and down a slope, from the balance of forces on the tip with friction(N)."""
    s, c = math.sin(angle), math.cos(angle)
    found = []
    for way in (1.0, -1.0):
        # N n + F t holds the load, n = (s, c) and t = (c, -s) pointing up the slope as the sample pushes the tip.
        N = [brentq(lambda N: c * N - way * s * friction(N) - L, 1e-12, 1e-6, xtol=1e-22) for L in load]  # noqa: B023
        found.append(np.array([s * n + way * c * friction(n) for n in N]))
    return found[0], found[1]


LOADS = np.array([5e-9, 10e-9, 20e-9, 40e-9])


@pytest.mark.parametrize("angle", [MILD, STEEP])
@pytest.mark.parametrize("m", [0.02, 0.2, 0.5])
def test_ogletree_is_exact_for_friction_in_proportion_to_load_and_adhesion(angle, m):
    up, down = forces(LOADS, angle, lambda N: m * (N + 6e-9))
    # Zeros of load and signal have no say.
    found = wedge_ogletree(LOADS + 3e-9, up / TRUE + 0.4, LOADS - 1e-9, down / TRUE + 0.4, angle)
    assert found.sensitivity.value == pytest.approx(TRUE, rel=1e-9)
    assert found.friction.value == pytest.approx(m, rel=1e-9)
    assert found.sensitivity.uncertainty < 1e-7 * TRUE


@pytest.mark.parametrize("angle", [MILD, STEEP])
@pytest.mark.parametrize("m", [0.02, 0.2, 0.5])
def test_varenberg_is_exact_at_one_load_with_adhesion(angle, m):
    up, down = forces(LOADS[1:2], angle, lambda N: m * (N + 6e-9))
    half, offset = 0.5 * float(up[0] - down[0]) / TRUE, 0.5 * float(up[0] + down[0]) / TRUE + 0.3
    found = wedge_varenberg(LOADS[1], half, offset, 0.3, angle, 6e-9)
    assert found.sensitivity.value == pytest.approx(TRUE, rel=1e-9)
    assert found.friction.value == pytest.approx(m, rel=1e-9)


@pytest.mark.parametrize("angle", [MILD, STEEP])
def test_wedge_by_flat_is_right_for_any_law_of_friction(angle):
    def friction(N: float) -> float:
        return 2.5e-9 * ((N + 6e-9) / 6e-9) ** (2.0 / 3.0)

    up, down = forces(LOADS[:3], angle, friction)
    flat = np.geomspace(2e-9, 100e-9, 12)
    widths = np.array([friction(N) for N in flat]) / TRUE
    found = wedge_by_flat(flat, widths, LOADS[:3], up / TRUE, LOADS[:3], down / TRUE, angle)
    assert found.sensitivity.value == pytest.approx(TRUE, rel=2e-4)
    # The classical method takes the straight line for granted.
    other = wedge_ogletree(LOADS[:3], up / TRUE, LOADS[:3], down / TRUE, angle)
    assert other.sensitivity.value > 1.01 * TRUE


def test_uncertainty_of_the_load_comes_through():
    up, down = forces(LOADS, STEEP, lambda N: 0.2 * (N + 6e-9))
    half, offset = 0.5 * (up - down) / TRUE, 0.5 * (up + down) / TRUE
    one = wedge_varenberg(Estimate(LOADS[0], 0.05e-9), half[0], offset[0], 0.0, STEEP, 6e-9)
    # A load that is 1 % off makes the sensitivity some 1 % off.
    assert 0.005 < one.sensitivity.uncertainty / TRUE < 0.03


def test_uncertainty_of_a_wedge_by_flat_is_the_scatter_of_its_result(rng):
    up, down = forces(LOADS, STEEP, lambda N: 3e-9)
    flat = np.geomspace(2e-9, 200e-9, 12)
    found = []
    for _ in range(8):
        of_flat, of_up, of_down = (2e-6 * rng.standard_normal(n) for n in (flat.size, LOADS.size, LOADS.size))
        widths = 3e-9 / TRUE + of_flat
        found.append(wedge_by_flat(flat, widths, LOADS, up / TRUE + of_up, LOADS, down / TRUE + of_down, STEEP))
    S = np.array([each.sensitivity for each in found])
    # Eight repetitions know a standard deviation to 27 %; Student's factor of 7 numbers is 1.2.
    assert 0.5 < np.median(S[:, 1]) / S[:, 0].std(ddof=1) < 3.0


def signals(angle: float, loads: tuple[float, ...]) -> dict[str, np.ndarray]:
    """Means over flat, uphill and downhill of a line of the grating at each load, as a user takes them."""
    rows = []
    for load in loads:
        line = grating_line(angle, load)
        place, on_slope = line.position, (line.slope - line.width, line.slope + line.width)
        trace, retrace = means(place, line.voltage, -15e-9, 15e-9)
        up, down = means(place, line.voltage, *on_slope)
        load_up, load_down = means(place, line.load, *on_slope)
        flat, zero = 0.5 * (trace.value - retrace.value), 0.5 * (trace.value + retrace.value)
        of_flat = means(place, line.load, -15e-9, 15e-9)[0].value
        rows.append((of_flat, flat, load_up.value, up.value - zero, load_down.value, down.value - zero))
    return dict(zip(("flat_load", "flat", "load_up", "up", "load_down", "down"), np.array(rows).T, strict=True))


def test_wedge_on_the_simulator_recovers_its_lateral_sensitivity_within_two_percent():
    v = signals(STEEP, (2.5e-9, 5e-9, 10e-9, 30e-9))
    part = slice(1, 3)  # loads on whose slope the normal force is among those of the flat
    found = wedge_by_flat(
        v["flat_load"], v["flat"], v["load_up"][part], v["up"][part], v["load_down"][part], v["down"][part], STEEP
    )
    assert found.sensitivity.value == pytest.approx(TRUE, rel=1e-2)
    assert 0.1 < found.friction.value < 0.25
    # Area friction: the law of the classical method holds to some percent on this slope, not better.
    steep = wedge_ogletree(v["load_up"], v["up"], v["load_down"], v["down"], STEEP)
    assert 1.01 < steep.sensitivity.value / TRUE < 1.05


def test_classical_wedge_on_a_mild_slope_recovers_the_lateral_sensitivity_within_two_percent():
    v = signals(MILD, (10e-9, 20e-9, 40e-9))
    found = wedge_ogletree(v["load_up"], v["up"], v["load_down"], v["down"], MILD)
    assert found.sensitivity.value == pytest.approx(TRUE, rel=2e-2)


def test_loads_beyond_those_of_the_flat_and_slopes_without_friction_are_refused():
    up, down = forces(LOADS, STEEP, lambda N: 0.2 * (N + 6e-9))
    with pytest.raises(ValueError, match="measure the flat there, too"):
        wedge_by_flat(LOADS, 0.2 * LOADS / TRUE, LOADS, up / TRUE, LOADS, down / TRUE, STEEP)
    with pytest.raises(ValueError, match="must go together"):
        wedge_by_flat(LOADS, LOADS[1:], LOADS, up, LOADS, down, STEEP)
    with pytest.raises(ValueError, match="half-widths on the flat must be positive and its loads rising"):
        wedge_by_flat(LOADS, -0.2 * LOADS / TRUE, LOADS, up / TRUE, LOADS, down / TRUE, STEEP)
    with pytest.raises(ValueError, match="no friction coefficient fits"):
        wedge_ogletree(LOADS, up, LOADS, -up, STEEP)
    with pytest.raises(ValueError, match="that of the slope"):
        wedge_ogletree(LOADS, up, LOADS, down, 0.0)
