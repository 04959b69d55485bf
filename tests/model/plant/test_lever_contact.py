"""Claims about contact made and lost by the plant `lever`: snap-in, pull-off and hysteresis at their closed forms."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from afm_model.contact.maugis import branch, pull_off

from .lever_bench import LeverBench

QUIET = {"plant__tilt": 0.0, "plant__Q": 0.7, "plant__scanner": "stack_13um", "plant__modes": 1, "plant__tau": 1e3}
"""Damped, so that a slow ramp is quasi-static; without friction, which bends the cantilever as the tip slides along."""


def raised(z: np.ndarray) -> np.ndarray:
    """The sample raised by z, (n, 3)."""
    return np.column_stack([np.zeros((len(z), 2)), z])


def distance(b: LeverBench, r: Any) -> np.ndarray:
    """Between tip and sample before contact, counted from where -H R / (6 D^2) meets the contact [m]."""
    exact = branch(b.plant.contact, b.plant.transition)
    force = float(exact.at(np.array([exact.end]))[1][0]) * b.plant.contact_units.force
    R, hamaker = b.plant.cantilever_numbers.tip_radius, b.plant.pair_numbers.hamaker
    end = exact.least_indentation * b.plant.contact_units.indentation
    return math.sqrt(hamaker * R / (6.0 * abs(force))) + end - r.delta


@pytest.mark.parametrize("lever", ["ppp_lfmr", "snl_10b"])
def test_tip_snaps_in_at_the_distance_H_R_over_3_k_to_the_third_with_a_deflection_of_half_of_it(lever):
    b = LeverBench(**QUIET, plant__lever=lever, plant__gap=5e-9)
    c, hamaker = b.plant.cantilever_numbers, b.plant.pair_numbers.hamaker
    critical = (hamaker * c.tip_radius / (3.0 * c.k)) ** (1.0 / 3.0)
    # 5 um/s to 0.2 nm before, then 50 nm/s.
    free = 5e-9 - 1.5 * critical
    fast, slow = np.linspace(0.0, free, 1500), np.linspace(free, free + 0.6e-9, 12_000)
    r = b.run(raised(np.concatenate([fast, slow])))
    snapped = int(np.argmax(r.a > 0.0))
    assert 2000 < snapped < 13_000
    assert not r.a[:snapped].any()
    # The rest is stable until the pull rises faster than the spring: D + deflection = 1.5 D there.
    apart = distance(b, r) - r.tip
    assert apart[snapped - 200] == pytest.approx(1.5 * critical, rel=2e-2)
    # On the way each place is in balance.
    before = slice(2500, snapped - 500)
    balance = -hamaker * c.tip_radius / (6.0 * distance(b, r)[before] ** 2)
    assert c.k * r.tip[before] == pytest.approx(balance, rel=1e-2)
    assert -r.tip[before].min() < 0.5 * critical
    assert -r.tip[snapped - 50] == pytest.approx(0.5 * critical, rel=0.15)


@pytest.mark.parametrize(
    "values",
    [
        {"plant__contact": "jkr"},
        {"plant__contact": "dmt"},
        {},
        {"plant__K": 5e9, "plant__range": 0.3e-9},
        {"plant__K": 0.5e9, "plant__tip_radius": 3e-8},
    ],
    ids=["jkr", "dmt", "si_sio2", "soft", "very soft"],
)
def test_pull_off_force_is_that_of_the_exact_equations_within_1e_3(values):
    b = LeverBench(**QUIET, **values, reference__z_r=5e-9)
    c = b.plant.cantilever_numbers
    expected = pull_off(b.plant.contact, b.plant.transition) * b.plant.contact_units.force
    start = -(5e-9 + 0.97 * expected / c.k)
    z = np.concatenate([np.linspace(0.0, start, 6000), np.linspace(start, start - 0.2 * expected / c.k, 12_000)])
    r = b.run(raised(z))
    assert r.a[0] > 0.0
    assert r.a[-1] == 0.0
    # The deflection, as a user reads it, and the force itself.
    assert -c.k * r.shown.min() == pytest.approx(expected, rel=1e-3)
    assert -r.N.min() == pytest.approx(expected, rel=1e-3)


def test_hysteresis_of_a_force_curve_is_pull_off_less_snap_in():
    b = LeverBench(**QUIET, plant__gap=5e-9)
    c, hamaker = b.plant.cantilever_numbers, b.plant.pair_numbers.hamaker
    critical = (hamaker * c.tip_radius / (3.0 * c.k)) ** (1.0 / 3.0)
    force = pull_off("maugis", b.plant.transition) * b.plant.contact_units.force
    z = np.linspace(0.0, 12e-9, 12_000)
    back = np.linspace(12e-9, -30e-9, 30_000)
    r = b.run(raised(np.concatenate([z, back])))
    made, lost = int(np.argmax(r.a > 0.0)), len(r) - int(np.argmax(r.a[::-1] > 0.0)) - 1
    # Height of the sample where contact is made, the tip 1.5 D above; and where it is lost, the spring drawn out by the
    # force.
    exact, unit = branch("maugis", b.plant.transition), b.plant.contact_units.indentation
    d = exact.least_indentation + np.linspace(0.0, 2.0, 2000) ** 2
    at_pull_off = float(d[np.argmin(exact.solve(d)[1])]) * unit
    origin = float(distance(b, r)[0] + r.delta[0])  # of D, counted as indentation
    expected = (origin - 1.5 * critical) - (at_pull_off - force / c.k)
    # The ramp goes on by 0.1 nm while the tip jumps.
    assert r.Z[made] - r.Z[lost] == pytest.approx(expected, abs=0.1e-9)
    assert force / c.k > 20.0 * critical


def test_attraction_meets_the_contact_without_a_step():
    b = LeverBench(**QUIET, plant__gap=1e-9)
    from afm_model.plant.lever.contact import normal

    end = float(b.s.end)
    at = b._layout.places["plant_map"]
    near = [normal(end + way, b.s, b.p, b.block, at)[0] for way in (-1e-16, 1e-16)]
    assert near[0] == pytest.approx(near[1], rel=1e-3)
    far = normal(end - 10e-9, b.s, b.p, b.block, at)[0]
    assert -1e-2 * abs(near[0]) < far < 0.0


@pytest.mark.parametrize("transition", [0.3, 1.0, 1.62, 3.0])
def test_a_stiff_cantilever_follows_the_branch_to_the_fixed_grips_limit(transition):
    # Stiffer than the contact anywhere pulls: nothing is unstable down to the fold, which only fixed grips reach.
    def of_modulus(K: float) -> float:
        return LeverBench(**QUIET, plant__K=K).plant.transition - transition

    K = float(brentq(of_modulus, 1e7, 1e12, xtol=1e3))
    b = LeverBench(**QUIET, plant__K=K, plant__k=40.0, plant__f0=3e5 / 2.0, reference__z_r=0.0, plant__dt=2.5e-7)
    exact, units = branch("maugis", transition), b.plant.contact_units
    r = b.run(raised(np.linspace(0.0, -3.0 * units.indentation, 20_000)))
    touching = r[(r.a > 0.0)]
    a, force = exact.solve(np.maximum(touching.delta / units.indentation, exact.least_indentation))
    # Force and radius are on the branch at every step.
    assert touching.N / units.force == pytest.approx(force, abs=2e-4)
    assert touching.a / units.radius == pytest.approx(a, abs=2e-3)


@pytest.mark.parametrize("tilt", [0.0, 0.2])
def test_contact_that_a_tip_sticks_by_is_a_spring_of_the_radius_that_it_has_in_this_step(tilt):
    # Mindlin's 8 G* a, while the second mode swings at a third of the step's rate and the radius with it.
    b = LeverBench(plant__tilt=tilt, plant__f0=26e3, plant__tau=1e12)
    b.s.v[1] = 1e-4
    r = b.stay(200)
    assert r.stuck.all()
    assert np.ptp(r.a) > 0.02 * r.a.mean()
    spring = 8.0 * b.plant.pair_numbers.G * r.a
    assert r.T_y == pytest.approx(spring * (r.U_y - r.A_y), rel=2e-3, abs=1e-4 * np.abs(r.T_y).max())


@pytest.mark.parametrize("f0", [23e3, 25.5e3, 26e3])
def test_a_tip_that_has_landed_comes_to_rest_with_its_second_resonance_at_a_third_of_the_rate_of_the_step(f0):
    b = LeverBench(plant__tilt=0.0, plant__f0=f0, plant__scanner="stack_13um", plant__gap=2e-9)
    r = b.run(raised(2e-6 * 1e-6 * np.arange(1, 6001)))
    landed = int(np.argmax(r.a > 0.0))
    assert 100 < landed < 1500
    # 5 e-folds of the slowest, 2 Q / w of the free cantilever, after which the scanner goes on smoothly.
    rest = landed + math.ceil(5.0 * 2.0 * 40.0 / (2.0 * math.pi * f0) / 1e-6)
    assert r.a[rest:].all()
    assert np.abs(np.diff(r.delta[rest:], 2)).max() < 0.01 * b.plant.contact_units.indentation
