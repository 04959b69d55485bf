"""Claims about the gain of friction along y, which positions alone tell by the direction in which the tip slides."""

import math

import numpy as np
import pytest

from afm_predictive.constants import RATIO
from afm_predictive.gain_of_y import believe_gain_of_y, forget_gain_of_y, learn_gain_of_y
from afm_predictive.kalman import weigh
from afm_predictive.nominal_plant import as_one_mass, move

from .predictive_records import estimates
from .test_predictive_observer import covariance, records


@pytest.mark.parametrize("gains", [(1.0, 1.0), (1.04, 0.98), (0.8, 1.2)])
def test_the_tip_slides_along_the_balance_of_forces_whatever_the_gains_are(gains):
    p, s = records(surface="known")
    s.gain_of[0], s.gain_of[1] = gains
    s.X, s.Y, s.V_X, s.V_Y = 3.0, 4.0, 0.0, 0.0
    # What is left over along x and y in units of the lateral signal, just above the bound.
    t = np.array([math.cos(0.7), math.sin(0.7)])
    u = gains * (0.78 * float(p.f_0) * t) + np.array(p.stiffness[:2]) * (s.X, s.Y)
    move(u[0], u[1], p.stiffness[2] * s.Z, 0.05, 3, p, s)
    assert math.hypot(s.V_X, s.V_Y) > 0.01
    # It was off by the ratio of the gains.
    assert s.V_Y / s.V_X == pytest.approx(t[1] / t[0], rel=0.1 * abs(gains[1] / gains[0] - 1.0) + 1e-3)


def test_friction_lies_along_the_velocity_that_is_left(rng):
    for _ in range(50):
        p, n = rng.normal(size=2), rng.uniform(0.97, 1.03, 2)
        radius = rng.uniform(0.2, 0.99) * math.hypot(*p)
        q = np.array(as_one_mass(p[0], p[1], 4.0 * (n[0] - n[1]) / (n[0] + n[1]), radius))
        assert math.hypot(*q) == pytest.approx(math.hypot(*p), rel=1e-3)
        j = q * radius / math.hypot(*q)
        v = n * (p - j)
        across = (v[0] * j[1] - v[1] * j[0]) / math.hypot(*v) / radius
        plain = n * p * (1.0 - radius / math.hypot(*p))
        before = (plain[0] * p[1] - plain[1] * p[0]) / math.hypot(*plain) / math.hypot(*p)
        assert abs(across) < 0.1 * abs(before) + 2e-3
    assert as_one_mass(1.0, 2.0, 0.2, 3.0) == (1.0, 2.0)
    assert as_one_mass(0.0, 0.0, 0.2, 0.0) == (0.0, 0.0)


def test_the_bias_is_that_of_the_filter_with_it_as_a_sixth_state(rng):
    _, s = records()
    forget_gain_of_y(s)
    P, moved, variance = covariance(rng), rng.normal(size=5), float(s.variance_of_more)
    s.P[:], s.moved_by_more[:] = P, moved
    # With x = x' + V b the joint covariance is that of independent x' and b.
    T = np.eye(6)
    T[:5, 5] = moved
    joint = T @ np.block([[P, np.zeros((5, 1))], [np.zeros((1, 5)), np.array([[variance]])]]) @ T.T
    row, noise, innovation = rng.normal(size=5), 0.7, 0.4
    s.weights[:] = row
    learn_gain_of_y(innovation, weigh(noise, s), 0.0, True, s)
    H = np.append(row, 0.0)
    gain = joint @ H / (H @ joint @ H + noise)
    joint -= np.outer(gain, H @ joint)
    assert s.more_found == pytest.approx(gain[5] * innovation)
    assert s.variance_of_more == pytest.approx(joint[5, 5])
    assert np.array(s.moved_by_more) * s.variance_of_more == pytest.approx(joint[:5, 5])


def test_a_map_has_the_ratios_that_are_seen_with_the_gain_of_y_that_is_believed():
    p, s = records(surface="learned")
    forget_gain_of_y(s)
    s.map_ratio[:], s.change[:] = 1.0, 0.0
    # More gain along y, with which friction is seen along a direction that is nearer to x.
    s.moved_by_more[RATIO], s.more_found, s.variance_of_more = -0.5, 0.04, 1e-6
    believe_gain_of_y(p, s)
    assert s.change[RATIO] == pytest.approx(-0.02)
    assert np.array(s.map_ratio) == pytest.approx(0.98)


@pytest.mark.parametrize(("rate", "surface"), [(0, "observed"), (2, "known")])
@pytest.mark.parametrize(("title", "true"), [("resonance of x +2 %", 1.0), ("resonances +5 %", 1.1025)])
def test_the_gain_of_y_is_found_within_its_deviation(title, true, rate, surface):
    for seed in range(3):
        found = estimates(title, rate, surface, seed)
        off = found["lateral_gain_y"][-1] - true
        assert abs(off) < min(max(4.0 * found["lateral_gain_y_deviation"][-1], 0.005), 0.01)


@pytest.mark.parametrize("seed", range(3))
def test_y_is_as_x_before_more_is_known_of_it_so_that_friction_is_seen_where_it_lies(seed):
    found = estimates("lateral gain 0.9", 2, "learned", seed)
    begun = len(found["time"]) // 20
    # With a gain of x alone it was up to 0.968, and a map was made of that.
    assert np.max(found["friction_ratio"][begun:]) < 0.9 * 1.03


def test_nothing_is_believed_of_y_where_the_tip_never_slips_along_x():
    assert set(estimates("along y alone", 0, "known")["lateral_gain_y"]) == {1.0}


@pytest.mark.parametrize("seed", range(3))
def test_what_is_wrong_along_both_axes_is_not_taken_for_a_gain_of_y(seed):
    # Found before that of x was known it was 5 % off, for two periods.
    found = estimates("mass ratio +10 %", 1, "learned", seed)
    later = slice(len(found["time"]) // 6, None)
    assert np.max(np.abs(found["lateral_gain_y"][later] - 1.1)) < 0.005


def test_it_stays_that_of_x_where_it_is_the_same():
    found = estimates("the truth", 0, "observed")
    assert np.array_equal(found["lateral_gain_x"], found["lateral_gain_y"])
