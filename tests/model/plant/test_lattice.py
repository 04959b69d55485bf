"""Claims about the plant `lever` on a sample of atoms; references: tomlinson.py, scipy's integration."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from .lever_bench import LeverBench
from .tomlinson import Tomlinson

A = 0.5e-9
UPRIGHT = {"plant__scanner": "stack_13um", "plant__tilt": 0.0}
# Pressing on the cantilever moves its tip along y: by whole rows, so that it stands on a row along x.
ON_A_ROW = {"line": 48e-9, "square": 48e-9, "hexagonal": 30.0 * math.sqrt(3.0) * 1e-9}


def bench(eta: float, **values: Any) -> tuple[LeverBench, Tomlinson]:
    """An upright cantilever on a lattice with rows along x, and the same as one spring on one potential."""
    given = UPRIGHT | {"sample__kind": "lattice", "sample__constant": A, "plant__apex_stiffness": 2.0} | values
    given["reference__z_r"] = ON_A_ROW[given.get("sample__lattice", "square")]
    b = LeverBench(**given, sample__barrier=1e-19)
    c = b.plant.cantilever_numbers
    springs = [
        (c.tip_height + 0.5 * c.thickness) ** 2 / c.k_torsion,
        1.0 / c.k_in_plane,
        1.0 / given["plant__apex_stiffness"],
    ]
    k = 1.0 / (sum(springs) + 1.0 / (8.0 * b.plant.pair_numbers.G * b.s.a))
    E = eta * k * A**2 / (2.0 * math.pi**2)
    return LeverBench(**given, sample__barrier=E), Tomlinson(k, A, E)


def along(x: np.ndarray, y: np.ndarray | float = 0.0) -> np.ndarray:
    """Way of the scanner (n, 3)."""
    return np.column_stack([x, np.broadcast_to(y, x.shape), np.zeros_like(x)])


def ramp(way: float, n: int) -> np.ndarray:
    """Way with a soft start, so that the scanner does not ring."""
    t = np.linspace(0.0, 1.0, n)
    return way * (t - np.sin(2.0 * np.pi * t) / (2.0 * np.pi))


@pytest.mark.parametrize("eta", [1.5, 3.0, 6.0, 20.0])
@pytest.mark.parametrize("lattice", ["line", "square", "hexagonal"])
def test_the_tip_slips_by_one_period_where_its_minimum_vanishes(eta, lattice):
    b, model = bench(eta, sample__lattice=lattice)
    n = 12_000
    way = 8.0 * A
    r = b.run(along(np.linspace(0.0, way, n)))
    jumps = np.flatnonzero(r.stuck == 0.0)
    assert len(jumps) == round((way - model.last_support) // A) + 1
    # The peak is the largest force of the potential, eta k a / 2 pi; the tip slips a little later.
    assert r.F_x.max() == pytest.approx(model.peak, rel=1e-4)
    assert model.peak == pytest.approx(model.k * A / (2.0 * math.pi) * eta, rel=1e-9)
    middle = 0.5 * (r.X[jumps] + r.X[jumps - 1])
    expected = model.last_support + A * np.arange(len(jumps))
    assert middle == pytest.approx(expected, abs=2.0 * way / n)
    landed = r.A_x[jumps] - A * np.arange(len(jumps))
    assert landed == pytest.approx(model.next_minimum(), abs=4e-3 * A)
    assert np.ptp(r.A_y) < 1e-6 * A


@pytest.mark.parametrize("eta", [1.5, 3.0, 6.0])
def test_lateral_force_at_the_slip_is_k_a_over_2_pi_times_the_root_of_eta_squared_less_1(eta):
    b, model = bench(eta)
    # Before the end the place runs away as a square root: 20 aN a step for the last 2 fm.
    near = model.last_support - 1e-5 * A
    r = b.run(along(np.concatenate([ramp(near, 4000), np.linspace(near, model.last_support + 1e-6 * A, 20_000)])))
    slip = int(np.flatnonzero(r.stuck == 0.0)[0])
    assert r.F_x[slip - 1] == pytest.approx(A * model.k / (2.0 * math.pi) * math.sqrt(eta**2 - 1.0), rel=5e-3)
    assert r.F_x[slip - 1] < 0.95 * r.F_x[:slip].max() or eta > 3.0


def test_stick_has_the_slope_of_spring_and_minimum_in_series():
    b, model = bench(4.0)
    r = b.run(along(np.linspace(0.0, 0.02 * A, 2000)))
    slope = np.polyfit(r.X, r.F_x, 1)[0]
    assert slope == pytest.approx(model.k * 4.0 / 5.0, rel=1e-3)


def test_sliding_is_smooth_and_without_loss_below_eta_1_and_loses_the_energy_of_its_slips_above():
    def mean_force(eta: float) -> tuple[float, float, Tomlinson]:
        b, model = bench(eta)
        r = b.run(along(np.linspace(0.0, 6.0 * A, 12_000)))
        period = r[-8000:]  # whole periods: four
        return float(period.F_x.mean()) / model.peak, float(np.diff(r.A_x).max()) / A, model

    for eta in (0.5, 0.95):
        force, longest, _ = mean_force(eta)
        assert abs(force) < 1e-3
        # A step of the scanner is a/2000; the tip goes 1/(1 - eta) times as fast at most.
        assert longest < 1.1 / 2000.0 / (1.0 - eta)
    for eta in (1.2, 2.0, 6.0):
        force, longest, model = mean_force(eta)
        assert force == pytest.approx(model.mean_force() / model.peak, abs=1e-3)
        assert longest > 0.2


MASS = 6e-11
SMOOTH = {"plant__apex_mass": MASS, "plant__dt": 2.5e-7}


@pytest.mark.parametrize(("eta", "damping"), [(3.0, 3e4), (5.5, 1e6), (12.0, 6e4)])
def test_motion_with_inertia_is_that_of_an_adaptive_integration(eta, damping):
    b, model = bench(eta, **SMOOTH, plant__apex_damping=damping)
    h, n = b.plant.dt, 7000
    r = b.run(along(ramp(3.5 * A, n)))
    t = h * np.arange(n + 1)
    support = CubicSpline(t, np.concatenate([[0.0], r.X]))
    expected = model.motion(support, MASS, damping, t)[1:]
    # Until the slips, which multiply a difference; all of it where damping is strong.
    first = np.flatnonzero(expected > 0.5 * A)[0]
    assert r.A_x[:first] == pytest.approx(expected[:first], abs=2e-3 * A)
    settled = round(expected[-1] / A)
    if damping == 1e6:
        assert r.A_x == pytest.approx(expected, abs=2e-2 * A)
        assert round(r.A_x[-1] / A) == settled


def test_order_of_the_scheme_with_inertia_is_two():
    ends = []
    for h in (4e-7, 2e-7, 1e-7):
        b, model = bench(3.0, **SMOOTH | {"plant__dt": h}, plant__apex_damping=2e5)
        n = round(4e-4 / h)
        r = b.run(along(ramp(1.6 * A, n)))
        t = h * np.arange(n + 1)
        expected = model.motion(CubicSpline(t, np.concatenate([[0.0], r.X])), MASS, 2e5, t)[1:]
        assert expected[-1] > 0.8 * A
        ends.append(np.abs(r.A_x - expected).max())
    assert np.log2(np.array(ends[:-1]) / ends[1:]) == pytest.approx(2.0, abs=0.2)
    assert ends[0] < 2e-2 * A


def slip_lengths(eta: float, damping: float) -> set[int]:
    """Periods from rest to rest, over twelve periods of slow sliding."""
    b, model = bench(eta, **SMOOTH, plant__apex_damping=damping)
    r = b.run(along(ramp(14.0 * A, 60_000)))
    # Where it stands just before the support has come to where the next slip may begin; it has come to rest there.
    ends = model.last_support + A * (np.arange(13) - 0.1)
    ends = ends[ends < r.X[-1]]
    place = np.round(r.A_x[np.searchsorted(r.X, ends)] / A - 0.1)
    return {int(step) for step in np.diff(place)}


def test_double_slips_come_at_eta_4_603_and_only_with_little_damping():
    assert 4.4934 == pytest.approx(math.tan(4.4934), rel=1e-3)  # eta = sqrt(1 + x^2), tan x = x
    dampings = (2e4, 4e4, 8e4)
    assert set.union(*(slip_lengths(4.4, damping) for damping in dampings)) == {1}
    assert set.union(*(slip_lengths(5.2, damping) for damping in dampings)) == {0, 1, 2}
    assert slip_lengths(5.2, 1e6) == {1}


def test_with_torsion_that_moves_the_tip_slips_at_the_same_places_and_rings_after_each():
    n, step = 30_000, 5e-7
    moving = {"plant__torsion": "moving", "plant__dt": step, "plant__Q_torsion": 10.0}
    b, model = bench(3.0, **moving)
    way = 4.0 * A
    r = b.run(along(ramp(way, n)))
    # Slips are a thousand steps and more apart: the ringing of torsion has ended long before the next one.
    jumps = np.flatnonzero(r.stuck == 0.0)
    first = jumps[np.diff(jumps, prepend=-n) > 1000]
    expected = model.last_support + A * np.arange(len(first))
    assert len(first) == 4
    assert 0.5 * (r.X[first] + r.X[first - 1]) == pytest.approx(expected, abs=4.0 * way / n)
    quiet = first - 100
    assert r.F_x[quiet] == pytest.approx(r.F_x[quiet[0]], rel=0.02)
    # Torsion goes beyond its new rest after a slip: it would not if it followed without delay.
    static, _ = bench(3.0, plant__dt=step)
    still = static.run(along(ramp(way, n)))
    for i in first:
        assert r.twist[i : i + 40].min() < still.twist[i + 3 : i + 40].min() - 0.1 * np.ptp(still.twist)
    assert r.twist[first[1] - 200] == pytest.approx(still.twist[first[1] - 200], rel=1e-3)
